/* Pictures open large, arrow keys turn pages, a term shows its definition, cells know their heads. */
(() => {
  "use strict";
  // --- pictures ----------------------------------------------------------------------------
  const large = document.createElement("dialog");
  large.className = "fpp-large";
  large.addEventListener("click", () => large.close());
  document.addEventListener("keydown", (e) => { if (e.key === "Escape" && large.open) large.close(); }, true);
  function enlarge(image) {
    const copy = new Image();
    copy.src = image.currentSrc || image.src;
    copy.alt = image.alt;
    large.replaceChildren(copy);
    large.setAttribute("aria-label", "Enlarged picture");
    large.showModal();
  }
  function offerPictures() {
    document.body.append(large);
    const played = new Set([...document.querySelectorAll("[data-instead-of]")].map((e) => e.dataset.insteadOf));
    for (const image of document.querySelectorAll("article figure img, article .cell_output img")) {
      if (image.closest("a, .fpp-live") || played.has(image.closest("figure")?.id)) continue;
      image.classList.add("fpp-enlarges");
      image.tabIndex = 0;
      image.setAttribute("role", "button");
      image.title = "Enlarge";
      image.addEventListener("click", () => enlarge(image));
      image.addEventListener("keydown", (e) => {
        if (e.key === "Enter" || e.key === " ") { e.preventDefault(); enlarge(image); }
      });
    }
  }

  // --- pages -------------------------------------------------------------------------------
  const BUSY = "input, select, textarea, button, summary, dialog, pre, table, .fpp-live, [contenteditable]";
  const TURNS = { ArrowLeft: ["prev", "left"], ArrowRight: ["next", "right"] };
  const beside = (way) => document.querySelector(`a.${way === "prev" ? "left" : "right"}-${way}`);
  document.addEventListener("keydown", (e) => {
    const [way] = TURNS[e.key] || [];
    if (!way || e.defaultPrevented || e.altKey || e.ctrlKey || e.metaKey || e.shiftKey) return;
    if (large.open || document.activeElement.closest(BUSY)) return;
    beside(way)?.click();
  });
  function hintKeys() {
    for (const [key, [way, side]] of Object.entries(TURNS)) {
      const link = beside(way);
      if (!link) continue;
      link.title = `${link.title} (${side} arrow key)`;
      link.setAttribute("aria-keyshortcuts", key);
    }
  }

  // --- terms -------------------------------------------------------------------------------
  function explain(link) {
    const tip = document.getElementById("tip-" + link.hash.slice(1));
    if (!tip) return;
    let leaving = 0;
    const show = () => {
      clearTimeout(leaving);
      tip.hidden = false;
      const at = link.getBoundingClientRect(), room = document.documentElement.clientWidth;
      const above = at.bottom + tip.offsetHeight > innerHeight && at.top > tip.offsetHeight;
      tip.style.left = `${scrollX + Math.max(8, Math.min(at.left, room - tip.offsetWidth - 8))}px`;
      tip.style.top = `${scrollY + (above ? at.top - tip.offsetHeight : at.bottom)}px`;
    };
    const hide = () => { leaving = setTimeout(() => { tip.hidden = true; }, 150); };
    link.setAttribute("aria-describedby", tip.id);
    link.removeAttribute("title");
    document.body.append(tip);
    for (const node of [link, tip]) {
      node.addEventListener("mouseenter", show);
      node.addEventListener("mouseleave", hide);
    }
    link.addEventListener("focus", show);
    link.addEventListener("blur", hide);
    link.addEventListener("keydown", (e) => { if (e.key === "Escape") tip.hidden = true; });
  }

  // --- tables of sentences: each cell knows its heading, for a narrow page ----------------
  function nameCells() {
    for (const table of document.querySelectorAll("article table:not(.fpp-live table)")) {
      const cells = [...table.querySelectorAll("tbody td")], heads = table.querySelectorAll("thead th");
      if (heads.length < 3 || cells.every((cell) => cell.textContent.length <= 50)) continue;
      table.classList.add("fpp-prose");
      for (const cell of cells) cell.dataset.head = heads[cell.cellIndex].textContent;
    }
  }

  offerPictures();
  hintKeys();
  nameCells();
  document.querySelectorAll("a.fpp-term").forEach(explain);
})();

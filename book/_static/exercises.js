/* Answers and predictions on a page. The tables of faults are those of fpputil.exercises. */
(() => {
  "use strict";

  // --- answers ---------------------------------------------------------------------------
  // "1.107", "-3", "1,107", "351.8, 223.3", "1e-3", "10.84 %"; null if it is something else
  function numbers(text, count, whole) {
    let plain = text.replaceAll("\u2212", "-").replace(/^[([\s]+|[)\]\s]+$/g, "");
    if (whole && /^\d{1,3}([,' ]\d{3})+$/.test(plain)) plain = plain.replace(/[,' ]/g, "");
    // "351,8 223,3": as many as are wanted without the commas, so these are decimal
    const parts = plain.split(/\s*;\s*|,?\s+(?![\s%]),?\s*/);
    if (parts.length === count && parts.every((part) => /^[^,]*(,[^,]+)?$/.test(part)))
      plain = parts.join(";").replaceAll(",", ".");
    const found = plain.split(/\s*[,;]\s*|\s+(?!%)/).map((part) => {
      const share = /^(.*?)\s*%$/.exec(part);
      const x = share ? share[1] : part;
      return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(x) ? x / (share ? 100 : 1) : NaN;
    });
    return found.some(Number.isNaN) ? null : found;
  }

  const size = (values) => Math.max(...values.map(Math.abs));
  // "" if it is right, null if nobody knows
  function readOff(answer, rows, { whole, words }) {
    for (const [values, tolerance, says] of rows)
      if (answer.every((x, k) => Math.abs(x - values[k]) <= tolerance * (1 + 1e-9))) return says;
    if (whole && !answer.every(Number.isInteger)) return words.NOT_WHOLE;
    const expected = rows[0][0], largest = size(expected);
    if (whole && answer.length === 1 && largest < words.SMALL_WHOLE)
      return answer[0] > expected[0] ? words.TOO_LARGE : words.TOO_SMALL;
    if (largest > 0 && size(answer) > 10 * largest) return words.LARGE;
    return 10 * size(answer) < largest ? words.SMALL : null;
  }

  function diagnose(text, data) {
    const { rows, parts, words } = data, count = rows[0][0].length;
    const answer = numbers(text, count, data.whole);
    if (answer === null) return `The text '${text.trim().slice(0, 40)}' given; ${data.amount} wanted.`;
    if (answer.length !== count)
      return `${answer.length === 1 ? "A number" : `${answer.length} numbers`} given; ${data.amount} wanted.`;
    const says = readOff(answer, rows, data);
    if (!parts.length || ![null, words.NOT_WHOLE, words.LARGE, words.SMALL].includes(says)) return says;
    const each = parts.map((part, k) => readOff([answer[k]], part, data));
    const wrong = words.PLACES.filter((_, k) => k < count && !["", words.NEARLY].includes(each[k]));
    if (!wrong.length) return words.NEARLY;
    if (wrong.length === 1) return `Only ${wrong[0]} is wrong. ${each[words.PLACES.indexOf(wrong[0])] || ""}`.trim();
    const faults = new Set(each.filter((word) => !["", words.NEARLY].includes(word)));
    const fault = faults.size === 1 ? [...faults][0] : wrong.length === count ? says : null;
    const which = `${wrong.slice(0, -1).join(", ")} and ${wrong.at(-1)} are wrong.`;
    return `${which[0].toUpperCase()}${which.slice(1)} ${fault || ""}`.trim();
  }

  const EXERCISES = [...document.querySelectorAll(".fpp-answer")];
  for (const form of EXERCISES) {
    const data = JSON.parse(atob(form.dataset.exercise)), output = form.querySelector("output");
    let wrong = 0;
    form.diagnose = (text) => diagnose(text, data);
    const show = (lines) => output.replaceChildren(...lines.map((line) => {
      const row = document.createElement("span");
      row.textContent = line;
      return row;
    }));
    form.hidden = false;
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const text = form.querySelector("input").value;
      if (!text.trim()) {
        form.dataset.says = "nothing";
        show([`Type ${data.amount}.`]);
        return;
      }
      const says = diagnose(text, data), lines = [];
      if (says === "") {
        wrong = 0;
        lines.push("Right.");
      } else if (says === data.words.NEARLY) {
        lines.push(says);
      } else {
        lines.push(`Not yet. ${says || ""}`.trim());
        const number = Math.min(wrong++, data.hints.length);
        if (number) lines.push(`Hint ${number} of ${data.hints.length}: ${data.hints[number - 1]}`);
      }
      form.dataset.says = says === "" ? "right" : says === data.words.NEARLY ? "nearly" : "wrong";
      show(lines);
    });
  }

  // --- predictions -----------------------------------------------------------------------
  const boxes = [...document.querySelectorAll(".fpp-predict")];
  const show = (box, shown) => {
    // browsers that can, find and jump to what is closed
    if (shown) box.removeAttribute("hidden");
    else box.setAttribute("hidden", "until-found");
    box.button.setAttribute("aria-expanded", shown);
    box.button.textContent = shown ? "Hide what happens" : "Show what happens";
  };
  for (const box of boxes) {
    box.button = document.createElement("button");
    box.button.type = "button";
    box.button.className = "fpp-show";
    box.button.setAttribute("aria-controls", box.id);
    box.button.addEventListener("click", () => show(box, box.hasAttribute("hidden")));
    box.addEventListener("beforematch", () => show(box, true));
    box.before(box.button);
    show(box, false);
  }
  const openAtAnchor = () => {
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    const closed = boxes.filter((box) => box.contains(target) && box.hasAttribute("hidden"));
    closed.forEach((box) => show(box, true));
    if (target && (closed.length || document.readyState !== "complete")) target.scrollIntoView();
  };
  openAtAnchor();
  window.addEventListener("hashchange", openAtAnchor);
})();

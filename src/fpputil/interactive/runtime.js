/* Figures that a reader can play with. No library, no network, no page but this one.
   A figure is <div class="fpp-live"> that holds its data as JSON; scan() brings it to life. */
(() => {
  "use strict";
  if (window.fppLive) return window.fppLive.scan();

  // --- small tools -----------------------------------------------------------------------
  const SVG = "http://www.w3.org/2000/svg";
  const put = (node, attributes, children) => {
    for (const [name, value] of Object.entries(attributes || {})) node.setAttribute(name, value);
    node.append(...(children || []));
    return node;
  };
  const html = (tag, attributes, ...children) => put(document.createElement(tag), attributes, children);
  const svg = (tag, attributes, ...children) => put(document.createElementNS(SVG, tag), attributes, children);
  const clamp = (x, low, high) => Math.min(high, Math.max(low, x));
  const DTYPES = { u1: Uint8Array, i1: Int8Array, u2: Uint16Array, i2: Int16Array, u4: Uint32Array, i4: Int32Array, f4: Float32Array, f8: Float64Array };

  async function bytes(text, packed) {
    const raw = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    if (!packed) return raw.buffer;
    const stream = new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }
  // {b64, dtype, shape, delta, scale, offset, none}: real = offset + scale * stored, `none` is no
  // value; with delta the differences from number to number are stored, modulo their type
  async function unpack(value) {
    if (Array.isArray(value)) return Promise.all(value.map(unpack));
    if (!value || typeof value !== "object") return value;
    if ("b64" in value) {
      const stored = new DTYPES[value.dtype](await bytes(value.b64, value.deflate));
      if (value.delta) for (let k = 1; k < stored.length; k++) stored[k] += stored[k - 1];
      stored.shape = value.shape; stored.scale = value.scale; stored.offset = value.offset; stored.none = value.none;
      stored.real = (k) => (stored[k] === value.none ? NaN : (value.offset || 0) + (value.scale || 1) * stored[k]);
      return stored;
    }
    const entries = await Promise.all(Object.entries(value).map(async ([k, v]) => [k, await unpack(v)]));
    return Object.fromEntries(entries);
  }

  // A minus is a minus; significant digits, not decimals, unless they are asked for.
  const show = (x, digits = 3) => {
    if (typeof x !== "number") return String(x);
    if (!Number.isFinite(x)) return "–";
    const text = Math.abs(x) >= 1e5 || (x && Math.abs(x) < 1e-4) ? x.toExponential(2)
      : Number.isInteger(x) ? String(x) : String(+x.toPrecision(digits));
    return text.replace("-", "−");
  };

  // Normal deviates that are the same in every browser: mulberry32 and Box-Muller.
  const random = (seed) => {
    let s = seed >>> 0;
    const uniform = () => {
      s = (s + 0x6d2b79f5) >>> 0;
      let t = Math.imul(s ^ (s >>> 15), 1 | s);
      t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
      return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
    };
    const normal = () => Math.sqrt(-2 * Math.log(1 - uniform())) * Math.cos(2 * Math.PI * uniform());
    return { uniform, normal };
  };
  const wrap = (x) => x - 2 * Math.PI * Math.round(x / (2 * Math.PI));

  // In JupyterLab the keys of a focused element are the notebook's (d d deletes the cell!), unless
  // the element itself, not one around it, bears this mark.
  const MINE = { "data-lm-suppress-shortcuts": "true" };

  // --- controls --------------------------------------------------------------------------
  let serial = 0;
  function controls(specs, changed) {
    const values = {}, rows = [], set = {};  // set.name(value) moves a control from elsewhere
    for (const s of specs) {
      const id = `fpp-live-${++serial}`;
      values[s.name] = s.value;
      const told = html("span"), said = html("output", { for: id }, told), name = html("label", { for: id }, s.label || s.name);
      let input;
      if (s.choices) {
        input = html("select", { id, name: s.name, ...MINE }, ...s.choices.map((c) => html("option", c === s.value ? { selected: "" } : {}, c)));
        input.addEventListener("change", () => { values[s.name] = input.value; changed(); });
        set[s.name] = (value) => { input.value = values[s.name] = value; changed(); };
      } else if (typeof s.value === "boolean") {
        input = html("input", { id, name: s.name, type: "checkbox", ...MINE, ...(s.value ? { checked: "" } : {}) });
        input.addEventListener("change", () => { values[s.name] = input.checked; changed(); });
        set[s.name] = (value) => { input.checked = values[s.name] = value; changed(); };
      } else {
        input = html("input", { id, name: s.name, type: "range", ...MINE, min: s.min, max: s.max, step: s.step, value: s.value });
        const tell = () => {
          values[s.name] = input.valueAsNumber;
          const text = (s.names ? s.names[values[s.name]] : show(values[s.name])) + (s.unit ? " " + s.unit : "");
          told.textContent = text;
          input.setAttribute("aria-valuetext", text);
        };
        input.addEventListener("input", () => { tell(); changed(); });
        set[s.name] = (value) => { input.value = value; tell(); changed(); };
        tell();
        if (s.play) said.append(" ", player(s, input, set));
      }
      rows.push(html("div", { class: "fpp-control" }, name, input, said));
    }
    if (specs.length > 1 && specs.some((s) => "min" in s)) {
      const again = html("button", { type: "button", class: "fpp-again", ...MINE }, "start again");
      again.addEventListener("click", () => specs.forEach((s) => set[s.name](s.value)));
      rows.push(again);
    }
    return { values, set, box: html("div", { class: "fpp-controls" }, ...rows) };
  }
  // A button that moves a slider on its own, round and round, until it is pressed again.
  function player(s, input, set) {
    const button = html("button", { type: "button", class: "fpp-play", "aria-label": `play ${s.label || s.name}`, ...MINE }, "▶");
    let timer = 0;
    button.addEventListener("click", () => {
      if (timer) { clearInterval(timer); timer = 0; button.textContent = "▶"; return; }
      button.textContent = "❚❚";
      timer = setInterval(() => set[s.name](input.valueAsNumber + s.step > s.max ? s.min : input.valueAsNumber + s.step), s.play);
    });
    return button;
  }
  // At most one drawing a frame, however fast the slider moves.
  const once = (draw) => {
    let waiting = false;
    return () => { if (!waiting) { waiting = true; requestAnimationFrame(() => { waiting = false; draw(); }); } };
  };

  // --- plots -----------------------------------------------------------------------------
  const ticks = (low, high, about) => {
    const rough = (high - low) / about, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((m) => m * power >= rough * 0.999);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(+(k * step).toPrecision(12));
    return found;
  };
  const W = 340, L = 44, R = 8, T = 22, B = 34;
  // {title, x: [low, high], y: [low, high], xlabel, ylabel, xticks: [[at, text]], equal, height, marks: [...]}
  function plot(p) {
    const H = p.height || (p.equal ? L + R > 0 && Math.round((W - L - R) * (p.y[1] - p.y[0]) / (p.x[1] - p.x[0])) + T + B : 210);
    const X = (v) => L + ((v - p.x[0]) / (p.x[1] - p.x[0])) * (W - L - R);
    const Y = (v) => H - B - ((v - p.y[0]) / (p.y[1] - p.y[0])) * (H - T - B);
    const root = svg("svg", { viewBox: `0 0 ${W} ${H}`, class: "fpp-plot", role: "img", "aria-label": p.title || "" });
    const text = (x, y, s, more) => root.append(svg("text", { x, y, ...more }, s));
    const at = (given, range, n) => given || ticks(...range, n).map((v) => [v, show(v, 6)]);
    for (const [v, s] of at(p.xticks, p.x, 5)) {
      root.append(svg("line", { x1: X(v), x2: X(v), y1: T, y2: H - B, class: "fpp-grid" }));
      text(X(v), H - B + 13, s, { "text-anchor": "middle" });
    }
    for (const [v, s] of at(p.yticks, p.y, 4)) {
      root.append(svg("line", { x1: L, x2: W - R, y1: Y(v), y2: Y(v), class: "fpp-grid" }));
      text(L - 5, Y(v) + 3.5, s, { "text-anchor": "end" });
    }
    if (p.title) text((L + W - R) / 2, 13, p.title, { "text-anchor": "middle", class: "fpp-title" });
    if (p.xlabel) text((L + W - R) / 2, H - 5, p.xlabel, { "text-anchor": "middle" });
    if (p.ylabel) text(0, 0, p.ylabel, { "text-anchor": "middle", transform: `translate(10 ${(T + H - B) / 2}) rotate(-90)` });
    root.locate = (e) => {  // where a pointer is, in the units of the axes
      const r = root.getBoundingClientRect();
      const x = ((e.clientX - r.left) / r.width) * W, y = ((e.clientY - r.top) / r.height) * H;
      return [p.x[0] + ((x - L) / (W - L - R)) * (p.x[1] - p.x[0]), p.y[0] + ((H - B - y) / (H - T - B)) * (p.y[1] - p.y[0])];
    };
    const clip = `fpp-clip-${++serial}`;
    root.append(svg("clipPath", { id: clip }, svg("rect", { x: L, y: T, width: W - L - R, height: H - T - B })));
    const inside = svg("g", { "clip-path": `url(#${clip})` });
    root.append(inside);
    for (const m of p.marks) {
      const style = { class: `fpp-c${m.colour || 0}`, "data-mark": m.name || "", "stroke-dasharray": m.dash || "none", opacity: m.opacity || 1, ...(m.move ? { "data-move": JSON.stringify(m.move) } : {}) };
      if (m.line) {
        let d = "", pen = "M";
        for (let k = 0; k < m.line[0].length; k++) {
          const x = m.line[0][k], y = m.line[1][k];
          if (Number.isFinite(y)) { d += `${pen}${X(x).toFixed(1)} ${Y(y).toFixed(1)}`; pen = "L"; } else pen = "M";
        }
        inside.append(svg("path", { d, fill: "none", stroke: "currentColor", "stroke-width": m.width || 1.5, ...style }));
      } else if (m.dots) {
        const group = svg("g", { fill: "currentColor", ...style });
        for (let k = 0; k < m.dots[0].length; k++) if (Number.isFinite(m.dots[1][k])) group.append(svg("circle", { cx: X(m.dots[0][k]).toFixed(1), cy: Y(m.dots[1][k]).toFixed(1), r: m.radius || 3 }));
        inside.append(group);
      } else if (m.handle) {  // to be dragged: move names the sliders that x and y set
        const [cx, cy] = [X(m.handle[0]), Y(m.handle[1])];
        inside.append(svg("g", { ...style, class: `${style.class} fpp-handle` },
          svg("circle", { cx, cy, r: 16, fill: "transparent" }), svg("circle", { cx, cy, r: 6, fill: "currentColor" })));
      } else if (m.area) {  // [x, y] of its corners
        inside.append(svg("polygon", { points: m.area[0].map((x, k) => `${X(x).toFixed(1)},${Y(m.area[1][k]).toFixed(1)}`).join(" "), fill: "currentColor", stroke: "none", ...style }));
      } else if (m.arrow) {
        const [x0, y0, x1, y1] = [X(m.arrow[0]), Y(m.arrow[1]), X(m.arrow[2]), Y(m.arrow[3])];
        const a = Math.atan2(y1 - y0, x1 - x0), head = (t) => `L${x1 - 9 * Math.cos(a + t)} ${y1 - 9 * Math.sin(a + t)}`;
        inside.append(svg("path", { d: `M${x0} ${y0}L${x1} ${y1}M${x1} ${y1}${head(0.4)}${head(-0.4)}Z`, fill: "currentColor", stroke: "currentColor", "stroke-width": 1.6, ...style }));
      } else if (m.circle) {
        const [x, y, r] = m.circle;
        inside.append(svg("ellipse", { cx: X(x), cy: Y(y), rx: X(x + r) - X(x), ry: Y(y) - Y(y + r), fill: "none", stroke: "currentColor", ...style }));
      } else if (m.image) {  // {image: [left, top, right, bottom], size: [rows, columns], values, low, high, colours}
        const [h, w] = m.size, canvas = html("canvas", { width: w, height: h }), context = canvas.getContext("2d"), out = context.createImageData(w, h);
        for (let k = 0; k < h * w; k++) {
          if (m.values[k] !== m.values[k]) continue;  // nothing there: transparent
          const c = Math.round(255 * clamp((m.values[k] - m.low) / (m.high - m.low), 0, 1)), from = m.colours;
          out.data.set(from ? [from[3 * c], from[3 * c + 1], from[3 * c + 2], 255] : [c, c, c, 255], 4 * k);
        }
        context.putImageData(out, 0, 0);
        const [x0, y0, x1, y1] = [X(m.image[0]), Y(m.image[1]), X(m.image[2]), Y(m.image[3])];
        inside.append(svg("image", { href: canvas.toDataURL(), x: x0, y: y0, width: x1 - x0, height: y1 - y0, preserveAspectRatio: "none", style: "image-rendering: pixelated", ...style }));
      } else if (m.text) {
        inside.append(svg("text", { x: X(m.text[0]), y: Y(m.text[1]), fill: "currentColor", ...style }, m.text[2]));
      }
    }
    return root;
  }

  const told = (numbers) => Object.entries(numbers || {}).map(([name, [value, unit]]) =>
    html("span", { "data-number": name, "data-value": value }, `${name} `, html("b", {}, show(value) + (unit ? " " + unit : ""))));

  // --- A: a formula under sliders --------------------------------------------------------
  // The formula is (values, data, tools) => ({plots: [...], numbers: {name: [value, unit]}})
  function explore(root, spec) {
    const formula = new Function("values", "data", "tools", spec.formula);
    const { values, set, box } = controls(spec.controls, once(draw));
    const plots = html("div", { class: "fpp-plots" }), numbers = html("div", { class: "fpp-numbers", "aria-live": "polite" });
    root.append(box, plots, numbers);
    let held = null;  // which plot a pointer holds, and which sliders it moves
    const drag = (e) => {
      const at = plots.children[held.plot].locate(e);
      for (const [axis, name] of Object.entries(held.move)) set[name](at[axis === "x" ? 0 : 1]);
    };
    plots.addEventListener("pointerdown", (e) => {
      const mark = e.target.closest("[data-move]");
      if (!mark) return;
      held = { plot: [...plots.children].indexOf(mark.closest("svg")), move: JSON.parse(mark.dataset.move) };
      plots.setPointerCapture(e.pointerId);  // the marks are drawn anew while they move
      drag(e);
    });
    plots.addEventListener("pointermove", (e) => held && drag(e));
    for (const end of ["pointerup", "pointercancel"]) plots.addEventListener(end, () => { held = null; });
    const compute = (v) => formula(v, spec.data, { wrap, random, clamp, show });
    root.compute = (v) => compute({ ...values, ...v });  // for the tests
    root.checks = spec.checks;
    function draw() {
      const shown = compute(values);
      plots.replaceChildren(...shown.plots.map(plot));
      numbers.replaceChildren(...told(shown.numbers));
    }
    draw();
  }

  // --- B: maps, read pixel by pixel ------------------------------------------------------
  function maps(root, spec) {
    const [h, w] = spec.size, frames = spec.frames || [""];
    const control = frames.length > 1 ? [{ name: "frame", label: spec.frame_label || "frame", min: 0, max: frames.length - 1, step: 1, value: spec.frame || 0, names: frames }] : [];
    const { values, box } = controls(control, once(paint));
    const grid = html("div", { class: "fpp-maps", tabindex: 0, ...MINE, role: "application",
      "aria-label": "Maps. The arrow keys move a cross; the values under it are read out below." });
    const table = html("div", { class: "fpp-numbers", "aria-live": "polite" });
    let at = spec.at || [h >> 1, w >> 1];
    const shown = spec.maps.map((m) => {
      const canvas = html("canvas", { width: w, height: h });
      const cross = html("i", { class: "fpp-cross" });
      const bar = html("canvas", { width: 256, height: 1, class: "fpp-bar" });
      const pixels = bar.getContext("2d").createImageData(256, 1);
      for (let k = 0; k < 256; k++) pixels.data.set([m.colours[3 * k], m.colours[3 * k + 1], m.colours[3 * k + 2], 255], 4 * k);
      bar.getContext("2d").putImageData(pixels, 0, 0);
      const tint = (x) => { const c = 3 * Math.round((255 * (x - m.low)) / (m.high - m.low)); return `rgb(${m.colours[c]} ${m.colours[c + 1]} ${m.colours[c + 2]})`; };
      const legend = m.names ? html("span", { class: "fpp-legend fpp-named" }, ...m.names.map((n, k) => html("span", { style: `border-left: .8em solid ${tint(k)}; padding-left: .3em` }, n)))
        : html("span", { class: "fpp-legend" }, show(m.low), bar, `${show(m.high)} ${m.unit || ""}`);
      grid.append(html("figure", {}, html("figcaption", {}, m.name), html("div", { class: "fpp-map" }, canvas, cross), legend));
      return { m, canvas, cross };
    });
    const samples = html("div", { class: "fpp-plots fpp-samples" });
    root.append(box, grid, table, samples);
    // A profile over one period, from its top on, at the turn x: the fringe through a response.
    const profile = (x) => {
      const t = (x / (2 * Math.PI) - Math.floor(x / (2 * Math.PI))) * spec.profile.length, j = Math.floor(t), p = spec.profile;
      return p[j % p.length] * (1 - t + j) + p[(j + 1) % p.length] * (t - j);
    };
    function through(I) {  // A + C profile(turn + 2 pi n / N), of all turns the one that leaves least
      const N = I.length, mean = (y) => y.reduce((a, b) => a + b, 0) / N, dot = (a, b) => mean(a.map((x, n) => x * b[n]));
      let best = { left: Infinity };
      for (let turn = 0; turn < 2 * Math.PI; turn += Math.PI / 128) {
        const p = I.map((_, n) => profile(turn + (2 * Math.PI * n) / N)), own = mean(p), level = mean(I);
        const C = (dot(p, I) - own * level) / Math.max(dot(p, p) - own * own, 1e-9), left = dot(I, I) - level * level - C * (dot(p, I) - own * level);
        if (C > 0 && left < best.left) best = { left, at: (n) => level + C * (profile(turn + (2 * Math.PI * n) / N) - own) };
      }
      return best.at;
    }
    // The samples of a pixel at each pitch, {name: (N, H, W)}, and the curve of their phase shift.
    const sampled = (v, u) => Object.entries(spec.samples || {}).map(([name, stack]) => {
      const N = stack.shape[0], I = [...Array(N).keys()].map((n) => stack.real((n * h + v) * w + u));
      const sum = (of) => I.reduce((total, x, n) => total + x * of((2 * Math.PI * n) / N), 0);
      const A = sum(() => 1) / N, M = sum(Math.sin), D = sum(Math.cos), B = (2 / N) * Math.hypot(M, D);
      const sinusoid = (n) => A + (2 / N) * (D * Math.cos((2 * Math.PI * n) / N) + M * Math.sin((2 * Math.PI * n) / N));
      return { name, N, I, B, at: (spec.profile && through(I)) || sinusoid };
    });
    const level = (spec.charts || []).find((c) => c.counts && !c.of)?.top || 255;
    // {row: name of a map}, or {counts: {name: [...]}, top, of: name of a map or none for the samples}
    function chart(c, v, u) {
      const read = (m, k) => m.values.real(index(m, v, k)), of = (name) => spec.maps.find((m) => m.name === name);
      if (c.row) {
        const m = of(c.row), x = [...Array(w).keys()], y = x.map((k) => read(m, k)), known = y.filter(Number.isFinite);
        const range = known.length ? [Math.min(...known), Math.max(...known)] : [m.low, m.high];
        if (range[0] === range[1]) range[1] += 1;
        return plot({ title: `${c.row} along row ${v}`, x: [0, w - 1], y: range, xlabel: "u", ylabel: m.unit, marks: [{ line: [x, y], name: "row" }, { dots: [[u], [y[u]]], colour: 1 }] });
      }
      const curves = Object.entries(c.counts), high = Math.log10(1 + Math.max(1, ...curves.flatMap(([, n]) => n)));
      const values = c.of ? curves.map(() => [read(of(c.of), u)]) : sampled(v, u).map((s) => s.I);
      const marks = curves.flatMap(([name, n], k) => [
        { line: [n.flatMap((_, j) => [(j * c.top) / n.length, ((j + 1) * c.top) / n.length]), n.flatMap((x) => [Math.log10(1 + x), Math.log10(1 + x)])], colour: k % 6, name },
        ...values[k].slice(0, c.of && k ? 0 : undefined).map((x) => ({ line: [[x, x], [0, high]], colour: c.of ? 1 : k % 6, dash: "3 3", width: 1 })),
        { text: [0.62 * c.top, high * (0.93 - 0.1 * k), name], colour: k % 6 }]);
      return plot({ title: c.title, x: [0, c.top], y: [0, high], yticks: [], xlabel: c.xlabel, ylabel: "how often (log)", marks });
    }
    const index = (m, v, u) => ((m.values.shape[0] > 1 ? values.frame || 0 : 0) * h + v) * w + u;
    function paint() {
      for (const { m, canvas } of shown) {
        const context = canvas.getContext("2d"), image = context.createImageData(w, h), start = index(m, 0, 0);
        for (let k = 0; k < h * w; k++) {
          const x = m.values.real(start + k);
          if (x !== x) continue;
          const c = 3 * Math.round(255 * clamp((x - m.low) / (m.high - m.low), 0, 1));
          image.data[4 * k] = m.colours[c]; image.data[4 * k + 1] = m.colours[c + 1]; image.data[4 * k + 2] = m.colours[c + 2]; image.data[4 * k + 3] = 255;
        }
        context.putImageData(image, 0, 0);
      }
      read();
    }
    function read() {
      const [v, u] = at;
      for (const { cross } of shown) { cross.style.left = `${(100 * (u + 0.5)) / w}%`; cross.style.top = `${(100 * (v + 0.5)) / h}%`; }
      table.replaceChildren(html("span", { "data-number": "pixel" }, "pixel ", html("b", {}, `v ${v}, u ${u}`)),
        ...spec.maps.map((m) => {
          const x = m.values.real(index(m, v, u));
          return html("span", { "data-number": m.name, "data-value": x }, `${m.name} `, html("b", {}, x !== x ? "no value" : m.names ? m.names[x] : `${show(x, 4)} ${m.unit || ""}`));
        }));
      samples.replaceChildren(...(spec.charts || []).map((c) => chart(c, v, u)), ...sampled(v, u).map(({ name, N, I, B, at }) => {
        const fine = [...Array(8 * N + 1).keys()].map((k) => k / 8);
        return plot({ title: `${name}: modulation ${show(B)}`, x: [0, N], y: [0, level], xlabel: "step", ylabel: "grey level",
          marks: [{ line: [fine, fine.map(at)], colour: 0 }, { dots: [[...I.keys()], I], colour: 1 }] });
      }));
    }
    root.checks = spec.checks;
    root.compute = ({ frame, v, u }) => {  // for the tests
      values.frame = frame;
      const numbers = Object.fromEntries(spec.maps.map((m) => [m.name, [m.values.real(index(m, v, u)), m.unit, m.values.scale]]));
      for (const { name, B, I, at } of sampled(v, u)) {
        numbers[name] = [B];
        if (spec.profile) numbers[`${name}, off its curve`] = [Math.max(...I.map((x, n) => Math.abs(x - at(n))))];
      }
      return { numbers };
    };
    const point = (event) => {
      const canvas = event.target.closest(".fpp-map")?.querySelector("canvas");
      if (!canvas) return;
      const r = canvas.getBoundingClientRect();
      at = [clamp(Math.floor(((event.clientY - r.top) / r.height) * h), 0, h - 1), clamp(Math.floor(((event.clientX - r.left) / r.width) * w), 0, w - 1)];
      read();
    };
    grid.addEventListener("pointermove", point);
    grid.addEventListener("pointerdown", point);
    grid.addEventListener("keydown", (event) => {
      const step = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
      if (!step) return;
      event.preventDefault(); event.stopPropagation();
      const n = event.shiftKey ? 10 : 1;
      at = [clamp(at[0] + n * step[0], 0, h - 1), clamp(at[1] + n * step[1], 0, w - 1)];
      read();
    });
    paint();
  }

  // --- C: bodies in space ----------------------------------------------------------------
  const VERTEX = `#version 300 es
  in vec3 place; in vec3 hue; uniform mat4 view, lens; uniform float size; out vec3 eye, tint;
  void main() { vec4 p = view * vec4(place, 1.); eye = p.xyz; tint = hue; gl_Position = lens * p; gl_PointSize = size; }`;
  const FRAGMENT = `#version 300 es
  precision highp float; in vec3 eye, tint; uniform float lit; out vec4 colour;
  void main() {
    float shade = 1.;
    if (lit > .5) { vec3 n = normalize(cross(dFdx(eye), dFdy(eye))); shade = .25 + .75 * abs(dot(n, normalize(eye))); }
    colour = vec4(tint * shade, 1.); }`;
  function space(root, spec) {
    const canvas = html("canvas", { class: "fpp-space", tabindex: 0, ...MINE, role: "application",
      "aria-label": spec.alt + " Drag or use the arrow keys to turn, plus and minus to come closer." });
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("no WebGL here");
    const names = spec.bodies.map((b) => ({ name: b.name, value: b.visible !== false }));
    const checks = controls(names, once(draw)), values = checks.values;
    checks.box.classList.add("fpp-checks");
    root.append(canvas);
    if (names.length > 1) root.append(checks.box);
    // The formula is (values, data, tools) => ({bodies: {name: {place, hue}}, numbers})
    const formula = spec.formula && new Function("values", "data", "tools", spec.formula);
    const above = controls(spec.controls || [], once(() => { form(); draw(); }));
    const numbers = html("div", { class: "fpp-numbers", "aria-live": "polite" });
    if (formula) root.prepend(above.box), root.append(numbers);
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source); gl.compileShader(shader); gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "place"); gl.bindAttribLocation(program, 1, "hue");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    const where = Object.fromEntries(["view", "lens", "size", "lit"].map((n) => [n, gl.getUniformLocation(program, n)]));
    gl.enable(gl.DEPTH_TEST);
    const bodies = spec.bodies.map((b) => {
      const points = b.points || spec.bodies[b.like].points, shade = b.shade || (b.like !== undefined && spec.bodies[b.like].shade);
      const n = points.length / 3, place = new Float32Array(3 * n), hue = new Uint8Array(4 * n);
      for (let k = 0; k < n; k++) for (let a = 0; a < 3; a++) place[3 * k + a] = spec.origin[a] + spec.scale * points[a * n + k];
      for (let k = 0; k < n; k++) {
        const c = shade ? 3 * shade[k] : 0, from = shade ? b.colours || spec.bodies[b.like].colours : b.colour;
        hue.set([from[c], from[c + 1], from[c + 2], 255], 4 * k);
      }
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      const buffers = [[place, 3, gl.FLOAT, false], [hue, 4, gl.UNSIGNED_BYTE, true]].map(([data, size, type, norm], k) => {
        const buffer = gl.createBuffer();
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
        gl.enableVertexAttribArray(k);
        gl.vertexAttribPointer(k, size, type, norm, 0, 0);
        return buffer;
      });
      if (b.faces) {
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, Uint32Array.from(b.faces), gl.STATIC_DRAW);
      }
      return { b, n, array, buffers, place, count: b.faces ? b.faces.length : n };
    });
    const compute = (v) => formula(v, spec.data, { wrap, random, clamp, show });
    function form() {  // what the formula makes of the bodies
      const made = compute(above.values);
      for (const body of bodies) {
        const { place, hue } = made.bodies[body.b.name] || {};
        body.place = place || body.place;
        [place, hue].forEach((data, k) => {
          if (!data) return;
          gl.bindBuffer(gl.ARRAY_BUFFER, body.buffers[k]);
          gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
        });
      }
      numbers.replaceChildren(...told(made.numbers));
    }
    if (formula) {
      root.compute = (v) => compute({ ...above.values, ...v });  // for the tests
      root.checks = spec.checks;
      form();
    }
    const eye = { ...spec.eye };  // {at: [x, y, z], yaw, pitch, distance, angle}
    const home = { ...spec.eye };
    function draw() {
      const ratio = window.devicePixelRatio || 1, cw = Math.round(canvas.clientWidth * ratio), ch = Math.round(canvas.clientHeight * ratio);
      if (!cw || !ch) return;
      if (canvas.width !== cw || canvas.height !== ch) { canvas.width = cw; canvas.height = ch; }
      const [cy, sy, cp, sp] = [Math.cos(eye.yaw), Math.sin(eye.yaw), Math.cos(eye.pitch), Math.sin(eye.pitch)];
      // World: x right, y down, z ahead. The eye looks along `ahead`; up in the picture is -y.
      const ahead = [sy * cp, sp, cy * cp], right = [cy, 0, -sy], up = [sy * sp, -cp, cy * sp];
      const from = eye.at.map((c, k) => c - eye.distance * ahead[k]), dot = (a) => -(a[0] * from[0] + a[1] * from[1] + a[2] * from[2]);
      const f = 1 / Math.tan((eye.angle * Math.PI) / 360), near = eye.distance / 50, far = eye.distance * 20;
      gl.viewport(0, 0, cw, ch);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.uniformMatrix4fv(where.view, false, [right[0], up[0], -ahead[0], 0, right[1], up[1], -ahead[1], 0, right[2], up[2], -ahead[2], 0, dot(right), dot(up), -dot(ahead), 1]);
      gl.uniformMatrix4fv(where.lens, false, [(f * ch) / cw, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
      for (const { b, array, count } of bodies) {
        if (!values[b.name]) continue;
        gl.bindVertexArray(array);
        gl.uniform1f(where.lit, b.faces ? 1 : 0);
        gl.uniform1f(where.size, (b.size || 2) * ratio);
        if (b.faces) gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0); else gl.drawArrays(b.lines ? gl.LINES : gl.POINTS, 0, count);
      }
      canvas.dataset.yaw = eye.yaw.toFixed(3);
      canvas.dataset.pitch = eye.pitch.toFixed(3);
      canvas.dataset.distance = eye.distance.toFixed(1);
    }
    const redraw = once(draw), turn = (x, y) => { eye.yaw += x; eye.pitch = clamp(eye.pitch + y, -1.57, 1.57); redraw(); };
    const closer = (factor) => { eye.distance = clamp(eye.distance * factor, home.distance / 20, home.distance * 5); redraw(); };
    // The vertex of the first body under a pointer, for the slider that spec.hover names.
    const nearest = (e) => {
      const box = canvas.getBoundingClientRect(), [x, y] = [e.clientX - box.left - box.width / 2, e.clientY - box.top - box.height / 2];
      const [cy, sy, cp, sp] = [Math.cos(eye.yaw), Math.sin(eye.yaw), Math.cos(eye.pitch), Math.sin(eye.pitch)];
      const f = box.height / 2 / Math.tan((eye.angle * Math.PI) / 360), place = bodies[0].place;
      let [best, least] = [-1, 100];  // within ten pixels; of several the one in front
      for (let k = 0, front = Infinity; k < bodies[0].n; k++) {
        const d = eye.at.map((c, a) => place[3 * k + a] - c), z = eye.distance + sy * cp * d[0] + sp * d[1] + cy * cp * d[2];
        const off = ((f * (cy * d[0] - sy * d[2])) / z - x) ** 2 + ((f * (cp * d[1] - sy * sp * d[0] - cy * sp * d[2])) / z - y) ** 2;
        if (off < least && z < front + 5) { best = k; least = Math.max(off, 9); front = Math.min(front, z); }
      }
      return best;
    };
    const fingers = new Map();
    let spread = 0;
    canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, e); spread = 0; });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => { fingers.delete(e.pointerId); spread = 0; });
    canvas.addEventListener("pointermove", (e) => {
      const last = fingers.get(e.pointerId);
      if (!last) {
        const k = spec.hover ? nearest(e) : -1;
        if (k >= 0) above.set[spec.hover]?.(k);
        return;
      }
      fingers.set(e.pointerId, e);
      if (fingers.size === 1) return turn(-(e.clientX - last.clientX) / 150, (e.clientY - last.clientY) / 150);
      const [a, b] = [...fingers.values()], now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
      if (spread) closer(spread / now);
      spread = now;
    });
    // The wheel turns the page, not the figure, until the figure has the focus.
    canvas.addEventListener("wheel", (e) => { if (document.activeElement === canvas || e.ctrlKey) { e.preventDefault(); closer(Math.exp(e.deltaY / 500)); } }, { passive: false });
    canvas.addEventListener("dblclick", () => { Object.assign(eye, home); redraw(); });
    canvas.addEventListener("keydown", (e) => {
      const act = { ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0), ArrowUp: () => turn(0, -0.1), ArrowDown: () => turn(0, 0.1),
        "+": () => closer(0.9), "=": () => closer(0.9), "-": () => closer(1 / 0.9), "0": () => { Object.assign(eye, home); redraw(); } }[e.key];
      if (act) { e.preventDefault(); e.stopPropagation(); act(); }
    });
    new ResizeObserver(redraw).observe(canvas);
    draw();
  }

  // --- D: a table that is sorted by its heads, and compared with one of its rows --------
  function table(root, spec) {
    const body = root.querySelector("tbody"), rows = [...body.rows], heads = [...root.querySelectorAll("thead th")];
    const texts = rows.map((row) => [...row.cells].map((cell) => cell.textContent));
    const number = (text) => (/^[\s\u2212+-]*[\d.]/.test(text) ? parseFloat(text.replace("\u2212", "-")) : NaN);
    const compare = { name: "than", label: "compare with", value: "no row", choices: ["no row", ...texts.map((t) => t[0])] };
    const { values, box } = controls([compare], tell);
    root.prepend(box);
    function tell() {  // ratios to the chosen row
      const base = texts.find((t) => t[0] === values.than);
      rows.forEach((row, r) => [...row.cells].forEach((cell, c) => {
        const ratio = base && c ? number(texts[r][c]) / number(base[c]) : NaN;
        cell.textContent = Number.isFinite(ratio) ? `${texts[r][c]} (\u00d7${ratio.toFixed(2)})` : texts[r][c];
        row.classList.toggle("fpp-base", texts[r] === base);
      }));
    }
    function order(column, down) {
      const key = (r) => { const x = number(texts[r][column]); return Number.isNaN(x) ? texts[r][column] : x; };
      const kind = (x) => ["number", "string"].indexOf(typeof x);  // numbers stand before words, whichever way
      const less = (a, b) => kind(a) - kind(b) || (down ? -1 : 1) * (a < b ? -1 : a > b ? 1 : 0);
      return [...rows.keys()].sort((a, b) => less(key(a), key(b)) || a - b);
    }
    heads.forEach((head, column) => {
      const button = html("button", { type: "button", class: "fpp-sort", ...MINE }, head.textContent || "row");
      head.replaceChildren(button);
      button.addEventListener("click", () => {
        const down = head.getAttribute("aria-sort") === "ascending";
        heads.forEach((h) => h.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        body.append(...order(column, down).map((r) => rows[r]));
      });
    });
    root.checks = spec.checks;
    root.compute = ({ column, down }) => ({ numbers: { first: [order(column, down)[0]] } });  // for the tests
  }

  // --- page ------------------------------------------------------------------------------
  const STYLE = `
  .fpp-live { min-height: 4rem; --c0:#1b4f72; --c1:#d35400; --c2:#1e8449; --c3:#7d3c98; --c4:#b7950b; --c5:#5d6d7e; max-width: 56rem; margin: .4rem auto; text-align: left; font-size: .85rem; line-height: 1.35; }
  html[data-theme=dark] .fpp-live, body[data-jp-theme-light=false] .fpp-live { min-height: 4rem; --c0:#7fb3d5; --c1:#f0a35e; --c2:#7dcea0; --c3:#c39bd3; --c4:#f4d03f; --c5:#aeb6bf; }
  html[data-theme=dark] .bd-content div.cell_output .text_html:has(.fpp-live) { background: none; color: inherit; padding: 0; }
  ${[0, 1, 2, 3, 4, 5].map((k) => `.fpp-live .fpp-c${k} { color: var(--c${k}) }`).join(" ")}
  .fpp-controls { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); gap: .1rem 1.4rem; }
  .fpp-control { display: grid; grid-template-columns: 7.5em 1fr 5.5em; gap: .6em; align-items: center; min-height: 2.4em; }
  .fpp-control input[type=range] { width: 100%; height: 2.2em; margin: 0; accent-color: var(--c1); touch-action: pan-y; }
  .fpp-control output { font-variant-numeric: tabular-nums; }
  .fpp-checks { display: flex; flex-wrap: wrap; } .fpp-checks .fpp-control { display: flex; }
  .fpp-plots { columns: 2 17rem; column-gap: .8rem; margin-top: .4rem; } .fpp-plot { break-inside: avoid; display: block; margin-bottom: .4rem; }
  .fpp-samples { display: grid; columns: auto; grid-template-columns: repeat(auto-fit, minmax(max(min(17rem, 100%), 34%), 1fr)); gap: 0 .8rem; }
  .fpp-maps { display: grid; gap: .5rem; grid-template-columns: repeat(auto-fit, minmax(min(100%, 9rem), 1fr)); touch-action: pan-y; }
  .fpp-maps figure { margin: 0; text-align: center; }  .fpp-maps figcaption { margin: 0; }
  .fpp-map { position: relative; cursor: crosshair; line-height: 0; } .fpp-map canvas { width: 100%; image-rendering: pixelated; background: repeating-conic-gradient(#8883 0 25%, #8881 0 50%) 0 0/12px 12px; }
  .fpp-cross { position: absolute; width: 15px; height: 15px; margin: -8px 0 0 -8px; border: 2px solid #fff; outline: 1px solid #000; border-radius: 50%; pointer-events: none; }
  .fpp-legend { display: flex; gap: .5em; align-items: center; font-size: .9em; } .fpp-bar { flex: 1; min-width: 0; height: .6em; } .fpp-named { flex-wrap: wrap; line-height: 1.2; }
  .fpp-numbers { display: flex; flex-wrap: wrap; gap: .2em 1.6em; margin-top: .3rem; font-variant-numeric: tabular-nums; }
  .fpp-plot { width: 100%; height: auto; overflow: visible; font-size: 11px; } .fpp-plot text { fill: currentColor; stroke: none; } .fpp-title { font-size: 12px; font-weight: 600; }
  .fpp-handle { cursor: grab; touch-action: none; } .fpp-plot [data-move] { touch-action: none; }
  .fpp-again, .fpp-play { font: inherit; color: inherit; background: none; border: 1px solid currentColor; border-radius: 3px; padding: 0 .5em; cursor: pointer; opacity: .8; } .fpp-again { justify-self: start; align-self: center; }
  .fpp-sort { font: inherit; color: inherit; background: none; border: 0; padding: 0; cursor: pointer; text-align: inherit; } .fpp-sort::after { content: " \\2195"; opacity: .5; } [aria-sort=ascending] .fpp-sort::after { content: " \\2191"; opacity: 1; } [aria-sort=descending] .fpp-sort::after { content: " \\2193"; opacity: 1; }
  .fpp-live:has(table) { overflow-x: auto; } .fpp-base { font-weight: 600; }
  .fpp-grid { stroke: currentColor; opacity: .18; stroke-width: .8; }
  .fpp-space { width: 100%; aspect-ratio: 16/10; touch-action: pan-y; cursor: grab; display: block; } .fpp-live :focus-visible { outline: 2px solid var(--c1); }
  @media screen { .fpp-played > img { display: none; } }
  @media print { .fpp-live { display: none; } }`;

  async function start(root) {
    root.dataset.on = "starting";
    try {
      const spec = await unpack(JSON.parse(root.querySelector("script[type='application/json']").textContent));
      await { explore, maps, space, table }[spec.kind](root, spec);
      root.dataset.kind = spec.kind;
      root.dataset.on = "yes";
    } catch (error) {
      root.dataset.on = "no";  // the still picture stays
      root.querySelectorAll(":scope > :not(table)").forEach((part) => part.remove());
      document.getElementById(root.dataset.insteadOf)?.classList.remove("fpp-played");
      console.warn("A figure stays still:", error.message);
    }
  }
  // Each figure starts when it comes near the window.
  const near = new IntersectionObserver((seen) => seen.forEach((e) => { if (e.isIntersecting) { near.unobserve(e.target); start(e.target); } }), { rootMargin: "100%" });
  function scan() {
    document.querySelectorAll(".fpp-live:not([data-on])").forEach((root) => {
      root.dataset.on = "waiting";
      const picture = root.dataset.insteadOf && document.getElementById(root.dataset.insteadOf);
      if (picture) {
        root.parentElement.hidden = true;  // the theme would draw the empty box it leaves
        picture.querySelector("img").after(root);
        picture.classList.add("fpp-played");
      }
      near.observe(root);
    });
  }
  document.head.append(html("style", {}, STYLE));
  window.fppLive = { scan, show, random, wrap };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", scan); else scan();
})();

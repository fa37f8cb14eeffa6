// Orders from a longer pitch: the prediction, its band of noise, and the candidates it chooses from.
const { column, sigma, seed } = values, [first, fine] = [data.width, data.fine[values.fine]];
const pitches = values.middle && fine < data.middle ? [first, data.middle, fine] : [first, fine];
const turn = 2 * Math.PI, true_ = pitches.map((p) => (turn * column) / p);
const unwrapped = (errors) => {  // absolute phases, each from the one before
  const found = [true_[0] + errors[0]], chain = [];
  for (let p = 1; p < pitches.length; p++) {
    const ratio = pitches[p - 1] / pitches[p], phi = tools.wrap(true_[p] + errors[p]), predicted = ratio * found[p - 1];
    const K = Math.floor((predicted - phi) / turn + 0.5);
    chain.push({ ratio, phi, predicted, K });
    found.push(phi + turn * K);
  }
  return { chain, wrong: Math.round((found[pitches.length - 1] - true_[pitches.length - 1]) / turn) };
};
const dice = tools.random(seed + 1), draw = () => unwrapped(pitches.map(() => sigma * dice.normal()));
const { chain, wrong } = draw();
const counts = {};
for (let k = 0; k < 2000; k++) { const w = draw().wrong; counts[w] = (counts[w] || 0) + 1; }
const erfc = (x) => {  // Numerical Recipes' rational Chebyshev fit, relative error 1.2e-7, x >= 0
  const t = 1 / (1 + x / 2);
  return t * Math.exp(-x * x - 1.26551223 + t * (1.00002368 + t * (0.37409196 + t * (0.09678418 + t * (-0.18628806 + t * (0.27886807 + t * (-1.13520398 + t * (1.48851587 + t * (-0.82215223 + t * 0.17087277)))))))));
};
const rate = chain.reduce((sum, { ratio }) => sum + erfc(Math.PI / (sigma * Math.sqrt(1 + ratio * ratio)) / Math.SQRT2), 0);
const lines = chain.map(({ ratio, phi, predicted, K }, p) => {
  const middle = true_[p + 1], low = middle - 3.2 * turn, high = middle + 3.2 * turn, band = 2 * ratio * sigma;
  const right = Math.round((phi + turn * K - middle) / turn) === 0, marks = [];
  marks.push({ area: [[predicted - band, predicted + band, predicted + band, predicted - band], [0.55, 0.55, 0.9, 0.9]], colour: 0, opacity: 0.25, name: "band" });
  marks.push({ line: [[predicted, predicted], [0.5, 0.95]], colour: 0, width: 2, name: "prediction" });
  for (let k = Math.ceil((low - phi) / turn); phi + turn * k <= high; k++) {
    const chosen = k === K, x = phi + turn * k;
    marks.push({ line: [[x, x], [0.05, 0.4]], colour: chosen ? (right ? 2 : 1) : 5, width: chosen ? 4 : 1.5, name: chosen ? "chosen" : "" });
    marks.push({ text: [x + 0.3, 0.08, `K = ${k}`], colour: chosen ? (right ? 2 : 1) : 5 });
  }
  return { title: `From pitch ${pitches[p]} to ${pitches[p + 1]}: ${right ? "right" : "wrong order"}`, x: [low, high], y: [0, 1], yticks: [], height: 120, xlabel: "absolute phase (rad)", marks };
});
const orders = [-3, -2, -1, 0, 1, 2, 3];
const bars = orders.map((k) => ({ area: [[k - 0.4, k + 0.4, k + 0.4, k - 0.4], [0, 0, (counts[k] || 0) / 20, (counts[k] || 0) / 20]], colour: k ? 1 : 2 }));
return {
  plots: [...lines, { title: "Orders off, of 2000 draws", x: [-3.5, 3.5], y: [0, 100], height: 160, xlabel: "periods", ylabel: "%", xticks: orders.map((k) => [k, `${k}`]), marks: bars }],
  numbers: {
    "wrong, counted": [(100 * (2000 - (counts[0] || 0))) / 2000, "%"], "wrong, by the normal law": [100 * rate, "%"],
    "noise of the first prediction": [chain[0].ratio * sigma, "rad; π is too much"], "order here": [chain[chain.length - 1].K, wrong ? "wrong" : "right"],
  },
};

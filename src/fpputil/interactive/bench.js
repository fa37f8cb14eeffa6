// A fringe as the projector shows it: Eq. 1, grey levels, gamma, focus; a cursor on one column.
const { pitch, n, column, gamma, defocus } = values, levels = +values.levels, N = data.steps, W = data.width;
const phase = (i) => (2 * Math.PI * i) / pitch + (2 * Math.PI * n) / N;
const light = (i) => {
  const value = Math.floor(127.5 * (1 + Math.cos(phase(i))) * ((levels - 1) / 255) + 0.5) * (255 / (levels - 1));
  return 255 * Math.pow(value / 255, gamma);
};
const erf = (x) => {  // Abramowitz and Stegun 7.1.26
  const t = 1 / (1 + 0.3275911 * Math.abs(x));
  const tail = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
  return Math.sign(x) * (1 - tail * Math.exp(-x * x));
};
const reach = defocus > 0 ? Math.ceil(5 * defocus) + 1 : 0;
const sent = [...Array(W + 2 * reach).keys()].map((k) => light(k - reach));
const share = [...Array(2 * reach + 1).keys()].map((k) => {
  const x = (k - reach - 0.5) / defocus / Math.SQRT2, y = (k - reach + 0.5) / defocus / Math.SQRT2;
  return defocus > 0 ? (erf(y) - erf(x)) / 2 : 1;
});
const shown = [...Array(W).keys()].map((i) => share.reduce((sum, s, k) => sum + s * sent[i + k], 0));
const at = [...Array(W).keys()], Phi = (2 * Math.PI * column) / pitch;
const wrapped = at.map((i) => tools.wrap((2 * Math.PI * i) / pitch));
// A line that falls back by a turn would draw the fall.
const saw = wrapped.map((w, i) => (i && Math.abs(w - wrapped[i - 1]) > 3 ? NaN : w));
const grey = shown[column], same = at.filter((i) => Math.round(shown[i]) === Math.round(grey));  // as 8 bit tell them apart
const x = [0, W - 1];
return {
  plots: [
    { title: `What the projector shows, step ${n} of ${N}`, x, y: [0, 1], yticks: [], height: 84, xlabel: "column i",
      marks: [{ image: [0, 1, W - 1, 0], size: [1, W], values: shown, low: 0, high: 255, move: { x: "column" }, name: "strip" },
        { line: [[column, column], [0, 1]], colour: 1, width: 2 }] },
    { title: "Its brightness, and columns of the same grey", x, y: [0, 260], xlabel: "column i", ylabel: "light",
      marks: [{ line: [at, shown], colour: 0, width: 1.2, name: "brightness" }, { line: [x, [grey, grey]], colour: 5, width: 1, dash: "3 3" },
        { dots: [same, same.map((i) => grey)], colour: 3, radius: 2.5, name: "same" },
        { dots: [[column], [grey]], colour: 1, radius: 4.5 }] },
    { title: "Wrapped phase: one address a period", x, y: [-3.3, 3.3], xlabel: "column i", ylabel: "rad",
      yticks: [[-Math.PI, "−π"], [0, "0"], [Math.PI, "π"]],
      marks: [{ line: [at, saw], colour: 0, name: "phase" }, { line: [[column, column], [-4, 4]], colour: 1, width: 1 },
        { handle: [column, wrapped[column]], move: { x: "column" }, colour: 1 }] },
  ],
  numbers: {
    light: [grey, ""], "phase in its period": [wrapped[column], "rad"], period: [Math.round((Phi - wrapped[column]) / (2 * Math.PI)), ""],
    "absolute phase": [Phi, "rad"], "columns of this grey": [same.length, ""],
  },
};

// One pixel: N grey levels, the arrows I_n exp(-i delta_n) * 2 / N laid head to tail, their sum.
const { N, phi, ambient, strength, sigma, gamma, threshold, seed } = values;
const delta = [...Array(N).keys()].map((n) => (2 * Math.PI * n) / N);
const level = (p, d) => 255 * Math.pow((ambient + strength * (1 + Math.cos(p + d))) / 255, gamma);
const camera = (grey) => tools.clamp(Math.floor(grey + 0.5), 0, 255);
const tip = (I) => {  // D and -M
  let M = 0, D = 0;
  I.forEach((grey, n) => { M += (2 / N) * grey * Math.sin(delta[n]); D += (2 / N) * grey * Math.cos(delta[n]); });
  return [D, -M];
};
const dice = tools.random(seed), noisy = (p) => delta.map((d) => camera(level(p, d) + sigma * dice.normal()));
const I = noisy(phi), [D, minusM] = tip(I), found = Math.atan2(minusM, D), length = Math.hypot(D, minusM);
const truth = tools.wrap(phi);
const tips = [...Array(200).keys()].map(() => tip(noisy(phi)));
const errors = tips.map(([x, y]) => tools.wrap(Math.atan2(y, x) - phi));
const mean = errors.reduce((a, b) => a + b) / 200;
const spread = Math.sqrt(errors.reduce((a, b) => a + (b - mean) ** 2, 0) / 199);
let x = 0, y = 0;
const chain = delta.map((d, n) => {
  const from = [x, y];
  x += (2 / N) * I[n] * Math.cos(d); y -= (2 / N) * I[n] * Math.sin(d);
  return { arrow: [...from, x, y], colour: 5, opacity: 0.7 };
});
const turns = [...Array(181).keys()].map((k) => (2 * Math.PI * k) / 180);
const path = turns.map((p) => tip(delta.map((d) => level(p, d))));
const wobble = turns.map((p, k) => tools.wrap(Math.atan2(path[k][1], path[k][0]) - p));
const reach = 1.15 * Math.max(130, ...chain.flatMap((m) => m.arrow.map(Math.abs)), threshold);
const limit = Math.max(0.02, 1.1 * Math.max(...wobble.map(Math.abs), Math.abs(mean) + 2 * spread));
const degrees = [[0, "0"], [90, "90"], [180, "180"], [270, "270"], [360, "360"]];
const fine = [...Array(121).keys()].map((k) => 3 * k), offset = I.reduce((a, b) => a + b) / N;
return {
  plots: [
    { title: `${N} grey levels on their cosine`, x: [0, 360], y: [0, 260], xlabel: "shift (degrees)", ylabel: "grey level", xticks: degrees,
      marks: [
        { line: [fine, fine.map((d) => offset + length * Math.cos(found + (d * Math.PI) / 180))], colour: 0, name: "cosine" },
        { dots: [delta.map((d) => (d * 180) / Math.PI), I], colour: 1, name: "samples" },
      ] },
    { title: "What gamma alone does to the phase", x: [0, 360], y: [-limit, limit], xlabel: "true phase (degrees)", ylabel: "error (rad)", xticks: degrees,
      marks: [
        { line: [turns.map((p) => (p * 180) / Math.PI), wobble], colour: 2, name: "wobble" },
        { dots: [[(phi * 180) / Math.PI], [tools.wrap(found - phi)]], colour: 1, name: "here" },
      ] },
    { title: "Their arrows, head to tail", x: [-reach, reach], y: [-reach, reach], equal: true, xlabel: "D", ylabel: "−M",
      marks: [
        { circle: [0, 0, threshold], colour: 4, dash: "3 3", name: "threshold" },
        { line: [path.map((p) => p[0]), path.map((p) => p[1])], colour: 2, width: 1, opacity: 0.7, name: "path" },
        ...chain,
        { dots: [tips.map((t) => t[0]), tips.map((t) => t[1])], radius: 1.2, colour: 3, opacity: 0.5, name: "tips" },
        { arrow: [0, 0, D, minusM], colour: 1, name: "phasor" },
      ] },
  ],
  numbers: {
    "phase found": [length < threshold ? NaN : found, "rad"], "true phase": [truth, "rad"], modulation: [length, "grey levels"],
    "spread of 200": [spread, "rad"], "σ √(2/N) / B": [(sigma * Math.sqrt(2 / N)) / length, "rad"],
  },
};

// From above: camera at (0, 0) looking along z; projector at (baseline, data.ahead), turned by `angle`.
const { z, u, baseline, angle } = values, { camera, projector, ahead, pitch, dead } = data;
const a = (angle * Math.PI) / 180, c = Math.cos(a), s = Math.sin(a);
const slope = (pixel) => (pixel - camera.centre) / camera.focal;  // x / z along a camera ray
const column = (X, Z) => {
  const x = c * (X - baseline) + s * (Z - ahead), depth = c * (Z - ahead) - s * (X - baseline);
  return depth > 0 ? projector.centre + (projector.focal * x) / depth : NaN;
};
const at = (pixel, Z) => column(slope(pixel) * Z, Z);
const sensitivity = (pixel, Z) => Math.abs(at(pixel, Z + 0.1) - at(pixel, Z - 0.1)) / 0.2;
const inside = (i) => i >= -0.5 && i <= projector.width - 0.5;
const light = (i) => (inside(i) ? 0.5 + 0.5 * Math.cos((2 * Math.PI * i) / pitch) : NaN);

const side = 320, reach = 900, far = 1200, size = [90, 64];
const where = [];  // 1 where a millimetre moves the stripe too little
for (let row = 0; row < size[0]; row++) {
  for (let k = 0; k < size[1]; k++) {
    const Z = reach * (1 - (row + 0.5) / size[0]), X = side * ((2 * (k + 0.5)) / size[1] - 1);
    const pixel = camera.centre + (camera.focal * X) / Z, seen = pixel >= -0.5 && pixel <= camera.width - 0.5;
    where.push(Z > 250 && seen && inside(column(X, Z)) && sensitivity(pixel, Z) < dead ? 1 : NaN);
  }
}
const X = slope(u) * z, i = column(X, z), lit = inside(i);
const ray = (pixel) => {  // of the projector, from its centre
  const t = (pixel - projector.centre) / projector.focal;
  return [baseline + far * (t * c - s), ahead + far * (t * s + c)];
};
const [left, right] = [ray(-0.5), ray(projector.width - 0.5)];
const row = [...Array(320).keys()].map((k) => light(at(2 * k + 0.5, z)));
const sent = [...Array(456).keys()].map((k) => light(2 * k + 0.5));
const strip = { y: [0, 1], yticks: [], height: 84 };
return {
  plots: [
    { title: "From above", x: [-side, side], y: [0, reach], equal: true, xlabel: "x (mm)", ylabel: "depth z (mm)",
      marks: [
        { image: [-side, reach, side, 0], size, values: where, low: 0, high: 1, colours: data.red, opacity: 0.35, name: "dead" },
        { line: [[slope(-0.5) * far, 0, slope(camera.width - 0.5) * far], [far, 0, far]], colour: 5, width: 1 },
        { line: [[left[0], baseline, right[0]], [left[1], ahead, right[1]]], colour: 1, width: 1, opacity: 0.5 },
        { line: [[-side, side], [z, z]], colour: 5, width: 3, opacity: 0.35 },
        { line: [[0, slope(u) * far], [0, far]], colour: 0, name: "ray" },
        { line: [[baseline, X], [ahead, z]], colour: 1, dash: lit ? "none" : "3 3", name: "sheet" },
        { text: [14, 14, "camera"], colour: 0 }, { text: [baseline + 20, ahead - 40, "projector"], colour: 1 },
        { handle: [baseline, ahead], move: { x: "baseline" }, colour: 1 },
        { handle: [X, z], move: { y: "z" }, colour: 3, name: "point" },
      ] },
    { ...strip, title: "What the camera sees on the wall", x: [0, camera.width], xlabel: "camera pixel u",
      marks: [{ image: [0, 1, camera.width, 0], size: [1, 320], values: row, low: 0, high: 1, move: { x: "u" } },
        { line: [[u, u], [0, 1]], colour: 1, width: 3, name: "pixel" }] },
    { ...strip, title: "What the projector sends", x: [0, projector.width], xlabel: "projector column",
      marks: [{ image: [0, 1, projector.width, 0], size: [1, 456], values: sent, low: 0, high: 1 },
        { line: [[i, i], [0, 1]], colour: 1, width: 3, name: "column" }] },
  ],
  numbers: { column: [lit ? i : NaN, ""], "columns per mm": [lit ? sensitivity(u, z) : NaN, ""], depth: [z, "mm"] },
};

// The phases that one pixel can meet between two planes, and the period that the order is sought in.
const { near, far, z, u, sigma, seed } = values, { camera, projector, ahead, angle, side } = data, pitch = data.pitches[values.pitch];
const turn = 2 * Math.PI, c = Math.cos(angle), s = Math.sin(angle), slope = (u - camera.centre) / camera.focal;
const column = (depth) => {
  const x = c * (slope * depth - side) + s * (depth - ahead), ahead_ = c * (depth - ahead) - s * (slope * depth - side);
  return projector.centre + (projector.focal * x) / ahead_;
};
const lit = (i) => tools.clamp(i, -0.5, projector.width - 0.5), Phi = (depth) => (turn * lit(column(depth))) / pitch;
const [z1, z2] = [Math.min(near, far), Math.max(near, far)], ends = [Phi(z1), Phi(z2)];
const span = Math.abs(ends[1] - ends[0]), lower = Math.min(...ends) - (values.centred ? Math.max(turn - span, 0) / 2 : 0);
const truth = (turn * column(z)) / pitch, dice = tools.random(seed + 1);
const phi = tools.wrap(truth + sigma * dice.normal()), K = Math.ceil((lower - phi) / turn), found = phi + turn * K;
const right = Math.abs(found - truth) < Math.PI, mid = (ends[0] + ends[1]) / 2;
const axis = [mid - 1.6 * Math.max(turn, span), mid + 1.6 * Math.max(turn, span)], marks = [];
const bar = (a, b, low, high, more) => ({ area: [[a, b, b, a], [low, low, high, high]], ...more });
marks.push(bar(lower, lower + turn, 0.5, 0.95, { colour: 0, opacity: 0.2, name: "period" }));
marks.push(bar(Math.min(...ends), Math.max(...ends), 0.6, 0.85, { colour: span < turn ? 0 : 1, opacity: 0.6, name: "range" }));
for (let k = Math.ceil((axis[0] - phi) / turn); phi + turn * k <= axis[1]; k++) {
  const x = phi + turn * k, chosen = k === K;
  marks.push({ line: [[x, x], [0.05, chosen ? 0.95 : 0.4]], colour: chosen ? (right ? 2 : 1) : 5, width: chosen ? 3 : 1.5, name: chosen ? "chosen" : "" });
  marks.push({ text: [x + 0.02 * (axis[1] - axis[0]), 0.08, `K = ${k}`], colour: chosen ? (right ? 2 : 1) : 5 });
}
marks.push({ line: [[truth, truth], [0.42, 0.5]], colour: 3, width: 3, name: "truth" });
const width = 320, reach = 1000, wall = (depth, more) => ({ line: [[-width, width], [depth, depth]], ...more });
return {
  plots: [
    { title: "From above", x: [-width, width], y: [0, reach], equal: true, xlabel: "x (mm)", ylabel: "depth z (mm)",
      marks: [
        { area: [[-width, width, width, -width], [z1, z1, z2, z2]], colour: 0, opacity: 0.1 },
        wall(near, { colour: 0, width: 2 }), wall(far, { colour: 0, width: 2 }),
        { line: [[0, slope * reach], [0, reach]], colour: 5 }, { line: [[side, slope * z], [ahead, z]], colour: 1 },
        { text: [12, 12, "camera"], colour: 5 }, { text: [side + 18, ahead - 40, "projector"], colour: 1 },
        { handle: [-250, near], move: { y: "near" }, colour: 0 }, { handle: [250, far], move: { y: "far" }, colour: 0 },
        { handle: [slope * z, z], move: { y: "z" }, colour: 3 },
      ] },
    { title: span < turn ? "One candidate lies in the period" : "The range is longer than a period: two orders fit", x: axis, y: [0, 1], yticks: [], height: 150, xlabel: "absolute phase (rad)", marks },
  ],
  numbers: { "part of a period used": [span / turn, ""], "least phase": [lower, "rad"], order: [K, right ? "right" : "wrong"] },
};

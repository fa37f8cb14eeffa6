// Points of a surface: each is where a camera's ray meets the sheet of light of its column.
// Columns are off by what noise does to the phases, and by whole periods where an order is lost.
const { step, colour, sigma, three, focal, seed, over } = { ...data.fixed, ...values };
const { camera, projector, pitches, u, v, column, steps } = data;
const n = u.length, turn = 2 * Math.PI, dice = tools.random(seed + 1), { f, cx, cy, R, t } = projector, high = pitches[2];
const stretched = f * (1 + focal / 100), used = three ? pitches : [pitches[0], high];
const point = (pixel, i, length) => {  // n . X = c of the sheet, X = z d of the ray
  const d = [(u[pixel] - camera.cx) / camera.f, (v[pixel] - camera.cy) / camera.f, 1], x = i - cx;
  const along = [0, 1, 2].reduce((sum, k) => sum + (length * R[0][k] - x * R[2][k]) * d[k], 0);
  const z = (x * t[2] - length * t[0]) / along;
  return d.map((c) => c * z);
};
const place = new Float32Array(3 * n), hue = new Uint8Array(4 * n), found = new Float64Array(n);
let square = 0, lost = 0, count = 0;
const off = new Float64Array(n), depth = new Float64Array(n);
for (let k = 0; k < n; k++) {
  let error = 0;  // of the absolute phase, from the longest pitch to the shortest
  used.forEach((pitch, level) => {
    const e = sigma * dice.normal(), carried = level ? (error * used[level - 1]) / pitch : 0;
    error = e + (level ? turn * Math.round((carried - e) / turn) : 0);
  });
  if (Math.abs(error) > Math.PI) lost++;
  found[k] = column.real(k) + (error * high) / turn;
  const true_ = point(k, column.real(k), f), here = point(k, found[k], stretched);
  const away = Math.hypot(...here.map((c, a) => c - true_[a]));
  if (away < data.room) { square += away * away; count++; }
  off[k] = here[2] - true_[2]; depth[k] = here[2];
  place.set(here, 3 * k);
}
const paint = (k) => {
  if (colour === "stripes") return Array(3).fill(255 * (0.55 + 0.45 * Math.cos(turn * (column.real(k) / data.stripe + step / steps))));
  const [x, from] = colour === "depth" ? [(depth[k] - data.near) / (data.far - data.near), data.depths] : [0.5 + off[k] / 2 / data.room, data.errors];
  const c = 3 * Math.round(255 * tools.clamp(x, 0, 1));
  return [from[c], from[c + 1], from[c + 2]];
};
for (let k = 0; k < n; k++) hue.set([...paint(k), 255], 4 * k);

// Least-squares sphere by distance: Gauss-Newton on centre and radius.
function sphere() {
  const mean = [0, 1, 2].map((a) => place.reduce((sum, x, k) => (k % 3 === a ? sum + x : sum), 0) / n);
  const p = [mean[0], mean[1], mean[2] + 50, 100];
  for (let round = 0; round < 30; round++) {
    const A = [...Array(4)].map(() => Array(5).fill(0));
    for (let k = 0; k < n; k++) {
      const d = [0, 1, 2].map((a) => place[3 * k + a] - p[a]), length = Math.hypot(...d);
      const row = [...d.map((x) => x / length), 1, length - p[3]];
      for (let i = 0; i < 4; i++) for (let j = 0; j < 5; j++) A[i][j] += row[i] * row[j];
    }
    for (let i = 0; i < 4; i++) for (let j = 0; j < 4; j++) if (j !== i) {
      const factor = A[j][i] / A[i][i];
      for (let k = i; k < 5; k++) A[j][k] -= factor * A[i][k];
    }
    for (let i = 0; i < 4; i++) p[i] += A[i][4] / A[i][i];
  }
  return p[3];
}
const at = [place[3 * over], place[3 * over + 1], place[3 * over + 2]];
const C = [0, 1, 2].map((k) => -(R[0][k] * t[0] + R[1][k] * t[1] + R[2][k] * t[2]));  // projector's centre
const corner = (row) => {  // of the sheet, at the point's distance
  const d = [(found[over] - cx) / stretched, (row - cy) / f, 1], w = [0, 1, 2].map((k) => R[0][k] * d[0] + R[1][k] * d[1] + R[2][k] * d[2]);
  const s = Math.hypot(...at.map((c, k) => c - C[k])) / Math.hypot(...w);
  return C.map((c, k) => c + s * w[k]);
};
const [top, bottom] = [corner(0), corner(projector.height - 1)];
const rays = Float32Array.from([[0, 0, 0], at, C, at, C, top, top, bottom, bottom, C].flat());
const numbers = {
  pixel: [`u ${u[over]}, v ${v[over]}`, ""], column: [found[over], ""], depth: [at[2], "mm"],
  "wrong orders": [(100 * lost) / n, "%"], [`RMS within ${data.room} mm`]: [Math.sqrt(square / Math.max(count, 1)), "mm"],
};
if (data.ball) numbers.radius = [sphere(), "mm"];
return { bodies: { surface: { place, hue }, points: { place, hue }, "ray and sheet of light": { place: rays } }, numbers };

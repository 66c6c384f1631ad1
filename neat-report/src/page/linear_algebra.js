// Vectors are arrays of 3 numbers; 4×4 matrices are arrays of 16, column by column,
// as WebGL takes them.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const norm = (a) => Math.hypot(a[0], a[1], a[2]);
const mix = (a, b, t) => a + (b - a) * t;
const mixPoints = (a, b, t) => [mix(a[0], b[0], t), mix(a[1], b[1], t), mix(a[2], b[2], t)];
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** The unit vector along `a`, or `otherwise` where `a` is zero. */
function normalize(a, otherwise = [0, 0, 1]) {
  const length = norm(a);
  return length > 1e-12 ? scale(a, 1 / length) : otherwise;
}

/** `a · b`. */
function multiply(a, b) {
  const product = new Array(16).fill(0);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      for (let k = 0; k < 4; k++) {
        product[4 * column + row] += a[4 * k + row] * b[4 * column + k];
      }
    }
  }
  return product;
}

/** From the world to a camera with these axes, given in the world, at `center`. */
function cameraFromWorld(xAxis, yAxis, zAxis, center) {
  const t = [xAxis, yAxis, zAxis].map((axis) => -dot(axis, center));
  return [
    xAxis[0], yAxis[0], zAxis[0], 0,
    xAxis[1], yAxis[1], zAxis[1], 0,
    xAxis[2], yAxis[2], zAxis[2], 0,
    t[0], t[1], t[2], 1,
  ];
}

/**
 * From OpenCV camera axes (x right, y down, z forward) to clip coordinates of a
 * viewport: a point at (x, y, z) appears at `fx x/z + skew y/z + cx`, `fy y/z + cy`
 * pixels from the viewport's top left corner.
 */
function pinholeProjection({ fx, fy, cx, cy, skew }, width, height, near, far) {
  return [
    (2 * fx) / width, 0, 0, 0,
    (2 * skew) / width, (-2 * fy) / height, 0, 0,
    (2 * cx) / width - 1, 1 - (2 * cy) / height, (far + near) / (far - near), 1,
    0, 0, (-2 * far * near) / (far - near), 0,
  ];
}

/** A point in the pixels of a viewport with its depth; behind the camera depth ≤ 0. */
function project(matrix, point, width, height) {
  const [x, y, z] = point;
  const m = matrix;
  const w = m[3] * x + m[7] * y + m[11] * z + m[15];
  return [
    ((m[0] * x + m[4] * y + m[8] * z + m[12]) / w + 1) * 0.5 * width,
    (1 - (m[1] * x + m[5] * y + m[9] * z + m[13]) / w) * 0.5 * height,
    w,
  ];
}

/** The part of the segment a–b with depth ≥ near, in pixels, or null. */
function projectSegment(matrix, a, b, width, height, near) {
  const depth = (p) => matrix[3] * p[0] + matrix[7] * p[1] + matrix[11] * p[2] + matrix[15];
  const [da, db] = [depth(a), depth(b)];
  if (da < near && db < near) return null;
  const cut = (da - near) / (da - db);
  const start = da < near ? mixPoints(a, b, cut) : a;
  const end = db < near ? mixPoints(a, b, cut) : b;
  return [project(matrix, start, width, height), project(matrix, end, width, height)];
}

/** Value below which a share of the ascending numbers lies. */
function quantile(sorted, share) {
  return sorted[clamp(Math.round(share * (sorted.length - 1)), 0, sorted.length - 1)];
}

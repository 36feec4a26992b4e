// Quaternions xyzw at an offset in flat arrays, in place, for the loops that run in every frame; `out` may be an input too.

// Writes the quaternion of an axis-angle, rad, to out[o..o+3].
export function quatFromAxisAngle(out, o, x, y, z) {
  const angle = Math.hypot(x, y, z), s = angle > 1e-9 ? Math.sin(angle / 2) / angle : 0.5;
  out[o] = x * s; out[o + 1] = y * s; out[o + 2] = z * s; out[o + 3] = Math.cos(angle / 2);
}

// Writes the normalised mix of the quaternions a[i..i+3] (t = 0) and b[j..j+3] (t = 1) along the shorter arc to out[o..o+3].
export function quatMix(out, o, a, i, b, j, t) {
  const dot = a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2] + a[i + 3] * b[j + 3];
  const u = dot < 0 ? -t : t;
  let x = a[i] + (u * b[j] - t * a[i]), y = a[i + 1] + (u * b[j + 1] - t * a[i + 1]);
  let z = a[i + 2] + (u * b[j + 2] - t * a[i + 2]), w = a[i + 3] + (u * b[j + 3] - t * a[i + 3]);
  const n = 1 / (Math.hypot(x, y, z, w) || 1);
  out[o] = x * n; out[o + 1] = y * n; out[o + 2] = z * n; out[o + 3] = w * n;
}

// Writes the 3x3 rotation of the quaternion q[i..i+3], row by row, to out[o..o+8].
export function quatToMatrix(out, o, q, i) {
  const x = q[i], y = q[i + 1], z = q[i + 2], w = q[i + 3];
  out[o] = 1 - 2 * (y * y + z * z); out[o + 1] = 2 * (x * y - w * z); out[o + 2] = 2 * (x * z + w * y);
  out[o + 3] = 2 * (x * y + w * z); out[o + 4] = 1 - 2 * (x * x + z * z); out[o + 5] = 2 * (y * z - w * x);
  out[o + 6] = 2 * (x * z - w * y); out[o + 7] = 2 * (y * z + w * x); out[o + 8] = 1 - 2 * (x * x + y * y);
}

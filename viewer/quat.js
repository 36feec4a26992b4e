// Quaternions [x, y, z, w] and vectors [x, y, z] as small arrays, for reading and retargeting motions. For the loops that run in
// every frame there is flat_quat.js.

/** @typedef {number[]} Quaternion x, y, z, w; of length 1 where it turns something */
/** @typedef {number[]} Vector x, y, z */

export const Quat = {
  /**
   * The turn that does b first, then a.
   * @param {Quaternion} a
   * @param {Quaternion} b
   * @returns {Quaternion}
   */
  multiply(a, b) {
    const ax = a[0], ay = a[1], az = a[2], aw = a[3], bx = b[0], by = b[1], bz = b[2], bw = b[3];
    return [aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
      aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz];
  },

  /** @param {Quaternion} q */
  inverse(q) {
    return [-q[0], -q[1], -q[2], q[3]];
  },

  /**
   * @param {Quaternion} q
   * @param {Vector} v
   * @returns {Vector}
   */
  rotate(q, v) {
    const t = Vec.times(Vec.cross(q, v), 2), u = Vec.cross(q, t), w = q[3];
    return [v[0] + w * t[0] + u[0], v[1] + w * t[1] + u[1], v[2] + w * t[2] + u[2]];
  },

  // The smallest turn from direction a to direction b, of any length; where they are opposite, about some normal of a.
  between(a, b) {
    a = Vec.unit(a);
    b = Vec.unit(b);
    const w = 1 + Vec.dot(a, b);
    if (w >= 1e-9) return Quat.unit([...Vec.cross(a, b), w]);
    const small = a.map(Math.abs), least = small.indexOf(Math.min(...small));
    return [...Vec.unit(Vec.cross(a, [0, 1, 2].map((i) => Number(i === least)))), 0];
  },

  // The turn about a unit axis by an angle, rad.
  about(axis, angle) {
    const s = Math.sin(angle / 2);
    return [axis[0] * s, axis[1] * s, axis[2] * s, Math.cos(angle / 2)];
  },

  unit(q) {
    const n = Math.hypot(...q) || 1;
    return q.map((c) => c / n);
  },

  // From a, at t = 0, to b, at t = 1, along the shorter arc.
  mix(a, b, t) {
    const u = a.reduce((sum, c, i) => sum + c * b[i], 0) < 0 ? -t : t;
    return Quat.unit(a.map((c, i) => (1 - t) * c + u * b[i]));
  },

  // The rotation that takes the axes to the orthonormal x, y, z.
  fromColumns(x, y, z) {
    const trace = x[0] + y[1] + z[2];
    if (trace > 0) return Quat.unit([y[2] - z[1], z[0] - x[2], x[1] - y[0], 1 + trace]);
    if (x[0] >= y[1] && x[0] >= z[2]) return Quat.unit([1 + x[0] - y[1] - z[2], x[1] + y[0], z[0] + x[2], y[2] - z[1]]);
    if (y[1] >= z[2]) return Quat.unit([x[1] + y[0], 1 + y[1] - x[0] - z[2], y[2] + z[1], z[0] - x[2]]);
    return Quat.unit([z[0] + x[2], y[2] + z[1], 1 + z[2] - x[0] - y[1], x[1] - y[0]]);
  },

  /** @param {Quaternion} q */
  toAxisAngle(q) {
    const [x, y, z, w] = q[3] < 0 ? q.map((c) => -c) : q, s = Math.hypot(x, y, z);
    const factor = s > 1e-12 ? 2 * Math.atan2(s, w) / s : 2;
    return [x * factor, y * factor, z * factor];
  },
};

export const Vec = {
  dot: (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  add: (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]],
  minus: (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]],
  times: (a, s) => [a[0] * s, a[1] * s, a[2] * s],
  length: (a) => Math.hypot(a[0], a[1], a[2]),
  unit: (a) => Vec.times(a, 1 / Math.max(Vec.length(a), 1e-12)),
  // The part of a at right angles to the unit axis.
  across: (a, axis) => Vec.minus(a, Vec.times(axis, Vec.dot(a, axis))),
};

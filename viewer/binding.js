// Places the gaussians on the faces of the posed mesh: for a face (v0, v1, v2) with a = (v2-v1)/|.|, n = (v2-v1) x (v0-v1)/|.|,
// b = a x n, R = [a n b], T = mean, k = 0.5 (h + L)/0.05, L = |v0-v2|, h = 2 area/L, a gaussian's mean is k R mu + T and its axes
// are k R r s.
// The light of the clip multiplies a colour by light . (1, n_x, n_y, |n_z|), kept between DARKEST and BRIGHTEST.

import { quatMix, quatToMatrix } from "./flat_quat.js";

const DARKEST = 0.25;
const BRIGHTEST = 2.5;
// The same from everywhere: colours stay as they are.
export const EVEN_LIGHT = Float32Array.of(1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0);

export class Binding {
  // Gaussians in a row of `data`, as WebGL has it in a texture.
  static PER_ROW = 512;

  /**
   * @param {import("./reader.js").Avatar} avatar
   * @param {import("./reader.js").Level} level whose gaussians it places
   */
  constructor(avatar, level) {
    this.avatar = avatar;
    this.level = level;
    this.count = level.face.length;
    this.axes = new Float32Array(this.count * 9);
    // Twelve numbers a gaussian: mean x, y, z, covariance xx, xy, xz, yy, yz, zz, and a factor for each colour.
    this.rows = Math.max(1, Math.ceil(this.count / Binding.PER_ROW));
    this.data = new Float32Array(this.rows * Binding.PER_ROW * 12);
    const q = new Float32Array(4), r = new Float32Array(9);
    for (let i = 0; i < this.count; i++) {
      const { quat, logScale } = level;
      q[0] = quat[i * 4 + 1]; q[1] = quat[i * 4 + 2]; q[2] = quat[i * 4 + 3]; q[3] = quat[i * 4];
      quatMix(q, 0, q, 0, q, 0, 0);
      quatToMatrix(r, 0, q, 0);
      for (let m = 0; m < 9; m++) this.axes[i * 9 + m] = r[m] * Math.exp(logScale[i * 3 + (m % 3)]);
    }
  }

  /**
   * Fills this.data.
   * @param {Float32Array} vertices (V, 3) posed
   * @param {boolean} lit whether in the light of the clip, where the file has it
   * @param {import("./scene_light.js").SceneLight | null} scene a lamp in its place, as far as its share says
   */
  update(vertices, lit, scene = null) {
    const { avatar: { faces }, level: { face, mu }, axes: M, data: D } = this, light = (lit && this.avatar.light) || EVEN_LIGHT;
    const shade = (c, x, y, z) => {
      const factor = light[c] + x * light[3 + c] + y * light[6 + c] + Math.abs(z) * light[9 + c];
      const clip = Math.min(BRIGHTEST, Math.max(DARKEST, factor));
      return scene?.share ? clip + scene.share * (Math.min(BRIGHTEST, scene.factor(c, x, y, z)) - clip) : clip;
    };
    for (let i = 0; i < this.count; i++) {
      const f = face[i] * 3, i0 = faces[f] * 3, i1 = faces[f + 1] * 3, i2 = faces[f + 2] * 3;
      const x1 = vertices[i1], y1 = vertices[i1 + 1], z1 = vertices[i1 + 2];
      const px = vertices[i2] - x1, py = vertices[i2 + 1] - y1, pz = vertices[i2 + 2] - z1;
      const qx = vertices[i0] - x1, qy = vertices[i0 + 1] - y1, qz = vertices[i0 + 2] - z1;
      const cx = py * qz - pz * qy, cy = pz * qx - px * qz, cz = px * qy - py * qx;
      const pp = px * px + py * py + pz * pz, area2 = Math.sqrt(cx * cx + cy * cy + cz * cz);
      const o = i * 12;
      D[o] = x1 + (px + qx) / 3; D[o + 1] = y1 + (py + qy) / 3; D[o + 2] = z1 + (pz + qz) / 3;
      if (!(area2 > 1e-6 * (pp + qx * qx + qy * qy + qz * qz) && area2 > 1e-15)) {
        D.fill(0, o + 3, o + 9);
        for (let c = 0; c < 3; c++) D[o + 9 + c] = shade(c, 0, 0, 0);
        continue;
      }
      const w = 1 / Math.sqrt(pp), ax = px * w, ay = py * w, az = pz * w;
      const nx = cx / area2, ny = cy / area2, nz = cz / area2;
      const bx = ay * nz - az * ny, by = az * nx - ax * nz, bz = ax * ny - ay * nx;
      const side = Math.sqrt((qx - px) ** 2 + (qy - py) ** 2 + (qz - pz) ** 2), k = 10 * (area2 / side + side);
      const m0 = k * mu[i * 3], m1 = k * mu[i * 3 + 1], m2 = k * mu[i * 3 + 2];
      D[o] += ax * m0 + nx * m1 + bx * m2;
      D[o + 1] += ay * m0 + ny * m1 + by * m2;
      D[o + 2] += az * m0 + nz * m1 + bz * m2;
      let xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
      for (let c = i * 9; c < i * 9 + 3; c++) {
        const s = k * M[c], t = k * M[c + 3], u = k * M[c + 6];
        const x = ax * s + nx * t + bx * u, y = ay * s + ny * t + by * u, z = az * s + nz * t + bz * u;
        xx += x * x; xy += x * y; xz += x * z; yy += y * y; yz += y * z; zz += z * z;
      }
      D[o + 3] = xx; D[o + 4] = xy; D[o + 5] = xz; D[o + 6] = yy; D[o + 7] = yz; D[o + 8] = zz;
      for (let c = 0; c < 3; c++) D[o + 9 + c] = shade(c, nx, ny, nz);
    }
  }
}

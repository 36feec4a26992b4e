// Draws the gaussians with the processor: from the nearest to the farthest, each ellipse row by row, until a pixel is full.
// The picture is that of webgl.js; where WebGL itself runs on the processor, this is several times faster.

import { exponential } from "./exponential.js";
import { NEAR, WIDE } from "./projection.js";

// A pixel is full when less than this share of its light comes from farther away.
const FULL = 1e-3;

export class SoftwareRenderer {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {import("./reader.js").Avatar} avatar
   * @param {import("./levels.js").Levels} levels
   */
  constructor(canvas, avatar, levels) {
    this.kind = "software";
    this.context = canvas.getContext("2d", { alpha: false });
    this.avatar = avatar;
    this.levels = levels;
    // Of the level that is drawn.
    this.binding = levels.binding;
    this.order = levels.sort.order;
    this.background = [0, 0, 0, 1];
    // Size of the picture, px; of each pixel the share of light from farther away that still comes through, and the colour so far.
    this.width = 0;
    this.height = 0;
    this.transmittance = new Float32Array(0);
    this.colour = new Float32Array(0);
    /** @type {ImageData} */
    this.image = null;
    // The image as one number a pixel.
    this.pixels = new Uint32Array(0);
    /** @type {(why: string) => void} */
    this.onLost = () => {};
  }

  prepare(view) {
    const { binding, sort } = this.levels;
    sort.update(binding.data, view);
    this.binding = binding;
    this.order = sort.order;
  }

  clear(background) {
    this.background = background;
  }

  /**
   * @param {import("./camera.js").Eye} eye
   * @param {import("./viewer.js").Shadow | null} shadow
   */
  paint(eye, shadow) {
    const [, , width, height] = eye.box;
    this.resize(width, height);
    this.transmittance.fill(1);
    this.colour.fill(0);
    const { order } = this;
    for (let rank = this.binding.count - 1; rank >= 0; rank--) this.splat(order[rank], eye);
    if (shadow) this.darken(eye, shadow);
    this.show();
  }

  resize(width, height) {
    if (this.width === width && this.height === height) return;
    this.width = width;
    this.height = height;
    this.transmittance = new Float32Array(width * height);
    this.colour = new Float32Array(width * height * 3);
    this.image = this.context.createImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
  }

  // Projects gaussian i and draws its ellipse.
  splat(i, { view, focal: [fx, fy], centre }) {
    const D = this.binding.data, o = i * 12, x = D[o], y = D[o + 1], z = D[o + 2];
    const { blend: { lowPass, keepsEnergy, alphaMin } } = this.avatar, opacity = this.binding.level.opacity[i];
    const cz = view[8] * x + view[9] * y + view[10] * z + view[11];
    if (cz < NEAR || opacity < alphaMin) return;
    const { width, height } = this, px = (view[0] * x + view[1] * y + view[2] * z + view[3]) / cz;
    const py = (view[4] * x + view[5] * y + view[6] * z + view[7]) / cz;
    const wide = WIDE * width / (2 * fx), tall = WIDE * height / (2 * fy);
    const tx = Math.min(wide, Math.max(-wide, px)), ty = Math.min(tall, Math.max(-tall, py)), sx = fx / cz, sy = fy / cz;
    const a0 = (view[0] - tx * view[8]) * sx, a1 = (view[1] - tx * view[9]) * sx, a2 = (view[2] - tx * view[10]) * sx;
    const b0 = (view[4] - ty * view[8]) * sy, b1 = (view[5] - ty * view[9]) * sy, b2 = (view[6] - ty * view[10]) * sy;
    const xx = D[o + 3], xy = D[o + 4], xz = D[o + 5], yy = D[o + 6], yz = D[o + 7], zz = D[o + 8];
    const u0 = xx * a0 + xy * a1 + xz * a2, u1 = xy * a0 + yy * a1 + yz * a2, u2 = xz * a0 + yz * a1 + zz * a2;
    const across = a0 * u0 + a1 * u1 + a2 * u2, slant = b0 * u0 + b1 * u1 + b2 * u2;
    const down = b0 * (xx * b0 + xy * b1 + xz * b2) + b1 * (xy * b0 + yy * b1 + yz * b2) + b2 * (xz * b0 + yz * b1 + zz * b2);
    const bare = Math.max(0, across * down - slant * slant), det = bare + lowPass * (across + down + lowPass);
    const seen = keepsEnergy ? opacity * Math.sqrt(bare / det) : opacity;
    if (!(seen >= alphaMin)) return;
    const cx = fx * px + centre[0] + width / 2, cy = fy * py + centre[1] + height / 2;
    this.fill(i, cx, cy, across + lowPass, slant, down + lowPass, det, seen);
  }

  // Draws the ellipse of gaussian i around (cx, cy), px, with the covariance (across, slant, down), px^2, and its determinant.
  fill(i, cx, cy, across, slant, down, det, opacity) {
    const { width, height, transmittance, colour, binding: { data, level: { rgb } } } = this;
    const { alphaMax, alphaMin } = this.avatar.blend;
    const r = rgb[i * 3] * data[i * 12 + 9], g = rgb[i * 3 + 1] * data[i * 12 + 10], b = rgb[i * 3 + 2] * data[i * 12 + 11];
    const A = down / det, perA = det / down, perDown = 1 / down, shear = slant / down, reach2 = 2 * Math.log(opacity / alphaMin);
    const tall = Math.sqrt(reach2 * down), first = Math.max(0, Math.ceil(cy - tall - 0.5));
    const last = Math.min(height - 1, Math.floor(cy + tall - 0.5)), bend = exponential(-A);
    for (let row = first; row <= last; row++) {
      // Along a row the exponent is a parabola: at dx = middle it is smallest, and each pixel's weight follows from the last.
      const dy = row + 0.5 - cy, middle = shear * dy, least = dy * dy * perDown, half2 = (reach2 - least) * perA;
      if (half2 <= 0) continue;
      const half = Math.sqrt(half2), from = Math.max(0, Math.ceil(cx + middle - half - 0.5));
      const to = Math.min(width - 1, Math.floor(cx + middle + half - 0.5)), e = from + 0.5 - cx - middle;
      let weight = opacity * exponential(-0.5 * (least + A * e * e)), step = exponential(-A * (e + 0.5));
      for (let at = row * width + from, end = row * width + to; at <= end; at++) {
        const open = transmittance[at];
        if (open > FULL) {
          const share = (weight < alphaMax ? weight : alphaMax) * open, o = at * 3;
          colour[o] += share * r;
          colour[o + 1] += share * g;
          colour[o + 2] += share * b;
          transmittance[at] = open - share;
        }
        weight *= step;
        step *= bend;
      }
    }
  }

  // Darkens what shows of the background where the shadow lies, behind all gaussians.
  darken({ view: v, focal: [fx, fy], centre }, { x, y, z, radius, strength }) {
    const { width, height, transmittance } = this, mx = centre[0] + width / 2, my = centre[1] + height / 2;
    const eye = [0, 1, 2].map((c) => -(v[c] * v[3] + v[4 + c] * v[7] + v[8 + c] * v[11]));
    let low = [width, height], high = [0, 0];
    for (const [sx, sz] of [[-1, -1], [-1, 1], [1, -1], [1, 1]]) {
      const p = [x + sx * radius, y, z + sz * radius];
      const c = [0, 4, 8].map((r) => v[r] * p[0] + v[r + 1] * p[1] + v[r + 2] * p[2] + v[r + 3]);
      const at = c[2] > NEAR ? [fx * c[0] / c[2] + mx, fy * c[1] / c[2] + my] : null;
      low = at ? low.map((l, i) => Math.min(l, at[i])) : [0, 0];
      high = at ? high.map((h, i) => Math.max(h, at[i])) : [width, height];
    }
    for (let row = Math.max(0, Math.floor(low[1])); row < Math.min(height, high[1]); row++) {
      for (let column = Math.max(0, Math.floor(low[0])); column < Math.min(width, high[0]); column++) {
        const dx = (column + 0.5 - mx) / fx, dy = (row + 0.5 - my) / fy;
        const along = (y - eye[1]) / (v[1] * dx + v[5] * dy + v[9]);
        if (!(along > 0)) continue;
        const offX = eye[0] + along * (v[0] * dx + v[4] * dy + v[8]) - x;
        const offZ = eye[2] + along * (v[2] * dx + v[6] * dy + v[10]) - z, r = Math.hypot(offX, offZ) / radius;
        if (r >= 1) continue;
        const soft = (1 - r) * (1 - r) * (1 + 2 * r);
        transmittance[row * width + column] *= 1 - strength * soft * soft;
      }
    }
  }

  // Puts the colours and what comes through of the background on the canvas.
  show() {
    const { pixels, transmittance, colour, background: [r, g, b] } = this;
    for (let at = 0, o = 0; at < pixels.length; at++, o += 3) {
      const open = transmittance[at], red = (colour[o] + open * r) * 255 + 0.5, green = (colour[o + 1] + open * g) * 255 + 0.5;
      const blue = (colour[o + 2] + open * b) * 255 + 0.5;
      pixels[at] = 0xff000000 | (blue > 255 ? 255 : blue) << 16 | (green > 255 ? 255 : green) << 8 | (red > 255 ? 255 : red);
    }
    this.context.putImageData(this.image, 0, 0);
  }
}

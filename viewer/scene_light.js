// A lamp of the viewer's own in place of the clip's light: light on a surface by its normal, in the second order that a diffuse surface
// shows (docs/gsac-format.md, "In a scene's light"), as the shaders take it.

const AMBIENT = 0.3;
const LAMP = 1.1;
// A factor of linear light is this root of it in display colours; as in GsacCore.hlsl.
const GAMMA = 2.2;
const FULL_TURN = 360;

const turned = (degrees) => degrees * Math.PI / 180;

export class SceneLight {
  constructor() {
    // 0..1: how far the lamp stands in for the clip's light.
    this.share = 0;
    // Where it stands, degrees: around the person from her front to her left, and above her eyes.
    this.around = 35;
    this.above = 40;
    // Seven rows of four numbers: of x, y, z and 1 for red, green, blue; of xy, yz, zz, zx for each; of xx - yy for each, and the share.
    this.rows = new Float32Array(28);
    this.update();
  }

  /** Puts the lamp somewhere; its share becomes 1 where it was 0. */
  place(around, above) {
    this.around = ((around + FULL_TURN / 2) % FULL_TURN + FULL_TURN) % FULL_TURN - FULL_TURN / 2;
    this.above = Math.min(90, Math.max(-90, above));
    if (this.share === 0) this.share = 1;
    this.update();
  }

  // Back to the clip's light.
  turnOff() {
    this.share = 0;
    this.update();
  }

  // Unit, to the lamp, in the person's axes.
  get direction() {
    const level = Math.cos(turned(this.above));
    return [level * Math.sin(turned(this.around)), Math.sin(turned(this.above)), level * Math.cos(turned(this.around))];
  }

  // Fills this.rows.
  update() {
    const [x, y, z] = this.direction, square = LAMP * 15 / 32, flat = square * (x * x + y * y) / 2;
    // max(0, cos) in the second order: 1/4 + cos/2 + 5/32 (3 cos^2 - 1); xx + yy of a normal is 1 - zz
    const first = [LAMP * x / 2, LAMP * y / 2, LAMP * z / 2, AMBIENT + LAMP * (1 / 4 - 5 / 32) + flat];
    const second = [2 * square * x * y, 2 * square * y * z, square * z * z - flat, 2 * square * z * x];
    const last = square * (x * x - y * y) / 2;
    for (let c = 0; c < 3; c++) {
      this.rows.set(first, c * 4);
      this.rows.set(second, 12 + c * 4);
      this.rows[24 + c] = last;
    }
    this.rows[27] = this.share;
  }

  // Factor of a channel's display colour on a surface with that normal.
  factor(c, x, y, z) {
    const r = this.rows, a = c * 4, b = 12 + a;
    const light = r[a] * x + r[a + 1] * y + r[a + 2] * z + r[a + 3]
      + r[b] * x * y + r[b + 1] * y * z + r[b + 2] * z * z + r[b + 3] * z * x + r[24 + c] * (x * x - y * y);
    return Math.pow(Math.max(light, 1e-6), 1 / GAMMA);
  }
}

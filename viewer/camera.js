// Orbit camera with OpenCV axes (x right, y down, z forward), and the gestures that move it.

// Time constant of the glide to another framing.
const GLIDE_S = 0.25;
// A framed figure is seen from a little above, degrees.
const PITCH = 4;
// Shares of the figure's height and width that half of the picture holds: more than a half leaves a margin.
const MARGIN_TALL = 0.57;
const MARGIN_WIDE = 0.58;

// A press that moves less than this is a click, px.
const STILL = 5;
// A gesture walks round the person by so many degrees for each px of the page.
const YAW_PER_PX = 0.35;
const PITCH_PER_PX = 0.3;
// The second of two clicks comes within this, ms, and lies nearer to the first than this, px.
const TWICE_MS = 300;
const TWICE_PX = 30;

/**
 * What a renderer draws from. view: 3x4, row by row, world to camera; focal: px; centre: px from the middle of the box to the
 * optical axis; box: x, y, width, height of the picture on the canvas, px.
 * @typedef {{view: Float32Array, focal: [number, number], centre: [number, number],
 *   box: [number, number, number, number]}} Eye
 */

export class OrbitCamera {
  constructor() {
    // Vertical field of view, degrees.
    this.fov = 30;
    // Share of the picture's height that the controls cover at the bottom; the figure stands above them.
    this.covered = 0;
    // Share of its width that they cover at the right.
    this.beside = 0;
    // Share of what is free above them that is kept free over the head.
    this.above = 0;
    // How far the figure has walked from where it was framed, m; the camera follows.
    this.walked = [0, 0, 0];
    this.view = new Float32Array(12);
    // Angles around the target, degrees; the target and the distance from it, m.
    this.yaw = 0;
    this.pitch = PITCH;
    this.target = [0, 0, 0];
    this.distance = 3;
    // Offset from the framing that a glide still has to lose: target (m), pitch (degrees), distance (m), yaw (degrees).
    this.behind = [0, 0, 0, 0, 0, 0];
    // Whether the user or the address moved it: a new size of the page does not frame the figure again then.
    this.moved = false;
  }

  // Frames a box, m; aspect: the picture's width over its height.
  frame(low, high, aspect) {
    this.pitch = PITCH;
    this.moved = false;
    this.behind = [0, 0, 0, 0, 0, 0];
    this.target = low.map((l, i) => (l + high[i]) / 2);
    const tall = (high[1] - low[1]) * Math.max(MARGIN_TALL, 0.5 / (1 - 2 * this.above)) / (1 - this.covered);
    const wide = (high[0] - low[0]) * MARGIN_WIDE / aspect / (1 - this.beside);
    this.distance = Math.max(tall, wide) / Math.tan(this.fov * Math.PI / 360) + (high[2] - low[2]) / 2;
  }

  // As `frame`, but gets there gradually, by `settle`.
  glide(low, high, aspect) {
    const from = this.place();
    this.frame(low, high, aspect);
    this.behind = this.place().map((to, i) => from[i] - to);
  }

  // Turns gradually to a yaw, degrees, by the shorter way; a glide to another framing goes on from there.
  glideTo(yaw) {
    this.behind[5] += (this.yaw - yaw) % 360;
    if (Math.abs(this.behind[5]) > 180) this.behind[5] -= 360 * Math.sign(this.behind[5]);
    this.yaw = yaw;
  }

  // Goes on with a glide by some seconds.
  settle(seconds) {
    const left = Math.exp(-seconds / GLIDE_S);
    this.behind = this.behind.map((x) => (Math.abs(x) < 1e-4 ? 0 : x * left));
  }

  // Where it is now: target (m), pitch (degrees), distance (m), yaw (degrees).
  place() {
    const at = this.target.map((t, i) => t + this.walked[i]);
    return [...at, this.pitch, this.distance, this.yaw].map((x, i) => x + this.behind[i]);
  }

  // Focal length, px, for a picture of this height.
  focal(height) {
    return height / 2 / Math.tan(this.fov * Math.PI / 360);
  }

  /**
   * For a picture of width x height px.
   * @returns {Eye}
   */
  eye(width, height) {
    this.update();
    const focal = this.focal(height);
    /** @type {[number, number]} */
    const centre = [-this.beside * width / 2, -this.covered * height / 2];
    return { view: this.view, focal: [focal, focal], centre, box: [0, 0, width, height] };
  }

  // Fills this.view.
  update() {
    const place = this.place(), target = place.slice(0, 3), [pitch, distance, yaw] = place.slice(3);
    const y = yaw * Math.PI / 180, p = pitch * Math.PI / 180;
    const back = [Math.sin(y) * Math.cos(p), Math.sin(p), Math.cos(y) * Math.cos(p)];
    const right = [Math.cos(y), 0, -Math.sin(y)], forward = back.map((v) => -v);
    const down = [forward[1] * right[2] - forward[2] * right[1], forward[2] * right[0] - forward[0] * right[2],
      forward[0] * right[1] - forward[1] * right[0]];
    const eye = target.map((t, i) => t + distance * back[i]);
    [right, down, forward].forEach((axis, r) => {
      this.view.set(axis, r * 4);
      this.view[r * 4 + 3] = -(axis[0] * eye[0] + axis[1] * eye[1] + axis[2] * eye[2]);
    });
  }

  // Walks round the person, degrees; pitch stays between a look from below and one from nearly above.
  turnBy(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(85, Math.max(-30, this.pitch + pitch));
  }

  zoom(factor) {
    this.distance = Math.min(30, Math.max(0.35, this.distance * factor));
  }

  // By dx, dy in px of the page.
  pan(dx, dy, height) {
    const step = this.distance / this.focal(height);
    for (let i = 0; i < 3; i++) this.target[i] -= step * (dx * this.view[i] + dy * this.view[4 + i]);
  }

  /**
   * @param {HTMLElement} element
   * @param {() => void} onMove called with each gesture
   * @param {(x: number, y: number) => void} onClick called with the place of a single click or tap, px of the element
   * @param {(x: number, y: number) => void} onTwice called with the place of the second of two clicks or taps
   */
  listen(element, onMove, onClick, onTwice) {
    const fingers = new Map();
    let pressed = null, last = null, once = 0;
    const click = (e) => {
      const { left, top } = element.getBoundingClientRect(), [x, y] = [e.clientX - left, e.clientY - top];
      const twice = last && e.timeStamp - last[2] < TWICE_MS && Math.hypot(x - last[0], y - last[1]) < TWICE_PX;
      last = twice ? null : [x, y, e.timeStamp];
      clearTimeout(once);
      if (twice) onTwice(x, y);
      else once = window.setTimeout(() => onClick(x, y), TWICE_MS);
    };
    element.addEventListener("contextmenu", (e) => e.preventDefault());
    element.addEventListener("pointerdown", (e) => {
      element.setPointerCapture(e.pointerId);
      fingers.set(e.pointerId, [e.clientX, e.clientY]);
      pressed = fingers.size === 1 && e.button === 0 ? [e.clientX, e.clientY] : null;
    });
    const lift = (e) => fingers.delete(e.pointerId);
    element.addEventListener("pointerup", (e) => {
      lift(e);
      if (pressed && Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) < STILL) click(e);
      pressed = null;
    });
    element.addEventListener("pointercancel", lift);
    element.addEventListener("pointermove", (e) => {
      const old = fingers.get(e.pointerId);
      if (!old) return;
      if (pressed && Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) < STILL) return;
      pressed = null;
      const dx = e.clientX - old[0], dy = e.clientY - old[1];
      if (fingers.size === 2) {
        const other = [...fingers].find(([id]) => id !== e.pointerId)[1];
        const before = Math.hypot(old[0] - other[0], old[1] - other[1]);
        const after = Math.hypot(e.clientX - other[0], e.clientY - other[1]);
        if (after > 1) this.zoom(before / after);
        this.pan(dx / 2, dy / 2, element.clientHeight);
      } else if (e.buttons & 6 || e.shiftKey) {
        this.pan(dx, dy, element.clientHeight);
      } else {
        this.turnBy(-dx * YAW_PER_PX, dy * PITCH_PER_PX);
      }
      fingers.set(e.pointerId, [e.clientX, e.clientY]);
      this.moved = true;
      onMove();
    });
    element.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.zoom(Math.exp(Math.sign(e.deltaY) * Math.min(Math.abs(e.deltaY), 100) * 0.0015));
      this.moved = true;
      onMove();
    }, { passive: false });
  }
}

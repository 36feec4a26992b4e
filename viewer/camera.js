// Orbit camera with OpenCV axes (x right, y down, z forward), and the gestures that move it.

const GLIDE_S = 0.25;

export class OrbitCamera {
  constructor() {
    this.fov = 30;
    // Share of the picture's height that controls cover at the bottom; the figure stands above it.
    this.covered = 0;
    // How far the figure has walked from where it was framed, m; the camera goes along.
    this.walked = [0, 0, 0];
    this.view = new Float32Array(12);
    this.yaw = 0;
    this.pitch = 4;
    this.target = [0, 0, 0];
    this.distance = 3;
    // What is left of the way from an older framing: target, m, pitch, degrees, distance, m. It dies away.
    this.behind = [0, 0, 0, 0, 0];
    // By hand or by the address: then a new size of the page does not frame the figure again.
    this.moved = false;
  }

  // Puts a box, m, into the picture; aspect: width over height.
  frame(low, high, aspect) {
    this.pitch = 4;
    this.moved = false;
    this.behind = [0, 0, 0, 0, 0];
    this.target = low.map((l, i) => (l + high[i]) / 2);
    const tall = (high[1] - low[1]) * 0.57 / (1 - this.covered), wide = (high[0] - low[0]) * 0.58 / aspect;
    this.distance = Math.max(tall, wide) / Math.tan(this.fov * Math.PI / 360) + (high[2] - low[2]) / 2;
  }

  // As frame, but the picture gets there little by little, by `settle`.
  glide(low, high, aspect) {
    const from = this.place();
    this.frame(low, high, aspect);
    this.behind = this.place().map((to, i) => from[i] - to);
  }

  // Seconds of the glide.
  settle(seconds) {
    const left = Math.exp(-seconds / GLIDE_S);
    this.behind = this.behind.map((x) => (Math.abs(x) < 1e-4 ? 0 : x * left));
  }

  // Where it is: the point that it looks at, pitch, distance.
  place() {
    const at = this.target.map((t, i) => t + this.walked[i]);
    return [...at, this.pitch, this.distance].map((x, i) => x + this.behind[i]);
  }

  focal(height) {
    return height / 2 / Math.tan(this.fov * Math.PI / 360);
  }

  // What the renderer draws with, for a picture of width x height px.
  eye(width, height) {
    this.update();
    const focal = this.focal(height);
    return { view: this.view, focal: [focal, focal], centre: [0, -this.covered * height / 2], box: [0, 0, width, height] };
  }

  // Fills this.view: 3x4, row by row, world to camera.
  update() {
    const place = this.place(), target = place.slice(0, 3), [pitch, distance] = place.slice(3);
    const y = this.yaw * Math.PI / 180, p = pitch * Math.PI / 180;
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

  turn(dx, dy) {
    this.yaw -= dx * 0.35;
    this.pitch = Math.min(85, Math.max(-30, this.pitch + dy * 0.3));
  }

  zoom(factor) {
    this.distance = Math.min(30, Math.max(0.35, this.distance * factor));
  }

  pan(dx, dy, height) {
    const step = this.distance / this.focal(height);
    for (let i = 0; i < 3; i++) this.target[i] -= step * (dx * this.view[i] + dy * this.view[4 + i]);
  }

  // onMove is called with each gesture.
  listen(element, onMove) {
    const fingers = new Map();
    element.addEventListener("contextmenu", (e) => e.preventDefault());
    element.addEventListener("pointerdown", (e) => {
      element.setPointerCapture(e.pointerId);
      fingers.set(e.pointerId, [e.clientX, e.clientY]);
    });
    const lift = (e) => fingers.delete(e.pointerId);
    element.addEventListener("pointerup", lift);
    element.addEventListener("pointercancel", lift);
    element.addEventListener("pointermove", (e) => {
      const old = fingers.get(e.pointerId);
      if (!old) return;
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
        this.turn(dx, dy);
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

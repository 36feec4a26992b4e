// The avatar on the canvas: what it plays, how it is turned by hand, what its face does, and the picture of that.

import { Binding } from "./binding.js";
import { OrbitCamera } from "./camera.js";
import { FrameRate } from "./rate.js";
import { freshCanvas, makeRenderer } from "./renderer.js";
import { Pose, Skin } from "./skin.js";
import { DepthSort } from "./sort.js";

const FADE_S = 0.35;
const FOLLOW_S = 0.6;
const BACKGROUND = "#2b303b";
const MAX_PIXEL_RATIO = 2;
// So many places of a clip are looked at for the frame that holds them all.
const FRAME_LOOKS = 16;
// What a browser takes to start its graphics process again.
const RECOVER_MS = 1000;

export class Viewer {
  // asked: how to draw, for makeRenderer.
  static async open(avatar, asked) {
    const viewer = new Viewer(avatar);
    await viewer.drawBy(asked);
    return viewer;
  }

  constructor(avatar) {
    this.avatar = avatar;
    this.pose = new Pose(avatar);
    this.before = new Pose(avatar);
    this.skin = new Skin(avatar);
    this.binding = new Binding(avatar);
    this.sort = new DepthSort(this.binding.count);
    this.stage = document.getElementById("stage");
    this.renderer = null;
    this.camera = new OrbitCamera();
    [this.low, this.high] = bounds(avatar.vertices);
    this.rate = new FrameRate();
    this.expression = {};
    // Joint -> axis-angle, degrees, on top of what is played.
    this.turned = {};
    this.playing = { pose: "T" };
    this.clock = 0;
    this.fade = 1;
    this.paused = false;
    this.turntable = false;
    this.still = false;
    this.background = BACKGROUND;
    this.session = null;
    // Called with {fps, p95} a few times a second, and with a sentence when the way of drawing had to change.
    this.onRate = () => {};
    this.onChange = () => {};
  }

  get canvas() {
    return this.stage.firstElementChild;
  }

  // asked: for makeRenderer. A renderer that stops later is followed by the next plainer one.
  async drawBy(asked) {
    const renderer = await makeRenderer(asked, this.canvas, this);
    renderer.onLost = async (why) => {
      if (this.renderer !== renderer) return;
      this.renderer = null;
      renderer.device?.destroy();
      freshCanvas(this.canvas);
      await new Promise((done) => setTimeout(done, RECOVER_MS));
      await this.drawBy(renderer.kind === "webgpu" ? "webgl" : "software");
      this.move();
      this.draw();
      const way = this.renderer.kind === "webgl" ? "by WebGL" : "without the graphics card";
      this.onChange(`${why || "The graphics driver stopped"}: now drawn ${way}.`);
    };
    this.renderer = renderer;
  }

  play(what) {
    this.before.copy(this.pose);
    this.playing = what;
    this.clock = 0;
    this.fade = 0;
    this.paused = false;
  }

  // As play, and the camera goes where it sees all of it, unless somebody has moved it.
  choose(what) {
    this.play(what);
    if (!this.camera.moved) this.frame("glide");
  }

  // Seconds of the clip that plays; 0 for a still pose.
  get length() {
    const clip = this.avatar.clips[this.playing.clip];
    return clip ? (clip.loop ? clip.keys : clip.keys - 1) / clip.fps : 0;
  }

  // To a place in the clip, s.
  seek(seconds) {
    this.clock = seconds;
    this.fade = 1;
  }

  // seconds: since the last frame.
  step(seconds) {
    this.advance(seconds);
    this.move();
  }

  // The pose after some seconds, and the camera that follows it.
  advance(seconds) {
    if (!this.paused) this.clock += seconds;
    this.fade = Math.min(1, this.fade + seconds / FADE_S);
    if (this.playing.clip) {
      const { length } = this;
      if (this.clock > length && length > 0) {
        if (!this.avatar.clips[this.playing.clip].loop) {
          this.before.copy(this.pose);
          this.fade = 0;
        }
        this.clock %= length;
      }
    }
    this.take(this.pose, this.clock);
    if (this.fade < 1) this.pose.fadeFrom(this.before, this.fade * this.fade * (3 - 2 * this.fade));
    this.turn(this.pose);
    const share = 1 - Math.exp(-seconds / FOLLOW_S), { walked } = this.camera;
    for (const i of [0, 2]) walked[i] += share * (this.pose.transl[i] - walked[i]);
    this.camera.settle(seconds);
  }

  // All that the picture depends on, in words; two equal ones need no new picture.
  get state() {
    this.camera.update();
    const { pose, camera, stage, binding, renderer, background, expression } = this, panel = document.getElementById("panel").offsetTop;
    return [pose.quats, pose.transl, Array.from(camera.view, (x) => x.toFixed(5)), camera.fov, stage.clientWidth, stage.clientHeight,
      window.devicePixelRatio, panel, binding.lit, renderer?.kind, background, JSON.stringify(expression)].join(" ");
  }

  // pose: Pose, set to what plays at a place in the clip, s.
  take(pose, seconds) {
    if (this.playing.clip) pose.clip(this.playing.clip, seconds);
    else pose.still(this.playing.pose);
  }

  // Adds the turns by hand.
  turn(pose) {
    for (const [joint, degrees] of Object.entries(this.turned)) {
      pose.turn(this.avatar.names.indexOf(joint), ...degrees.map((d) => d * Math.PI / 180));
    }
  }

  // Brings the gaussians to the pose: on the graphics card where that can, else here.
  move() {
    if (this.renderer?.move && !this.session) {
      this.skin.moveBones(this.pose);
      this.renderer.move(this.expression);
    } else {
      this.skin.update(this.pose, this.expression);
      this.binding.update(this.skin.vertices);
    }
  }

  get shadow() {
    const [x, , z] = this.low.map((low, i) => (low + this.high[i]) / 2), { transl } = this.pose;
    return { x: x + transl[0], y: this.low[1], z: z + transl[2], radius: 0.3 * (this.high[1] - this.low[1]) };
  }

  draw() {
    if (!this.renderer) return;
    if (this.resize() && !this.camera.moved) this.frame();
    const eye = this.camera.eye(this.canvas.width, this.canvas.height);
    this.renderer.prepare(eye.view);
    this.renderer.clear([...this.rgb, 1]);
    this.renderer.paint(eye, this.still || this.camera.pitch <= 0 ? null : this.shadow);
  }

  // Returns whether the room for the figure has another size than before.
  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, this.renderer?.kind === "software" ? 1 : MAX_PIXEL_RATIO);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    const { offsetHeight, offsetTop } = document.getElementById("panel"), panel = offsetHeight ? window.innerHeight - offsetTop : 0;
    document.documentElement.style.setProperty("--panel", `${panel}px`);
    const covered = Math.min(0.5, panel / window.innerHeight), same = this.canvas.width === width && this.canvas.height === height;
    const other = !same || Math.abs(covered - this.camera.covered) > 0.01;
    if (!same) Object.assign(this.canvas, { width, height });
    this.camera.covered = covered;
    return other;
  }

  // Draws from now on; the headset has its own rhythm (xr.js).
  run() {
    let last = null, shown = null;
    const frame = (now) => {
      if (this.still || this.session) {
        last = shown = null;
        this.rate.reset();
      } else {
        const seconds = last === null ? 0 : Math.min((now - last) / 1000, 0.25);
        if (this.turntable) this.camera.yaw += seconds * 30;
        this.advance(seconds);
        const { state } = this;
        if (state !== shown) {
          this.move();
          this.draw();
        }
        shown = state;
        this.tick(now);
        last = now;
      }
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  tick(now) {
    const rate = this.rate.frame(now);
    if (rate) this.onRate(rate);
  }

  // words: the part of the address after #.
  follow(words) {
    const asked = new URLSearchParams(words), number = (name, fallback) => Number.parseFloat(asked.get(name) ?? fallback);
    this.still = asked.has("still");
    document.body.classList.toggle("bare", this.still);
    if (/^[0-9a-f]{6}$/i.test(asked.get("bg") ?? "")) this.background = `#${asked.get("bg")}`;
    this.turntable = asked.has("turntable");
    this.binding.lit = asked.get("light") !== "off";
    this.expression = {};
    for (const part of (asked.get("expression") ?? "").split(",").filter(Boolean)) {
      const [name, weight] = part.split(":");
      this.expression[name] = Number.parseFloat(weight ?? "1");
    }
    this.turned = {};
    for (const part of (asked.get("joints") ?? "").split(";").filter(Boolean)) {
      const [joint, degrees] = part.split(":"), values = (degrees ?? "").split(",").map(Number);
      if (this.avatar.names.includes(joint) && values.length === 3 && values.every(Number.isFinite)) this.turned[joint] = values;
    }
    const first = Object.keys(this.avatar.clips)[0];
    const playing = Object.hasOwn(this.avatar.clips, asked.get("clip")) ? { clip: asked.get("clip") }
      : Object.hasOwn(this.avatar.poses, asked.get("pose")) ? { pose: asked.get("pose") }
        : first ? { clip: first } : { pose: "T" };
    this.play(playing);
    this.seek(number("t", 0));
    this.camera.walked.fill(0);
    this.step(0);
    this.camera.fov = number("fov", 30);
    this.frame();
    this.camera.moved = ["pitch", "dist", "target"].some((name) => asked.has(name));
    this.camera.yaw = number("yaw", 0);
    this.camera.pitch = number("pitch", this.camera.pitch);
    this.camera.distance = number("dist", this.camera.distance);
    if (asked.has("target")) this.camera.target = asked.get("target").split(",").map(Number);
    this.draw();
  }

  // The background, [r, g, b] in 0..1.
  get rgb() {
    return parseColour(this.background);
  }

  // The whole figure, wherever its clip takes the limbs; the camera walks along by itself.
  // how: `frame` at once or `glide`, see OrbitCamera.
  frame(how = "frame") {
    this.resize();
    const { walked } = this.camera, pose = new Pose(this.avatar), low = Array(3).fill(Infinity), high = Array(3).fill(-Infinity);
    const clip = this.avatar.clips[this.playing.clip], looks = clip ? Math.min(clip.keys, FRAME_LOOKS) : 1;
    for (let n = 0; n < looks; n++) {
      this.take(pose, clip ? Math.floor(n * clip.keys / looks) / clip.fps : 0);
      this.turn(pose);
      this.skin.update(pose, this.expression);
      const [least, most] = bounds(this.skin.vertices), off = [pose.transl[0], 0, pose.transl[2]];
      off.forEach((x, i) => {
        low[i] = Math.min(low[i], least[i] - x);
        high[i] = Math.max(high[i], most[i] - x);
      });
    }
    for (const i of [0, 2]) walked[i] = this.pose.transl[i];
    this.camera[how](low, high, this.canvas.width / this.canvas.height);
    this.move();
  }
}

function bounds(vertices) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  vertices.forEach((x, i) => {
    low[i % 3] = Math.min(low[i % 3], x);
    high[i % 3] = Math.max(high[i % 3], x);
  });
  return [low, high];
}

// #rrggbb -> [r, g, b] in 0..1.
function parseColour(hex) {
  return [1, 3, 5].map((i) => Number.parseInt(hex.slice(i, i + 2), 16) / 255);
}

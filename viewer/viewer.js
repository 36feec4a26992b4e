// The avatar on the canvas: what it plays, how its joints and face are set by hand, the camera, and the picture of it all.

import { OrbitCamera } from "./camera.js";
import { Levels } from "./levels.js";
import { FrameRate } from "./rate.js";
import { makeRenderer, replaceCanvas } from "./renderer.js";
import { Pose, Skin } from "./skin.js";

// From one motion to the next.
const FADE_S = 0.35;
// Time constant of the camera's walk after the figure.
const FOLLOW_S = 0.6;
const BACKGROUND = "#2b303b";
const MAX_PIXEL_RATIO = 2;
const TURNTABLE_DEGREES_PER_S = 30;
// A longer time between two frames counts as this.
export const MAX_STEP_S = 0.25;
// Keys of a clip that are looked at for the framing that holds them all.
const FRAMING_KEYS = 16;
// What a browser takes to start its graphics process again.
const RECOVER_MS = 1000;
// Of the shadow: its radius as a share of the figure's height, and how dark its middle is, 0..1.
const SHADOW_RADIUS = 0.3;
const SHADOW_STRENGTH = 0.4;
// Share of the picture, at most, that the figure makes room for at the bottom and the right, and at the top of the rest.
const MOST_COVERED = 0.5;
const MOST_ABOVE = 0.2;
// Joints whose vertices are the face; and of what is looked at: the box that is framed, as a multiple of its own.
const FACE = /^(head|jaw|left_eye|right_eye)/;
const NEAR_MARGIN = 1.25;
// Of a limb that is looked at: half of its box, at least, m.
const LEAST_NEAR = 0.12;

/**
 * A round shadow on the floor: middle and radius, m; strength in its middle, 0..1.
 * @typedef {{x: number, y: number, z: number, radius: number, strength: number}} Shadow
 */

/**
 * What plays: a clip or a pose of the avatar, by name.
 * @typedef {{clip?: string, pose?: string}} Playing
 */

/**
 * What lies over the picture: px from its bottom, from its right and from its top.
 * @typedef {{bottom: number, right: number, top: number}} Cover
 */

export class Viewer {
  /**
   * Shows nothing until `show`.
   * @param {HTMLElement} stage holds the canvas, and nothing before it
   */
  constructor(stage) {
    this.stage = stage;
    // How far the pose that plays has come in, 0..1.
    this.fade = 1;
    /** @type {import("./renderer.js").Renderer | null} */
    this.renderer = null;
    this.camera = new OrbitCamera();
    this.rate = new FrameRate();
    /** @type {() => Cover} told by whoever lays something over the picture */
    this.cover = () => ({ bottom: 0, right: 0, top: 0 });
    /** @type {Object<string, number>} weights by name */
    this.expression = {};
    /** @type {Object<string, number[]>} joint -> axis-angle, degrees, on top of what plays */
    this.turned = {};
    /** @type {Playing} */
    this.playing = { pose: "T" };
    // Place in the clip, s.
    this.clock = 0;
    this.paused = false;
    this.turntable = false;
    // Whether it turns because nobody has picked anything yet.
    this.opening = false;
    // Whether the picture is one frame without a floor.
    this.still = false;
    // What is looked at, "face" or a joint; null: the whole figure.
    /** @type {string | null} */
    this.near = null;
    // What draws by and by, while it does; hidden: whether it is out of sight; filmed: whether each frame is drawn for a film.
    /** @type {FrameRequestCallback | null} */
    this.running = null;
    this.hidden = false;
    this.filmed = false;
    this.background = BACKGROUND;
    /** @type {XRSession | null} the headset's */
    this.session = null;
    /** @type {import("./webgl.js").WebglRenderer | null} the headset's, where the page draws in another way */
    this.headset = null;
    /** @type {(rate: {fps: number, p95: number}) => void} called a few times a second */
    this.onRate = () => {};
    /** @type {(text: string) => void} called when the renderer had to change */
    this.onChange = () => {};
    /** @type {() => void} called when a clip that does not loop is over */
    this.onEnd = () => {};
  }

  /**
   * Shows an avatar, in place of another one if there is one.
   * @param {import("./reader.js").Avatar} avatar
   * @param {string | null} asked the renderer, as for makeRenderer
   */
  async show(avatar, asked) {
    this.session?.end();
    const [low, high] = bounds(avatar.vertices), pose = new Pose(avatar), skin = new Skin(avatar);
    const levels = new Levels(avatar, high[1] - low[1]);
    const canvas = this.avatar ? replaceCanvas(this.canvas) : this.canvas;
    this.dispose();
    const renderer = await makeRenderer(asked, canvas, { avatar, skin, levels });
    this.avatar = avatar;
    this.pose = pose;
    // The pose that the present one fades in from.
    this.before = new Pose(avatar);
    this.skin = skin;
    // Box around the figure at rest, m.
    this.low = low;
    this.high = high;
    this.levels = levels;
    this.headset = null;
    this.take(renderer);
  }

  get canvas() {
    return /** @type {HTMLCanvasElement} */ (this.stage.firstElementChild);
  }

  // Draws by this renderer; one that is lost later is followed by the next simpler one.
  take(renderer) {
    renderer.onLost = async (why) => {
      if (this.renderer !== renderer) return;
      this.dispose();
      const canvas = replaceCanvas(this.canvas);
      await new Promise((done) => setTimeout(done, RECOVER_MS));
      // Whoever shows an avatar meanwhile replaces the canvas; out of the page nobody needs a renderer.
      if (this.canvas !== canvas || !canvas.isConnected) return;
      this.take(await makeRenderer(renderer.kind === "webgpu" ? "webgl" : "software", canvas, this));
      this.move();
      this.draw();
      const way = this.renderer.kind === "webgl" ? "by WebGL" : "without the graphics card";
      this.onChange(`${why || "The graphics driver stopped"}: now drawn ${way}.`);
    };
    this.renderer = renderer;
  }

  // Gives the graphics card back what it holds; nothing is drawn until there is another renderer.
  dispose() {
    const { renderer } = this;
    this.renderer = null;
    if (renderer && "device" in renderer) renderer.device.destroy();
    if (renderer && "gl" in renderer) renderer.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  /** @param {Playing} what fades in, from its beginning */
  play(what) {
    this.before.copy(this.pose);
    this.playing = what;
    this.clock = 0;
    this.fade = 0;
    this.paused = false;
  }

  // As `play`, and the camera glides to where it sees all of it, unless the user has moved it.
  choose(what) {
    this.play(what);
    if (this.opening) {
      this.opening = this.turntable = false;
      this.camera.glideTo(0);
    }
    if (!this.camera.moved) this.reframe("glide");
  }

  // Of the clip that plays, s; 0 for a pose.
  get length() {
    const clip = this.avatar?.clips[this.playing.clip];
    return clip ? (clip.loop ? clip.keys : clip.keys - 1) / clip.fps : 0;
  }

  // What a film of it takes, s: once through the motion, or once around the figure.
  get round() {
    return this.length || 360 / TURNTABLE_DEGREES_PER_S;
  }

  // Begins what `round` times: the motion anew, or a turn around the figure.
  beginRound() {
    if (this.length) this.seek(0);
    else this.turntable = true;
    this.paused = false;
  }

  // Whether the user asked the system for less motion.
  get calm() {
    return matchMedia("(prefers-reduced-motion: reduce)").matches;
  }

  // Goes to a place in the clip, s.
  seek(seconds) {
    this.clock = seconds;
    this.fade = 1;
  }

  // Goes on by some seconds, gaussians included.
  step(seconds) {
    this.advance(seconds);
    this.move();
  }

  // Moves the pose, and the camera that follows it, on by some seconds.
  advance(seconds) {
    if (!this.paused) this.clock += seconds;
    this.fade = Math.min(1, this.fade + seconds / FADE_S);
    if (this.playing.clip) {
      const { length } = this;
      if (this.clock > length && length > 0) {
        if (!this.avatar.clips[this.playing.clip].loop) {
          this.before.copy(this.pose);
          this.fade = 0;
          this.onEnd();
        }
        this.clock %= length;
      }
    }
    this.setPose(this.pose, this.clock);
    if (this.fade < 1) this.pose.fadeFrom(this.before, this.fade * this.fade * (3 - 2 * this.fade));
    this.addTurns(this.pose);
    const share = 1 - Math.exp(-seconds / FOLLOW_S), { walked } = this.camera;
    for (const i of [0, 2]) walked[i] += share * (this.pose.transl[i] - walked[i]);
    this.camera.settle(seconds);
  }

  // Everything the picture depends on, as text: equal texts need no new picture.
  get state() {
    this.camera.update();
    const { pose, camera, stage, levels, renderer, background, expression } = this, { bottom, right } = this.cover();
    const view = Array.from(camera.view, (x) => x.toFixed(5));
    const place = [stage.clientWidth, stage.clientHeight, window.devicePixelRatio, bottom, right];
    const look = [levels.lit, levels.scene.rows, renderer?.kind, background, JSON.stringify(expression)];
    return [pose.quats, pose.transl, view, camera.fov, place, look].join(" ");
  }

  // Sets a pose to what plays at a place in the clip, s.
  setPose(pose, seconds) {
    if (this.playing.clip) pose.clip(this.playing.clip, seconds);
    else pose.still(this.playing.pose);
  }

  // Adds the joints' turns by hand to a pose.
  addTurns(pose) {
    for (const [joint, degrees] of Object.entries(this.turned)) {
      const [x, y, z] = degrees.map((d) => d * Math.PI / 180);
      pose.turn(this.avatar.names.indexOf(joint), x, y, z);
    }
  }

  // Moves the gaussians to the pose: on the graphics card where the renderer can, else here.
  move() {
    if (this.renderer && "move" in this.renderer && !this.session) {
      this.skin.moveBones(this.pose);
      this.skin.turn(this.pose);
      this.renderer.move(this.expression);
    } else {
      this.skin.update(this.pose, this.expression);
      this.levels.update(this.skin.vertices);
    }
  }

  // Takes the level of detail for the person's height in the picture of the eye that sees it largest.
  chooseLevel(eyes) {
    if (this.levels.choose(Math.max(...eyes.map((eye) => this.levels.height(eye, this.skin))))) this.move();
  }

  /** @returns {Shadow} below the figure where it is now */
  get shadow() {
    const [x, , z] = this.low.map((low, i) => (low + this.high[i]) / 2), { transl } = this.pose;
    return { x: x + transl[0], y: this.low[1], z: z + transl[2], radius: SHADOW_RADIUS * (this.high[1] - this.low[1]),
      strength: SHADOW_STRENGTH };
  }

  // The background, [r, g, b] in 0..1.
  get rgb() {
    return [1, 3, 5].map((i) => Number.parseInt(this.background.slice(i, i + 2), 16) / 255);
  }

  draw() {
    if (!this.renderer) return;
    if (this.resize() && !this.camera.moved) this.reframe("frame");
    const eye = this.camera.eye(this.canvas.width, this.canvas.height);
    this.chooseLevel([eye]);
    this.renderer.prepare(eye.view);
    this.renderer.clear([...this.rgb, 1]);
    this.renderer.paint(eye, this.still || this.camera.pitch <= 0 ? null : this.shadow);
  }

  // Fits the canvas and the camera to the stage and what covers it. Returns whether the figure has other room than before.
  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, this.renderer?.kind === "software" ? 1 : MAX_PIXEL_RATIO);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    const { bottom, right, top } = this.cover(), { camera, canvas, stage } = this;
    const covered = Math.min(MOST_COVERED, bottom / (stage.clientHeight || 1));
    const beside = Math.min(MOST_COVERED, right / (stage.clientWidth || 1));
    const same = canvas.width === width && canvas.height === height;
    const other = !same || Math.abs(covered - camera.covered) > 0.01 || Math.abs(beside - camera.beside) > 0.01;
    if (!same) Object.assign(canvas, { width, height });
    camera.covered = covered;
    camera.beside = beside;
    camera.above = Math.min(MOST_ABOVE, top / (stage.clientHeight * (1 - covered) || 1));
    return other;
  }

  // Draws from now on whenever something changes; a headset's session draws by itself (xr.js).
  run() {
    if (this.running) return;
    let last = null, shown = null;
    const frame = (now) => {
      if (this.running !== frame) return;
      if (this.still || this.session || this.hidden) {
        last = shown = null;
        this.rate.reset();
      } else {
        const seconds = last === null ? 0 : Math.min((now - last) / 1000, MAX_STEP_S);
        if (this.turntable) this.camera.yaw += seconds * TURNTABLE_DEGREES_PER_S;
        this.advance(seconds);
        const { state } = this;
        if (state !== shown || this.filmed) {
          this.move();
          this.draw();
        }
        shown = state;
        this.tick(now);
        last = now;
      }
      requestAnimationFrame(frame);
    };
    this.running = frame;
    requestAnimationFrame(frame);
  }

  stop() {
    this.running = null;
  }

  // Counts a frame; now: ms.
  tick(now) {
    const rate = this.rate.frame(now);
    if (rate) this.onRate(rate);
  }

  /** @param {ReturnType<typeof import("./address.js").readAddress>} options */
  follow(options) {
    const { avatar, camera } = this, { clip, pose } = options;
    this.still = options.still;
    this.background = options.background ?? this.background;
    this.opening = options.turntable === null && !options.picked && !this.calm;
    this.turntable = !this.calm && (options.turntable ?? this.opening);
    this.shine(options);
    this.levels.drawn = 0;
    this.expression = options.expression;
    this.turned = Object.fromEntries(Object.entries(options.turned).filter(([joint]) => avatar.names.includes(joint)));
    if (Object.hasOwn(avatar.clips, clip)) this.play({ clip });
    else if (Object.hasOwn(avatar.poses, pose)) this.play({ pose });
    else this.play({ pose: Object.hasOwn(avatar.poses, "A") ? "A" : "T" });
    this.seek(options.seconds);
    this.paused = this.calm && this.length > 0;
    camera.walked.fill(0);
    this.step(0);
    this.aim(options);
    this.draw();
  }

  /** @param {import("./address.js").Options} options what the camera sees; what is not given frames the whole figure from the front */
  aim({ fov, yaw, pitch, distance, target }) {
    const { camera } = this;
    camera.fov = fov;
    this.frame();
    camera.moved = pitch !== null || distance !== null || target !== null;
    camera.yaw = yaw;
    camera.pitch = pitch ?? camera.pitch;
    camera.distance = distance ?? camera.distance;
    camera.target = target ?? camera.target;
  }

  /** @param {import("./address.js").Options} options by whose lamp, or the clip's light, the person is seen */
  shine({ lit, lamp }) {
    this.levels.lit = lit;
    if (lamp) this.levels.scene.place(...lamp);
    else this.levels.scene.turnOff();
  }

  /**
   * Frames the whole figure, wherever its clip takes the limbs; the camera follows its walk.
   * @param {"frame" | "glide"} how see OrbitCamera
   */
  frame(how = "frame") {
    this.resize();
    const { walked } = this.camera, pose = new Pose(this.avatar), low = Array(3).fill(Infinity), high = Array(3).fill(-Infinity);
    const clip = this.avatar.clips[this.playing.clip], looks = clip ? Math.min(clip.keys, FRAMING_KEYS) : 1;
    for (let n = 0; n < looks; n++) {
      this.setPose(pose, clip ? Math.floor(n * clip.keys / looks) / clip.fps : 0);
      this.addTurns(pose);
      this.skin.update(pose, this.expression);
      const [least, most] = bounds(this.skin.vertices), off = [pose.transl[0], 0, pose.transl[2]];
      off.forEach((x, i) => {
        low[i] = Math.min(low[i], least[i] - x);
        high[i] = Math.max(high[i], most[i] - x);
      });
    }
    for (const i of [0, 2]) walked[i] = this.pose.transl[i];
    this.near = null;
    this.camera[how](low, high, this.canvas.width / this.canvas.height);
    this.move();
  }

  /** @param {string | null} near "face", or a joint, that the camera glides to; null: the whole figure */
  look(near) {
    if (near === this.near) return;
    this.near = near;
    this.opening = this.turntable = false;
    this.camera.glideTo(0);
    this.reframe("glide");
  }

  // Frames anew what the camera looks at; how: as `frame`.
  reframe(how) {
    if (this.near === null) this.frame(how);
    else this.approach(how);
    if (this.calm) this.camera.behind.fill(0);
  }

  // Frames what is near: the vertices of the face, or of a joint and those that hang on it.
  approach(how) {
    this.resize();
    const { avatar: { names, parents, skinIndex, skinWeight }, skin, camera, pose, near } = this, seen = [];
    const meant = names.map((name, j) => (near === "face" ? FACE.test(name) : name === near || names[parents[j]] === near));
    skin.update(pose, this.expression);
    for (let v = 0; v < skinIndex.length / 4; v++) {
      let share = 0;
      for (let k = v * 4; k < v * 4 + 4; k++) if (meant[skinIndex[k]]) share += skinWeight[k];
      if (share > 0.5) seen.push(...skin.vertices.subarray(v * 3, v * 3 + 3));
    }
    if (!seen.length) return;
    const [low, high] = bounds(seen), half = low.map((l, i) => Math.max(LEAST_NEAR, (high[i] - l) / 2 * NEAR_MARGIN));
    const middle = low.map((l, i) => (l + high[i]) / 2 - (i === 1 ? 0 : camera.walked[i]));
    camera[how](middle.map((x, i) => x - half[i]), middle.map((x, i) => x + half[i]), this.canvas.width / this.canvas.height);
    this.move();
  }
}

// The box around vertices (V, 3): its low and its high corner.
function bounds(vertices) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  vertices.forEach((x, i) => {
    low[i % 3] = Math.min(low[i % 3], x);
    high[i % 3] = Math.max(high[i % 3], x);
  });
  return [low, high];
}

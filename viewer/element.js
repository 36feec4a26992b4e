// <gsac-avatar>: the avatar as an element of any page. Its attributes are src, poster, controls, gestures and the options of an
// address (address.js).

import { OPTIONS, findUnknown, readOptions } from "./address.js";
import { beginFilm, takePicture } from "./film.js";
import { keyActions, listenForKeys } from "./keys.js";
import { pickJoint } from "./limb.js";
import { MARKUP } from "./markup.js";
import { Mirror } from "./mirror.js";
import { readAvatar } from "./reader.js";
import { describeView } from "./share.js";
import { Viewer } from "./viewer.js";

// Absent where a server reads this module.
const Element = /** @type {typeof HTMLElement} */ (globalThis.HTMLElement ?? class {});
// What covers the picture where the bar of controls is seen, px.
const BAR_PX = 54;

/**
 * Events: `load` when an avatar is there, `error` (detail: a sentence) when it cannot be shown, `note` (detail: a sentence) when
 * something else is to be told, `change` when what plays or how has changed by hand, `pick` (detail: {joint}) when a limb is
 * clicked, `end` when a motion that does not loop is over, `rate` (detail: {fps, p95}) a few times a second while it moves.
 */
export class GsacAvatar extends Element {
  static observedAttributes = ["src", "poster", "controls", ...OPTIONS];

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    root.innerHTML = MARKUP;
    this.viewer = new Viewer(this.inside("stage"));
    // The bytes of avatar.gsac, once it is there.
    /** @type {ArrayBuffer | null} */
    this.file = null;
    // What fills the screen.
    /** @type {HTMLElement} */
    this.screen = this;
    // The user's mirror, while there is one.
    /** @type {Mirror | null} */
    this.reflection = null;
    // Counts what was opened: only the last is shown.
    this.calls = 0;
    // Counts the mirrors that were asked for, and their ends: only the last holds.
    this.mirrors = 0;
    // Done when nothing is being shown: each showing takes the stage's canvas.
    this.shown = Promise.resolve();
    this.watch = new IntersectionObserver((seen) => { this.viewer.hidden = !seen.at(-1).isIntersecting; });
    const { viewer } = this;
    viewer.onChange = (text) => this.tell("note", text);
    viewer.onEnd = () => this.tell("end", null);
    viewer.onRate = (rate) => {
      this.showTime();
      this.tell("rate", rate);
    };
    this.listen();
  }

  // What stands inside, by its id.
  /** @returns {any} */
  inside(id) {
    return this.shadowRoot.getElementById(id);
  }

  tell(event, detail) {
    this.dispatchEvent(new CustomEvent(event, { detail }));
  }

  // Listens to gestures, keys and the bar.
  listen() {
    const { viewer } = this, stage = this.inside("stage"), changed = () => this.changed();
    stage.addEventListener("wheel", (e) => {
      const ours = this.getAttribute("gestures") === "all" || e.ctrlKey || this.shadowRoot.activeElement === stage;
      if (!ours || !this.file) e.stopImmediatePropagation();
    });
    viewer.camera.listen(stage, () => {
      viewer.turntable = false;
      this.changed();
    }, (x, y) => this.pick(x, y), (x, y) => this.approach(x, y));
    listenForKeys(this, keyActions(this), changed);
    const face = () => viewer.look(viewer.near ? null : "face");
    const act = { toggle: () => this.toggle(), face, full: () => this.fullscreen() };
    for (const id of Object.keys(act)) {
      this.inside(id).addEventListener("click", () => {
        act[id]();
        this.changed();
      });
    }
    this.inside("motion").addEventListener("change", () => this.play(this.inside("motion").value));
    this.inside("time").addEventListener("input", () => viewer.seek(Number(this.inside("time").value) * viewer.length));
  }

  connectedCallback() {
    this.watch.observe(this);
    this.inTurn(() => this.wake()).catch((error) => this.fail(error));
  }

  disconnectedCallback() {
    this.watch.disconnect();
    this.mirror(null);
    this.viewer.stop();
    // An element that is only moved comes back at once.
    this.inTurn(() => this.isConnected || this.viewer.dispose());
  }

  // Does something once what is being shown is there.
  inTurn(act) {
    const done = this.shown.then(act);
    this.shown = done.catch(() => {});
    return done;
  }

  // Goes on in a page after having been in none.
  async wake() {
    if (!this.isConnected || !this.file) return;
    if (this.viewer.renderer) this.viewer.run();
    else await this.present(this.file, readAvatar(this.file), readOptions(this.given));
  }

  attributeChangedCallback(name, before, value) {
    if (before === value) return;
    if (name === "src") {
      if (value) this.load(value).catch((error) => this.fail(error));
    } else if (name === "poster") {
      const poster = this.inside("poster");
      poster.hidden = !value || Boolean(this.file);
      if (value) poster.src = value;
    } else if (name === "controls") {
      const bar = value !== null && value !== "none";
      this.inside("bar").hidden = !bar;
      this.viewer.cover = () => ({ bottom: bar ? BAR_PX : 0, right: 0, top: 0 });
    } else if (this.file && name !== "draw") {
      this.follow(readOptions(this.given));
    }
  }

  // The attributes that are options of what is seen.
  get given() {
    return { has: (name) => this.hasAttribute(name), get: (name) => this.getAttribute(name) };
  }

  // Fetches avatar.gsac from an address and shows it.
  async load(address) {
    const call = ++this.calls, bytes = await fetchBytes(address).catch((error) => {
      if (call === this.calls) throw error;
      return null;
    });
    if (call === this.calls) await this.open(bytes);
  }

  /**
   * Shows an avatar.
   * @param {ArrayBuffer} bytes of avatar.gsac
   * @param {import("./address.js").Options} options what of it is seen; default: as the attributes say
   */
  async open(bytes, options = readOptions(this.given)) {
    const avatar = readAvatar(bytes), call = ++this.calls;
    await this.inTurn(() => (call === this.calls ? this.present(bytes, avatar, options) : null));
  }

  // Shows what was opened, whole, before anything else has its turn.
  async present(bytes, avatar, options) {
    await this.mirror(null);
    await this.viewer.show(avatar, options.draw);
    this.file = bytes;
    this.inside("message").hidden = this.inside("poster").hidden = true;
    const poses = this.poses.map((name) => new Option(`${name}-pose`, name));
    this.inside("motion").replaceChildren(...poses, ...this.clips.map((name) => new Option(name, name)));
    this.follow(options);
    if (this.isConnected) this.viewer.run();
    this.tell("load", { clips: this.clips, poses: this.poses, expressions: this.expressions, joints: this.joints });
  }

  // Says in the element and by an event why there is no avatar.
  fail(error) {
    this.inside("message").textContent = `The avatar cannot be shown: ${error.message}`;
    this.inside("message").hidden = false;
    this.tell("error", error.message);
  }

  /** @param {import("./address.js").Options} options what is seen from now on */
  follow(options) {
    this.viewer.follow(options);
    const faults = [...options.faults, ...findUnknown(options, this.viewer.avatar)];
    if (faults.length) this.tell("note", faults.join(". "));
    this.changed();
  }

  // Shows in the bar what is so, and tells the page.
  changed() {
    const { viewer } = this, { playing } = viewer, moves = viewer.length > 0;
    if (!viewer.avatar) return;
    this.inside("toggle").textContent = (moves ? viewer.paused : !viewer.turntable) ? "Play" : "Pause";
    this.inside("motion").value = playing.clip ?? playing.pose;
    this.inside("time").disabled = !moves;
    this.inside("face").setAttribute("aria-pressed", String(viewer.near !== null));
    this.showTime();
    this.tell("change", null);
  }

  showTime() {
    const { viewer } = this;
    if (viewer.length && this.shadowRoot.activeElement !== this.inside("time")) {
      this.inside("time").value = viewer.clock / viewer.length;
    }
  }

  get clips() {
    return Object.keys(this.viewer.avatar?.clips ?? {});
  }

  get poses() {
    return Object.keys(this.viewer.avatar?.poses ?? {}).sort();
  }

  get expressions() {
    return this.viewer.avatar?.expressions ?? [];
  }

  get joints() {
    return this.viewer.avatar?.names ?? [];
  }

  // Of the motion that plays, s.
  get duration() {
    return this.viewer.length;
  }

  // Place in the motion that plays, s.
  get currentTime() {
    return this.viewer.clock;
  }

  set currentTime(seconds) {
    this.viewer.seek(Math.min(Math.max(0, Number(seconds) || 0), this.viewer.length));
  }

  get paused() {
    return this.viewer.paused;
  }

  // What is seen, as the words after # of the page's address.
  get view() {
    return describeView(this.viewer);
  }

  // Plays a motion or a pose by its name; without one goes on after a pause.
  play(name) {
    const { viewer } = this;
    if (name === undefined) viewer.paused = false;
    else if (this.clips.includes(name)) viewer.choose({ clip: name });
    else if (this.poses.includes(name)) viewer.choose({ pose: name });
    else throw new Error(`${name}: this avatar has ${[...this.poses, ...this.clips].join(", ") || "nothing to play"}`);
    this.changed();
  }

  pause() {
    this.viewer.paused = true;
    this.changed();
  }

  // Stops the motion, and the turn, where they are, or lets them go on.
  toggle() {
    const { viewer } = this;
    if (viewer.length) viewer.paused = !viewer.paused;
    else viewer.turntable = !viewer.turntable;
    this.changed();
  }

  /** @param {Object<string, number>} weights of the face, by expression; what is not named is at rest */
  express(weights) {
    const strange = Object.keys(weights).find((name) => !this.expressions.includes(name) || !Number.isFinite(weights[name]));
    if (strange !== undefined) throw new Error(`${strange}: expected one of the expressions, with a number`);
    this.viewer.expression = { ...weights };
    this.changed();
  }

  /** @param {Object<string, number[]>} turns joint -> axis-angle, degrees, on top of what plays; what is not named is not turned */
  turn(turns) {
    const strange = Object.keys(turns).find((name) => !this.joints.includes(name) || !Array.isArray(turns[name])
      || turns[name].length !== 3 || !turns[name].every(Number.isFinite));
    if (strange !== undefined) throw new Error(`${strange}: expected one of the joints, with three numbers`);
    this.viewer.turned = { ...turns };
    this.changed();
  }

  /** @param {string} what the camera glides to: "body", "face" or a joint */
  look(what) {
    if (!["body", "face", ...this.joints].includes(what)) throw new Error(`${what}: expected body, face or one of the joints`);
    this.viewer.look(what === "body" ? null : what);
    this.changed();
  }

  // Sees the whole figure from the front again.
  reset() {
    this.viewer.camera.yaw = 0;
    this.viewer.frame();
    this.changed();
  }

  /** @returns {Promise<Blob>} what is seen, as PNG */
  picture() {
    return takePicture(this.viewer);
  }

  /**
   * @param {number} [seconds] how long; default: once through the motion, from its beginning, or around the figure in a pose
   * @returns {Promise<Blob>} what is seen in that time, as WebM, or as MP4 where the browser writes no WebM
   */
  film(seconds) {
    const { viewer } = this, film = beginFilm(viewer);
    if (seconds === undefined) {
      viewer.beginRound();
      this.changed();
    }
    setTimeout(film.stop, (seconds ?? viewer.round) * 1000);
    return film.done;
  }

  /**
   * The avatar does what the user does before the camera, as in a mirror, until it is called with null.
   * @param {import("./mirror.js").Kit | null} kit
   */
  async mirror(kit) {
    const call = ++this.mirrors;
    this.reflection?.end();
    this.reflection = null;
    if (kit) {
      const mirror = await Mirror.start(this.viewer, kit, () => call === this.mirrors);
      if (!mirror) return;
      mirror.onFail = (error) => {
        this.mirror(null);
        this.tell("note", `The mirror has ended: ${error.message}`);
      };
      this.reflection = mirror;
    }
    this.changed();
  }

  // Fills the screen with the element, or goes back.
  async fullscreen() {
    try {
      await (document.fullscreenElement ? document.exitFullscreen() : this.screen.requestFullscreen());
    } catch (error) {
      this.tell("note", `The browser refuses the full screen: ${error.message}`);
    }
  }

  // Tells which limb a click means; x, y: px of the stage.
  pick(x, y) {
    const joint = this.file && pickJoint(this.viewer, x, y);
    if (joint) this.tell("pick", { joint });
  }

  // Comes near to what two clicks mean, or sees the whole figure again; x, y: px of the stage.
  approach(x, y) {
    if (!this.file) return;
    const { viewer } = this;
    const joint = viewer.near ? null : pickJoint(viewer, x, y);
    viewer.look(/head|neck/.test(joint ?? "") ? "face" : joint);
    this.changed();
  }
}

async function fetchBytes(address) {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error(`${address}: the server answers ${answer.status}`);
  return answer.arrayBuffer();
}

// The page's buttons, sliders and dropped files: they change the viewer and show its state.

import { GsacError } from "./container.js";
import { beginFilm, takePicture } from "./film.js";
import { openKit } from "./kit.js";
import { keyActions, listenForKeys } from "./keys.js";
import { addLightDial } from "./light_dial.js";
import { MotionError } from "./motion.js";
import { addMotions, findAvatar, listenForDrops, readFile } from "./motion_files.js";
import { saveFile, shareLink } from "./share.js";
import { addFaceSliders, addJointSliders, addPresets } from "./sliders.js";

// A note on the page stays this long.
const NOTE_MS = 9000;
// Where all but the motions is folded away at first: on a phone, and in a small frame of another page.
const FOLDS = "(max-width: 600px) and (pointer: coarse), (max-width: 340px), (max-height: 480px)";
// Where the figure stands below the buttons at the top; elsewhere they are beside it, or nearly all are away.
const STACKED = "(max-width: 600px) and (min-height: 481px)";
// Renderer's kind -> its name on the page.
const RENDERERS = { webgpu: "WebGPU", webgl: "WebGL", software: "no graphics card" };

/** @returns {any} the page's element, a button or an input among others */
const find = (id) => document.getElementById(id);

export class Controls {
  /**
   * @param {import("./element.js").GsacAvatar} person
   * @param {string} name the avatar's, or none
   */
  constructor(person, name) {
    const { viewer } = person;
    this.person = person;
    this.viewer = viewer;
    this.name = "avatar";
    // The film that is being made.
    /** @type {ReturnType<typeof beginFilm> | null} */
    this.film = null;
    // The networks of the mirror, once the user has given them.
    /** @type {import("./mirror.js").Kit | null} */
    this.kit = null;
    // Drawer -> what makes it show the viewer's state.
    /** @type {Object<string, () => void>} */
    this.drawers = { joints: () => {}, faces: () => {} };
    this.nameAs(name);
    viewer.cover = () => this.measureCover();
    this.onClick("turntable", () => { viewer.turntable = !viewer.turntable; });
    this.onClick("light", () => { viewer.levels.lit = !viewer.levels.lit; });
    this.showLamp = addLightDial(() => viewer.levels.scene, find("lamp"), find("lamp-share"), () => this.show());
    this.onClick("pause", () => person.toggle());
    this.onClick("reset", () => person.reset());
    this.onClick("fullscreen", () => person.fullscreen());
    this.onClick("show-help", () => this.help());
    this.onClick("share", async () => {
      this.note(await shareLink(`${location.href.split("#")[0]}#${person.view}`, document.title));
    });
    this.onClick("save", () => saveFile(new Blob([person.file]), `${this.name}.gsac`));
    this.onClick("fold", () => document.body.classList.toggle("folded"));
    document.body.classList.toggle("folded", matchMedia(FOLDS).matches);
    document.addEventListener("fullscreenchange", () => this.show());
    find("fullscreen").hidden = !document.fullscreenEnabled;
    this.onClick("open", () => find("file").click());
    this.onClick("picture", () => this.savePicture());
    this.onClick("film", () => this.saveFilm());
    this.onClick("mirror", () => this.mirror());
    find("choose-kit").addEventListener("click", () => find("kit-files").click());
    find("kit-files").addEventListener("change", () => this.takeKit([...find("kit-files").files]));
    find("background").addEventListener("input", () => { viewer.background = find("background").value; });
    find("time").addEventListener("input", () => viewer.seek(Number(find("time").value) * viewer.length));
    find("file").addEventListener("change", async () => {
      await this.open([...find("file").files]);
      find("file").value = "";
    });
    listenForDrops(find("drop"), (files) => this.open(files));
    listenForKeys(document, { ...keyActions(person), i: () => { find("status").hidden = !find("status").hidden; },
      "?": () => this.help(), Escape: () => this.openDrawer(null) }, () => this.show());
    person.addEventListener("change", () => this.show());
    person.addEventListener("load", () => this.fill());
    person.addEventListener("note", (e) => this.note(/** @type {CustomEvent} */ (e).detail));
    person.addEventListener("rate", (e) => this.showRate(/** @type {CustomEvent} */ (e).detail));
    person.addEventListener("pick", (e) => this.openJoint(/** @type {CustomEvent} */ (e).detail.joint));
    for (const name of Object.keys(this.drawers)) {
      this.onClick(`show-${name}`, () => this.openDrawer(find(name).hidden ? name : null));
      this.onClick(`zero-${name}`, () => {
        if (name === "joints") viewer.turned = {};
        else viewer.expression = {};
      });
    }
    for (const button of document.querySelectorAll(".drawer .close")) button.addEventListener("click", () => this.openDrawer(null));
  }

  // Makes the controls that the avatar needs.
  fill() {
    const { person, viewer } = this;
    for (const place of ["poses", "presets", "joint-rows", "face-rows"]) find(place).replaceChildren();
    for (const pose of person.poses) this.addButton(`${pose}-pose`, { pose });
    for (const clip of person.clips) this.addButton(clip[0].toUpperCase() + clip.slice(1), { clip });
    find("light").hidden = viewer.avatar.light === null;
    addPresets(viewer, find("presets"), () => this.show());
    this.drawers = { joints: addJointSliders(viewer, find("joint-rows")), faces: addFaceSliders(viewer, find("face-rows")) };
    find("show-faces").hidden = person.expressions.length === 0;
    this.show();
  }

  // Names the page; name: the avatar's, or none.
  nameAs(name) {
    if (!name) return;
    this.name = name;
    find("name").textContent = name;
    document.title = `${name} · GSAC avatar`;
  }

  // Shows or hides the controls as the address wants it.
  follow({ still, rate }) {
    document.body.classList.toggle("bare", still);
    if (rate) find("status").hidden = false;
  }

  /** @returns {import("./viewer.js").Cover} what the controls cover of the picture */
  measureCover() {
    const { offsetHeight, offsetTop } = find("panel"), bottom = offsetHeight ? window.innerHeight - offsetTop : 0;
    const drawer = Object.keys(this.drawers).map(find).find((it) => !it.hidden && getComputedStyle(it).position === "fixed");
    if (bottom !== this.bottom) document.documentElement.style.setProperty("--panel", `${bottom}px`);
    this.bottom = bottom;
    const buttons = find("top"), stacked = bottom > 0 && matchMedia(STACKED).matches;
    const top = stacked ? buttons.offsetTop + buttons.offsetHeight : 0;
    return { bottom, right: drawer?.offsetWidth ? window.innerWidth - drawer.offsetLeft : 0, top };
  }

  onClick(id, act) {
    find(id).addEventListener("click", () => {
      act();
      this.show();
    });
  }

  // A button that plays a clip or a pose.
  addButton(text, what) {
    const element = document.createElement("button");
    element.textContent = text;
    Object.assign(element.dataset, what);
    element.addEventListener("click", () => {
      this.person.play(what.clip ?? what.pose);
    });
    find("poses").append(element);
  }

  // Opens one drawer and closes the other; null closes both. With the face's the camera comes near to the face.
  openDrawer(name) {
    const { viewer } = this, wasFace = !find("faces").hidden;
    for (const other of Object.keys(this.drawers)) {
      find(other).hidden = other !== name;
      find(`show-${other}`).setAttribute("aria-pressed", String(other === name));
    }
    if (name === "faces") viewer.look("face");
    else if (wasFace && viewer.near === "face") viewer.look(null);
  }

  // Takes files from the user, an avatar or motions; an error is shown on the page.
  async open(files) {
    const { person } = this;
    try {
      const avatar = findAvatar(files);
      if (avatar) {
        await person.open(await readFile(avatar));
        this.nameAs(avatar.name.replace(/\.gsac$/i, ""));
      } else {
        const { avatar } = this.viewer, added = await addMotions(avatar, files);
        const gone = avatar !== this.viewer.avatar;
        if (gone) throw new MotionError(`${files[0].name}: another avatar has come meanwhile; drop it again`);
        for (const clip of added) this.addButton(clip, { clip });
        person.play(added[0]);
        this.note(`${added.join(", ")}: put on this avatar`);
      }
    } catch (error) {
      if (!(error instanceof MotionError || error instanceof GsacError)) throw error;
      this.note(error.message);
    }
    this.show();
  }

  // What is seen, as a file's name.
  get title() {
    const { playing } = this.viewer;
    return `${this.name} ${playing.clip ?? `${playing.pose}-pose`}`;
  }

  // Begins the mirror or ends it; before the first time the user is asked for its networks.
  async mirror() {
    const { person } = this;
    if (!this.kit) {
      find("kit").showModal();
      return;
    }
    try {
      await person.mirror(person.reflection ? null : this.kit);
    } catch (error) {
      this.note(`No mirror: ${error.message}`);
    }
    this.show();
  }

  // Takes the networks of the mirror from the user, and begins it.
  async takeKit(files) {
    find("kit-files").value = "";
    find("kit").close();
    this.note("Mirror: opening the networks…");
    try {
      this.kit = await openKit(files);
      await this.mirror();
    } catch (error) {
      if (!(error instanceof MotionError)) throw error;
      this.note(error.message);
    }
  }

  // Offers what is seen as a PNG file.
  async savePicture() {
    const name = `${this.title}.png`;
    try {
      saveFile(await takePicture(this.viewer), name);
    } catch (error) {
      this.note(error.message);
    }
  }

  // Films what is seen, until the motion is over or the button is pressed again, and offers the file.
  async saveFilm() {
    if (this.film) {
      this.film.stop();
      return;
    }
    const { viewer, title } = this;
    try {
      this.film = beginFilm(viewer);
      viewer.beginRound();
      this.show();
      this.note(`Filming for ${viewer.round.toFixed(1)} s; Film again ends it`);
      const timer = setTimeout(this.film.stop, viewer.round * 1000), film = await this.film.done;
      clearTimeout(timer);
      saveFile(film, `${title}.${film.type.split("/")[1]}`);
    } catch (error) {
      this.note(error.message);
    }
    this.film = null;
    this.show();
  }

  help() {
    if (find("help").open) find("help").close();
    else find("help").showModal();
  }

  // Opens the drawer of joints at the one that a click meant.
  openJoint(joint) {
    find("joint").value = joint;
    this.openDrawer("joints");
    this.show();
  }

  // Shows a sentence for a while.
  note(text) {
    find("note").textContent = text;
    find("note").hidden = false;
    clearTimeout(this.noteTimer);
    this.noteTimer = setTimeout(() => { find("note").hidden = true; }, NOTE_MS);
  }

  showRate({ fps, p95 }) {
    const { viewer, viewer: { levels } } = this, count = levels.binding.count.toLocaleString("en");
    const level = levels.vary ? `, level ${levels.drawn + 1} of ${levels.bindings.length}` : "";
    const rate = `${fps.toFixed(fps < 10 ? 1 : 0)} fps · p95 ${p95.toFixed(p95 < 100 ? 1 : 0)} ms`;
    find("fps").textContent = `${rate} · ${count} gaussians${level} · ${RENDERERS[viewer.renderer?.kind] ?? "…"}`;
    if (viewer.length) {
      if (document.activeElement !== find("time") || !viewer.paused) find("time").value = viewer.clock / viewer.length;
      find("clock").textContent = `${viewer.clock.toFixed(1)} / ${viewer.length.toFixed(1)} s`;
    }
  }

  // Makes all controls show the viewer's state.
  show() {
    const { viewer } = this, { playing } = viewer;
    if (!viewer.avatar) return;
    for (const button of find("poses").querySelectorAll("button")) {
      button.setAttribute("aria-pressed", String(button.dataset.pose === playing.pose && button.dataset.clip === playing.clip));
    }
    find("mirror").setAttribute("aria-pressed", String(this.person.reflection !== null));
    find("film").setAttribute("aria-pressed", String(this.film !== null));
    find("turntable").setAttribute("aria-pressed", String(viewer.turntable));
    find("light").setAttribute("aria-pressed", String(viewer.levels.lit));
    this.showLamp();
    find("timeline").hidden = find("pause").disabled = find("time").disabled = !viewer.length;
    if (!viewer.length) find("clock").textContent = "";
    find("fullscreen").setAttribute("aria-pressed", String(document.fullscreenElement !== null));
    const folded = document.body.classList.contains("folded");
    find("fold").textContent = folded ? "All controls" : "Fewer controls";
    find("fold").setAttribute("aria-expanded", String(!folded));
    find("pause").textContent = viewer.paused ? "Play" : "Pause";
    find("background").value = viewer.background;
    Object.values(this.drawers).forEach((showSliders) => showSliders());
  }
}

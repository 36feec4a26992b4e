// The page's buttons, sliders and dropped files: they change the viewer and show its state.

import { listenForKeys } from "./keys.js";
import { addLightDial } from "./light_dial.js";
import { pickJoint } from "./limb.js";
import { MotionError } from "./motion.js";
import { addMotions, listenForDrops } from "./motion_files.js";
import { describeView, saveFile, shareLink } from "./share.js";
import { addFaceSliders, addJointSliders, addPresets } from "./sliders.js";

// A note on the page stays this long.
const NOTE_MS = 9000;
// Renderer's kind -> its name on the page.
const RENDERERS = { webgpu: "WebGPU", webgl: "WebGL", software: "no graphics card" };

/** @returns {any} the page's element, a button or an input among others */
const find = (id) => document.getElementById(id);

export class Controls {
  /**
   * @param {import("./viewer.js").Viewer} viewer
   * @param {string} name the avatar's, or none
   * @param {ArrayBuffer} file the bytes of avatar.gsac
   */
  constructor(viewer, name, file) {
    this.viewer = viewer;
    this.name = name || "avatar";
    if (name) {
      find("name").textContent = name;
      document.title = `${name} · GSAC avatar`;
    }
    for (const pose of Object.keys(viewer.avatar.poses).sort()) this.addButton(`${pose}-pose`, { pose });
    for (const clip of Object.keys(viewer.avatar.clips)) this.addButton(clip[0].toUpperCase() + clip.slice(1), { clip });
    this.onClick("turntable", () => { viewer.turntable = !viewer.turntable; });
    this.onClick("light", () => { viewer.levels.lit = !viewer.levels.lit; });
    find("light").hidden = viewer.avatar.light === null;
    this.showLamp = addLightDial(viewer.levels.scene, find("lamp"), find("lamp-share"), () => this.show());
    this.onClick("pause", () => this.pause());
    this.onClick("reset", () => this.reset());
    this.onClick("fullscreen", () => this.fullscreen());
    this.onClick("show-help", () => this.help());
    this.onClick("share", async () => this.note(await shareLink(describeView(viewer), document.title)));
    this.onClick("save", () => saveFile(new Blob([file]), `${this.name}.gsac`));
    this.onClick("fold", () => document.body.classList.toggle("folded"));
    document.body.classList.toggle("folded", matchMedia("(max-width: 600px) and (pointer: coarse)").matches);
    document.addEventListener("fullscreenchange", () => this.show());
    find("fullscreen").hidden = !document.fullscreenEnabled;
    this.onClick("open", () => find("file").click());
    this.onClick("picture", () => this.savePicture());
    find("background").addEventListener("input", () => { viewer.background = find("background").value; });
    find("time").addEventListener("input", () => viewer.seek(Number(find("time").value) * viewer.length));
    find("file").addEventListener("change", async () => {
      await this.open([...find("file").files]);
      find("file").value = "";
    });
    listenForDrops(find("drop"), (files) => this.open(files));
    viewer.camera.listen(viewer.stage, () => {
      viewer.turntable = false;
      this.show();
    }, (x, y) => this.pick(x, y));
    listenForKeys(this);
    addPresets(viewer, find("presets"), () => this.show());
    viewer.onRate = (rate) => this.showRate(rate);
    viewer.onChange = (text) => this.note(text);
    // Drawer -> what makes it show the viewer's state.
    this.drawers = { joints: addJointSliders(viewer, find("joint-rows")), faces: addFaceSliders(viewer, find("face-rows")) };
    for (const name of Object.keys(this.drawers)) {
      this.onClick(`show-${name}`, () => this.openDrawer(find(name).hidden ? name : null));
      this.onClick(`zero-${name}`, () => {
        if (name === "joints") viewer.turned = {};
        else viewer.expression = {};
      });
    }
    for (const button of document.querySelectorAll(".drawer .close")) button.addEventListener("click", () => this.openDrawer(null));
    find("show-faces").hidden = viewer.avatar.expressions.length === 0;
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
      this.viewer.choose(what);
      this.show();
    });
    find("poses").append(element);
  }

  // Opens one drawer and closes the other; null closes both.
  openDrawer(name) {
    for (const other of Object.keys(this.drawers)) {
      find(other).hidden = other !== name;
      find(`show-${other}`).setAttribute("aria-pressed", String(other === name));
    }
  }

  // Takes motion files from the user; an error is shown on the page.
  async open(files) {
    try {
      const added = await addMotions(this.viewer.avatar, files);
      for (const clip of added) this.addButton(clip, { clip });
      this.viewer.choose({ clip: added[0] });
      this.note(`${added.join(", ")}: put on this avatar`);
    } catch (error) {
      if (!(error instanceof MotionError)) throw error;
      this.note(error.message);
    }
    this.show();
  }

  // Offers the canvas as a PNG file.
  savePicture() {
    const { viewer } = this, name = `${this.name} ${viewer.playing.clip ?? `${viewer.playing.pose}-pose`}.png`;
    viewer.draw();
    viewer.canvas.toBlob((blob) => saveFile(blob, name), "image/png");
  }

  // Stops the motion, and the turn, where they are, or lets them go on.
  pause() {
    const { viewer } = this;
    if (viewer.length) viewer.paused = !viewer.paused;
    else viewer.turntable = !viewer.turntable;
  }

  reset() {
    this.viewer.camera.yaw = 0;
    this.viewer.frame();
  }

  // Fills the screen with the page, or goes back.
  fullscreen() {
    const done = document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen();
    done.catch((error) => this.note(`The browser refuses the full screen: ${error.message}`));
  }

  help() {
    if (find("help").open) find("help").close();
    else find("help").showModal();
  }

  // Opens the drawer of joints at the one that a click means; x, y: px of the page.
  pick(x, y) {
    const joint = pickJoint(this.viewer, x, y);
    if (joint === null) return;
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
    for (const button of find("poses").querySelectorAll("button")) {
      button.setAttribute("aria-pressed", String(button.dataset.pose === playing.pose && button.dataset.clip === playing.clip));
    }
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

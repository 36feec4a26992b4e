// The page's buttons, sliders and dropped files: they change the viewer and show its state.

import { MotionError } from "./motion.js";
import { addMotions, listenForDrops } from "./motion_files.js";
import { addFaceSliders, addJointSliders } from "./sliders.js";

// A note on the page stays this long.
const NOTE_MS = 9000;
// Renderer's kind -> its name on the page.
const RENDERERS = { webgpu: "WebGPU", webgl: "WebGL", software: "no graphics card" };

/** @returns {any} the page's element, a button or an input among others */
const find = (id) => document.getElementById(id);

export class Controls {
  /** @param {import("./viewer.js").Viewer} viewer */
  constructor(viewer) {
    this.viewer = viewer;
    for (const pose of Object.keys(viewer.avatar.poses).sort()) this.addButton(`${pose}-pose`, { pose });
    for (const clip of Object.keys(viewer.avatar.clips)) this.addButton(clip[0].toUpperCase() + clip.slice(1), { clip });
    this.onClick("turntable", () => { viewer.turntable = !viewer.turntable; });
    this.onClick("light", () => { viewer.binding.lit = !viewer.binding.lit; });
    find("light").hidden = viewer.avatar.light === null;
    this.onClick("pause", () => { viewer.paused = !viewer.paused; });
    this.onClick("reset", () => {
      viewer.camera.yaw = 0;
      viewer.frame();
    });
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
    });
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
    const { viewer } = this, link = document.createElement("a");
    viewer.draw();
    link.download = `avatar ${viewer.playing.clip ?? `${viewer.playing.pose}-pose`}.png`;
    viewer.canvas.toBlob((blob) => {
      link.href = URL.createObjectURL(blob);
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    }, "image/png");
  }

  // Shows a sentence for a while.
  note(text) {
    find("note").textContent = text;
    find("note").hidden = false;
    clearTimeout(this.noteTimer);
    this.noteTimer = setTimeout(() => { find("note").hidden = true; }, NOTE_MS);
  }

  showRate({ fps, p95 }) {
    const { viewer } = this, count = viewer.binding.count.toLocaleString("en");
    const rate = `${fps.toFixed(fps < 10 ? 1 : 0)} fps · p95 ${p95.toFixed(p95 < 100 ? 1 : 0)} ms`;
    find("fps").textContent = `${rate} · ${count} gaussians · ${RENDERERS[viewer.renderer?.kind] ?? "…"}`;
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
    find("light").setAttribute("aria-pressed", String(viewer.binding.lit));
    find("timeline").hidden = !viewer.length;
    find("pause").textContent = viewer.paused ? "Play" : "Pause";
    find("background").value = viewer.background;
    Object.values(this.drawers).forEach((showSliders) => showSliders());
  }
}

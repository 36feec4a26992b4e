// The page's buttons, sliders and drop place: they change the viewer, and show what it does.

import { MotionError } from "./motion.js";
import { addMotions, listenForDrops } from "./motion_files.js";
import { faceSliders, jointSliders } from "./sliders.js";

const NOTE_MS = 9000;
const WAYS = { webgpu: "WebGPU", webgl: "WebGL", software: "no graphics card" };

const find = (id) => document.getElementById(id);

export class Controls {
  constructor(viewer) {
    this.viewer = viewer;
    for (const clip of Object.keys(viewer.avatar.clips)) this.addButton(clip[0].toUpperCase() + clip.slice(1), { clip });
    for (const pose of Object.keys(viewer.avatar.poses).sort()) this.addButton(`${pose}-pose`, { pose });
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
    find("background").addEventListener("input", (e) => { viewer.background = e.target.value; });
    find("time").addEventListener("input", (e) => viewer.seek(Number(e.target.value) * viewer.length));
    find("file").addEventListener("change", async (e) => {
      await this.open([...e.target.files]);
      e.target.value = "";
    });
    listenForDrops(find("drop"), (files) => this.open(files));
    viewer.camera.listen(viewer.stage, () => {
      viewer.turntable = false;
      this.show();
    });
    viewer.onRate = (rate) => this.showRate(rate);
    viewer.onChange = (text) => this.note(text);
    this.drawers = { joints: jointSliders(viewer, find("joint-rows")), faces: faceSliders(viewer, find("face-rows")) };
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

  openDrawer(name) {
    for (const other of Object.keys(this.drawers)) {
      find(other).hidden = other !== name;
      find(`show-${other}`).setAttribute("aria-pressed", String(other === name));
    }
  }

  // Motion files from the user; what is wrong with one is said on the page.
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

  note(text) {
    find("note").textContent = text;
    find("note").hidden = false;
    clearTimeout(this.noteTimer);
    this.noteTimer = setTimeout(() => { find("note").hidden = true; }, NOTE_MS);
  }

  showRate({ fps, p95 }) {
    const { viewer } = this, count = viewer.binding.count.toLocaleString("en");
    find("fps").textContent = `${fps.toFixed(fps < 10 ? 1 : 0)} fps · p95 ${p95.toFixed(p95 < 100 ? 1 : 0)} ms · ${count} gaussians · ${WAYS[viewer.renderer?.kind] ?? "…"}`;
    if (viewer.length) {
      if (document.activeElement !== find("time") || !viewer.paused) find("time").value = viewer.clock / viewer.length;
      find("clock").textContent = `${viewer.clock.toFixed(1)} / ${viewer.length.toFixed(1)} s`;
    }
  }

  // The controls as the viewer's state has them.
  show() {
    const { viewer } = this, { playing } = viewer;
    for (const button of document.querySelectorAll("#poses button")) {
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

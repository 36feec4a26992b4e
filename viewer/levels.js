// The avatar's levels of detail: which of them is drawn follows from how tall the person stands in the picture.

import { Binding } from "./binding.js";
import { transformPoint } from "./projection.js";
import { SceneLight } from "./scene_light.js";
import { DepthSort } from "./sort.js";

// A coarser level begins where the person is smaller than its greatest height by this factor: at the border nothing flickers.
const SLACK = 0.9;

export class Levels {
  /**
   * @param {import("./reader.js").Avatar} avatar
   * @param {number} stature height of the rest shape, m
   */
  constructor(avatar, stature) {
    this.stature = stature;
    this.maxHeights = avatar.levels.map((level) => level.maxHeight);
    // Whether the height decides: where no level says up to which it is drawn, the finest is.
    this.vary = this.maxHeights.some((most) => most !== null);
    // The finest first.
    this.bindings = avatar.levels.map((level) => new Binding(avatar, level));
    this.sorts = avatar.levels.map((level) => new DepthSort(level.face.length));
    // Which of them is drawn.
    this.drawn = 0;
    // Whether the light of the clip shines on the colours, where the file has it.
    this.lit = true;
    // A lamp in its place.
    this.scene = new SceneLight();
  }

  get binding() {
    return this.bindings[this.drawn];
  }

  get sort() {
    return this.sorts[this.drawn];
  }

  // Moves the gaussians that are drawn; vertices: (V, 3) posed.
  update(vertices) {
    this.binding.update(vertices, this.lit, this.scene);
  }

  // Takes the level for a person of this height, px. Returns whether it is another one than before.
  choose(height) {
    const before = this.drawn;
    this.drawn = Math.min(Math.max(before, this.at(height / SLACK)), this.at(height));
    return this.drawn !== before;
  }

  // The coarsest level that a person of this height, px, may be drawn by.
  at(height) {
    return Math.max(0, this.maxHeights.findLastIndex((most) => most !== null && most >= height));
  }

  /**
   * Height of the person in a picture, px: of the rest shape, where the joint nearest to the eye is.
   * @param {import("./camera.js").Eye} eye
   * @param {import("./skin.js").Skin} skin
   */
  height({ view, focal }, skin) {
    let nearest = Infinity;
    for (let j = 0; j < skin.count; j++) nearest = Math.min(nearest, Math.hypot(...transformPoint(view, skin.place(j))));
    return focal[1] * this.stature / nearest;
  }
}

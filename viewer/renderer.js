// Chooses how the page draws on this device: by WebGPU where there is a graphics card, else by WebGL2, else by the processor.

import { hasNoGraphicsCard } from "./device.js";
import { SoftwareRenderer } from "./software.js";
import { WebglRenderer } from "./webgl.js";
import { WebgpuRenderer } from "./webgpu.js";

/**
 * A picture is made by `prepare(view)`, which sorts the gaussians by depth along the eye's view (between two eyes: of the middle),
 * `clear(background)` with rgba in 0..1, and `paint(eye, shadow)`. A renderer with `move(expression)` poses the gaussians too.
 * `onLost(why)` is called when it cannot draw any more.
 * @typedef {WebgpuRenderer | WebglRenderer | SoftwareRenderer} Renderer
 */

/**
 * @param {string | null} asked "webgpu", "webgl" or "software"; anything else: what suits the device. What cannot be had makes
 *   room for the next of them.
 * @param {HTMLCanvasElement} canvas may be replaced in the page by a fresh one
 * @param {{avatar: import("./reader.js").Avatar, skin: import("./skin.js").Skin, levels: import("./levels.js").Levels}} scene
 * @returns {Promise<Renderer>}
 */
export async function makeRenderer(asked, canvas, { avatar, skin, levels }) {
  if (asked !== "webgl" && asked !== "software") {
    const renderer = await WebgpuRenderer.open(canvas, avatar, skin, levels, asked === "webgpu").catch((error) => {
      console.info(`no WebGPU: ${error.message}`);
      return null;
    });
    if (renderer) return renderer;
  }
  if (asked !== "software" && (asked === "webgl" || !hasNoGraphicsCard())) {
    try {
      return new WebglRenderer(replaceCanvas(canvas), avatar, levels);
    } catch (error) {
      console.info(`no WebGL2: ${error.message}`);
    }
  }
  return new SoftwareRenderer(replaceCanvas(canvas), avatar, levels);
}

/**
 * Puts a copy that nothing has drawn on in the canvas's place: a canvas keeps the kind of context that it had first.
 * @param {HTMLCanvasElement} canvas
 */
export function replaceCanvas(canvas) {
  const fresh = /** @type {HTMLCanvasElement} */ (canvas.cloneNode());
  canvas.replaceWith(fresh);
  return fresh;
}

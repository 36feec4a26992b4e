// Which way the page draws on this device: by WebGPU where there is a graphics card to reach, else by WebGL2, else by itself.

import { hasNoGraphicsCard } from "./device.js";
import { SoftwareRenderer } from "./software.js";
import { WebglRenderer } from "./webgl.js";
import { WebgpuRenderer } from "./webgpu.js";

// asked: "webgpu", "webgl", "software", or whatever suits the device. What cannot draw makes room for the next.
export async function makeRenderer(asked, canvas, { avatar, skin, binding, sort }) {
  if (asked !== "webgl" && asked !== "software") {
    const gpu = await WebgpuRenderer.open(canvas, avatar, skin, binding, asked === "webgpu").catch((error) => {
      console.info(`no WebGPU: ${error.message}`);
      return null;
    });
    if (gpu) return gpu;
  }
  if (asked !== "software" && (asked === "webgl" || !hasNoGraphicsCard())) {
    try {
      return new WebglRenderer(freshCanvas(canvas), avatar, binding, sort);
    } catch (error) {
      console.info(`no WebGL2: ${error.message}`);
    }
  }
  return new SoftwareRenderer(freshCanvas(canvas), avatar, binding, sort);
}

// In the place of the canvas, one that nothing has drawn on.
export function freshCanvas(canvas) {
  const fresh = canvas.cloneNode();
  canvas.replaceWith(fresh);
  return fresh;
}

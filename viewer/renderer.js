// Which way the page draws on this device: by WebGPU where there is a graphics card to reach, else by WebGL2, else by itself.

const SOFTWARE = /swiftshader|llvmpipe|lavapipe|softpipe|software|basic render/i;

// Whether this browser's WebGL2 is missing or runs without a graphics card.
function hasNoGraphicsCard() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return true;
  const names = gl.getExtension("WEBGL_debug_renderer_info"), name = gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(name);
}

// asked: "webgpu", "webgl", "software", or whatever suits the device. What cannot draw makes room for the next.
async function makeRenderer(asked, canvas, { avatar, skin, binding, sort }) {
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
function freshCanvas(canvas) {
  const fresh = canvas.cloneNode();
  canvas.replaceWith(fresh);
  return fresh;
}

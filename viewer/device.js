// Whether this device has a graphics card. Browsers offer WebGL2 and WebGPU without one too, drawn by the processor.

// Names of drivers that draw by the processor.
const SOFTWARE = /swiftshader|llvmpipe|lavapipe|softpipe|software|basic render/i;

// Whether this browser's WebGL2 is missing or runs without a graphics card.
export function hasNoGraphicsCard() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return true;
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  const name = gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(name);
}

/**
 * The WebGPU device, or null. Without a graphics card there is one only where WebGPU was asked for.
 * @param {boolean} asked
 * @returns {Promise<GPUDevice | null>}
 */
export async function reachDevice(asked) {
  const adapter = await navigator.gpu?.requestAdapter({ powerPreference: "high-performance" });
  return adapter && (asked || !isSoftware(adapter)) ? adapter.requestDevice() : null;
}

function isSoftware({ info }) {
  return info.isFallbackAdapter || SOFTWARE.test(`${info.vendor} ${info.architecture} ${info.description}`);
}

// Whether this device has a graphics card, by WebGL2 and by WebGPU. Browsers also offer both on the processor alone.

const SOFTWARE = /swiftshader|llvmpipe|lavapipe|softpipe|software|basic render/i;

// Whether this browser's WebGL2 is missing or runs without a graphics card.
export function hasNoGraphicsCard() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return true;
  const names = gl.getExtension("WEBGL_debug_renderer_info"), name = gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(name);
}

export async function reachDevice(asked) {
  const adapter = await navigator.gpu?.requestAdapter({ powerPreference: "high-performance" });
  return adapter && (asked || !isSoftware(adapter)) ? adapter.requestDevice() : null;
}

function isSoftware({ info }) {
  return info.isFallbackAdapter || SOFTWARE.test(`${info.vendor} ${info.architecture} ${info.description}`);
}

// Shows the avatar in a headset or a phone's AR, where the device offers one, at XR_DISTANCE before the user. Each eye gets its own
// picture; the gaussians are sorted once for both, from the middle of the head.

import { MAX_STEP_S } from "./viewer.js";
import { WebglRenderer } from "./webgl.js";

/** @type {[XRSessionMode, string][]} */
const XR_MODES = [["immersive-vr", "VR"], ["immersive-ar", "AR"]];
// In metres. EYE_HEIGHT: where the device knows no floor, which then lies this far below the head.
const XR_DISTANCE = 1.6;
const EYE_HEIGHT = 1.5;

/**
 * Adds a button for each mode that the device has.
 * @param {import("./viewer.js").Viewer} viewer
 * @param {HTMLElement} place
 * @param {(text: string) => void} tell what went wrong
 */
export async function offerHeadset(viewer, place, tell) {
  if (!navigator.xr) return;
  for (const [mode, label] of XR_MODES) {
    if (!await navigator.xr.isSessionSupported(mode).catch(() => false)) continue;
    const button = document.createElement("button");
    Object.assign(button, { textContent: label, id: `xr-${label.toLowerCase()}` });
    button.addEventListener("click", () => {
      if (viewer.session) viewer.session.end();
      else enter(viewer, mode, button).catch((error) => tell(`${label} did not start: ${error.message}`));
    });
    place.append(button);
  }
}

// Begins a session and draws it until it ends.
async function enter(viewer, mode, button) {
  const session = await navigator.xr.requestSession(mode, { optionalFeatures: ["local-floor"] });
  try {
    const renderer = headsetRenderer(viewer), { gl } = renderer;
    session.addEventListener("end", () => {
      viewer.session = null;
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      button.setAttribute("aria-pressed", "false");
    });
    await gl.makeXRCompatible();
    const layer = new XRWebGLLayer(session, gl, { antialias: false, depth: false, alpha: true });
    await session.updateRenderState({ baseLayer: layer });
    let height = 0;
    const space = await session.requestReferenceSpace("local-floor").catch(() => {
      height = EYE_HEIGHT;
      return session.requestReferenceSpace("local");
    });
    viewer.session = session;
    button.setAttribute("aria-pressed", "true");
    const stand = [-(viewer.low[0] + viewer.high[0]) / 2, -viewer.low[1] - height, -XR_DISTANCE];
    const background = mode === "immersive-ar" ? [0, 0, 0, 0] : [...viewer.rgb, 1];
    let last = null;
    const frame = (now, xrFrame) => {
      session.requestAnimationFrame(frame);
      viewer.step(last === null ? 0 : Math.min((now - last) / 1000, MAX_STEP_S));
      viewer.tick(now);
      last = now;
      const seen = xrFrame.getViewerPose(space);
      if (!seen) return;
      gl.bindFramebuffer(gl.FRAMEBUFFER, layer.framebuffer);
      const eyes = seen.views.map((view) => eyeOf(view, layer.getViewport(view), stand));
      viewer.chooseLevel(eyes);
      renderer.prepare(viewRows(seen.transform.inverse.matrix, stand));
      renderer.clear(background);
      for (const eye of eyes) renderer.paint(eye, viewer.shadow);
    };
    session.requestAnimationFrame(frame);
  } catch (error) {
    await session.end();
    throw error;
  }
}

// A headset is drawn by WebGL2: by the page's renderer, or by one of its own where the page draws in another way.
function headsetRenderer(viewer) {
  if (viewer.renderer instanceof WebglRenderer) return viewer.renderer;
  return viewer.headset ??= new WebglRenderer(document.createElement("canvas"), viewer.avatar, viewer.levels);
}

// Eye's view from a column-major OpenGL view matrix; stand: the avatar's place in the room, m.
function viewRows(m, stand) {
  const rows = new Float32Array(12);
  [1, -1, -1].forEach((sign, r) => {
    for (let c = 0; c < 3; c++) rows[r * 4 + c] = sign * m[c * 4 + r];
    rows[r * 4 + 3] = sign * (m[12 + r] + m[r] * stand[0] + m[4 + r] * stand[1] + m[8 + r] * stand[2]);
  });
  return rows;
}

/** @returns {import("./camera.js").Eye} */
function eyeOf({ projectionMatrix: p, transform }, { x, y, width, height }, stand) {
  return { view: viewRows(transform.inverse.matrix, stand), focal: [p[0] * width / 2, p[5] * height / 2],
    centre: [-p[8] * width / 2, p[9] * height / 2], box: [x, y, width, height] };
}

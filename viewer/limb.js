// The joint that a click on the avatar means.

import { transformPoint } from "./projection.js";

// A click further than this from every joint means none, px.
const REACH = 48;
// Joints that a click on the body seldom means: fingers, eyes and jaw lie too close together.
const SMALL = /index|middle|pinky|ring|thumb|eye|jaw/;

/**
 * @param {import("./viewer.js").Viewer} viewer
 * @param {number} x px of the stage
 * @param {number} y px of the stage
 * @returns {string | null} name of the nearest joint on the screen
 */
export function pickJoint(viewer, x, y) {
  const { avatar, skin, canvas, camera } = viewer, { view, focal, centre } = camera.eye(canvas.width, canvas.height);
  const scale = canvas.clientWidth / canvas.width;
  let best = null, least = REACH;
  skin.moveBones(viewer.pose);
  avatar.names.forEach((name, j) => {
    if (SMALL.test(name)) return;
    const [u, v, depth] = transformPoint(view, skin.place(j));
    if (depth <= 0) return;
    const across = scale * (focal[0] * u / depth + centre[0] + canvas.width / 2);
    const down = scale * (focal[1] * v / depth + centre[1] + canvas.height / 2), far = Math.hypot(across - x, down - y);
    if (far < least) [best, least] = [name, far];
  });
  return best;
}

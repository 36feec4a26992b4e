// The joint that a click on the avatar means.

// A click further than this from every joint means none, px of the page.
const REACH = 48;
// Joints that a click on the body seldom means: fingers, eyes and jaw lie too close together.
const SMALL = /index|middle|pinky|ring|thumb|eye|jaw/;

/**
 * @param {import("./viewer.js").Viewer} viewer
 * @param {number} x px of the page
 * @param {number} y px of the page
 * @returns {string | null} name of the nearest joint on the screen
 */
export function pickJoint(viewer, x, y) {
  const { avatar, skin, canvas, camera } = viewer, { view, focal, centre } = camera.eye(canvas.width, canvas.height);
  const scale = canvas.clientWidth / canvas.width;
  let best = null, least = REACH;
  skin.moveBones(viewer.pose);
  avatar.names.forEach((name, j) => {
    if (SMALL.test(name)) return;
    const rest = avatar.joints.subarray(3 * j, 3 * j + 3), bone = skin.bones.subarray(12 * j, 12 * j + 12);
    const [u, v, depth] = apply(view, apply(bone, rest));
    if (depth <= 0) return;
    const across = scale * (focal[0] * u / depth + centre[0] + canvas.width / 2);
    const down = scale * (focal[1] * v / depth + centre[1] + canvas.height / 2), far = Math.hypot(across - x, down - y);
    if (far < least) [best, least] = [name, far];
  });
  return best;
}

// A point by a 3x4 matrix, row by row.
function apply(m, p) {
  return [0, 4, 8].map((r) => m[r] * p[0] + m[r + 1] * p[1] + m[r + 2] * p[2] + m[r + 3]);
}

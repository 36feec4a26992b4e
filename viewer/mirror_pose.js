// What a face network and a body network see of a user, as the avatar does it in a mirror: the user's right hand is the avatar's
// left. Their axes: x to the picture's right, which is the user's left.

import { Quat, Vec } from "./quat.js";

// Points of MediaPipe's body network: of each side shoulder, elbow, wrist and hip.
const BODY_POINTS = { left: [11, 13, 15, 23], right: [12, 14, 16, 24] };
// A point that is seen less surely than this is not believed.
const SURE = 0.5;
// Share of the head's turn that each joint takes.
const HEAD_SHARES = { neck: 0.4, head: 0.6 };

/**
 * @typedef {{categoryName: string, score: number}} Action of the face, by MediaPipe's names
 * @typedef {{x: number, y: number, z: number, visibility?: number}} Point y down, z away from the camera, m
 */

/**
 * @param {Action[]} actions
 * @param {string[]} expressions the avatar's
 * @returns {Object<string, number>} weights by name
 */
export function mirrorFace(actions, expressions) {
  const swapped = (name) => name.replace(/Left|Right/, (side) => (side === "Left" ? "Right" : "Left"));
  const weights = actions.map(({ categoryName, score }) => [swapped(categoryName), score]);
  return Object.fromEntries(weights.filter(([name]) => expressions.includes(name)));
}

/**
 * @param {ArrayLike<number>} m 4x4, column by column: the head's turn from looking into the camera; y up, z towards the camera
 * @returns {Object<string, number[]>} joint -> axis-angle, degrees
 */
export function mirrorHead(m) {
  const [x, y, z] = [0, 4, 8].map((at) => Vec.unit([m[at], m[at + 1], m[at + 2]]));
  const turn = Quat.toAxisAngle(Quat.fromColumns(x, y, z));
  // In the mirror what turns about x stays, and what turns about y and z goes the other way.
  const degrees = Vec.times([turn[0], -turn[1], -turn[2]], 180 / Math.PI);
  return Object.fromEntries(Object.entries(HEAD_SHARES).map(([joint, share]) => [joint, Vec.times(degrees, share)]));
}

/**
 * @param {Point[]} points 33, of the body network
 * @param {import("./reader.js").Avatar} avatar
 * @returns {Object<string, number[]>} joint -> axis-angle from the T-pose, degrees; an arm that is not seen is left out
 */
export function mirrorArms(points, avatar) {
  const sure = (...indices) => indices.every((i) => points[i] && (points[i].visibility ?? 1) >= SURE);
  const at = (i) => [-points[i].x, -points[i].y, -points[i].z];
  /** @type {Object<string, number[]>} */
  const turns = {};
  if (!sure(BODY_POINTS.left[0], BODY_POINTS.right[0])) return turns;
  const middle = (k) => Vec.times(Vec.add(at(BODY_POINTS.left[k]), at(BODY_POINTS.right[k])), 0.5);
  const up = sure(BODY_POINTS.left[3], BODY_POINTS.right[3]) ? Vec.unit(Vec.minus(middle(0), middle(3))) : [0, 1, 0];
  // In the mirror the user's right shoulder is at the avatar's left.
  const side = Vec.unit(Vec.across(Vec.minus(at(BODY_POINTS.right[0]), at(BODY_POINTS.left[0])), up));
  const trunk = Quat.inverse(Quat.fromColumns(side, up, Vec.cross(side, up)));
  const place = (joint) => [...avatar.joints.subarray(avatar.names.indexOf(joint) * 3).slice(0, 3)];
  for (const [mine, theirs] of [["left", "right"], ["right", "left"]]) {
    const [shoulder, elbow, wrist] = BODY_POINTS[theirs];
    const has = ["shoulder", "elbow", "wrist"].every((joint) => avatar.names.includes(`${mine}_${joint}`));
    if (!has || !sure(shoulder, elbow, wrist)) continue;
    const along = (from, to) => Vec.minus(place(`${mine}_${to}`), place(`${mine}_${from}`));
    const seen = (from, to) => Quat.rotate(trunk, Vec.minus(at(to), at(from)));
    const upper = Quat.between(along("shoulder", "elbow"), seen(shoulder, elbow));
    const fore = Quat.between(along("elbow", "wrist"), Quat.rotate(Quat.inverse(upper), seen(elbow, wrist)));
    turns[`${mine}_shoulder`] = Vec.times(Quat.toAxisAngle(upper), 180 / Math.PI);
    turns[`${mine}_elbow`] = Vec.times(Quat.toAxisAngle(fore), 180 / Math.PI);
  }
  return turns;
}

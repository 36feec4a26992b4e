// Places of a skeleton's nodes in the world, as avatar/motion/places.py has them.

import { Quat, Vec } from "./quat.js";

/** @typedef {{translation: number[], rotation: number[], scale: number}} NodePlace from a node's parent, or from the world */

/**
 * World turn, scale and place of each node from its parent's; parents first.
 * @param {NodePlace[]} pose
 * @param {number[]} parents
 */
export function placeNodes(pose, parents) {
  const out = [];
  pose.forEach(({ translation, rotation, scale }, j) => {
    const above = out[parents[j]];
    out.push(above ? { turn: Quat.multiply(above.turn, rotation), scale: above.scale * scale,
      place: Vec.add(above.place, Quat.rotate(above.turn, Vec.times(translation, above.scale))) }
      : { turn: rotation, scale, place: translation });
  });
  return out;
}

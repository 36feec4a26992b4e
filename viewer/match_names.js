// Finds our joints in another skeleton by name, as avatar/motion/names.py does, whose table joint_names.js holds.

import { NOISE, RULES, SIDES } from "./joint_names.js";

// Side ("left_", "right_" or nothing) and the bare word of a joint's name.
function plainName(name) {
  const words = name.split(/[:|]/).at(-1).match(/[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+/g) || [];
  let side = "", out = "";
  words.forEach((given, i) => {
    const word = given.toLowerCase(), long = word.match(/^(left|right)([a-z]+)$/);
    if (!side && (Object.hasOwn(SIDES, word) || long)) {
      side = SIDES[long ? long[1] : word];
      out += long ? long[2] : "";
    } else if (!NOISE.includes(word) && !(/^\d/.test(word) && i && words[i - 1].toLowerCase() === "bip")) {
      out += /^\d/.test(word) ? String(Number(word)) : word;
    }
  });
  return [side, out];
}

/**
 * @param {string[]} names of the other skeleton's joints
 * @returns {Object<string, number>} our joint -> index into names, for those that are found
 */
export function matchNames(names) {
  const known = new Map(), taken = new Set();
  /** @type {Object<string, number>} */
  const found = {};
  names.forEach((name, i) => {
    const key = plainName(name).join();
    if (!known.has(key)) known.set(key, i);
  });
  for (const [joint, side, spellings] of RULES) {
    const at = spellings.map((word) => known.get(`${side},${word}`)).find((i) => i !== undefined && !taken.has(i));
    if (at === undefined) continue;
    found[joint] = at;
    taken.add(at);
  }
  return found;
}

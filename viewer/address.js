// The options of what is seen: name=value in the page's address after its #, with & between, as in #clip=walk&yaw=30&still; or the
// attributes of the same names of the element <gsac-avatar>.

// Options that pick what is seen: with one of them nothing turns by itself.
const PICKED = ["clip", "pose", "t", "yaw", "pitch", "dist", "target", "still"];
// All but `rate`, which is of the page alone.
export const OPTIONS = [...PICKED, "fov", "bg", "expression", "joints", "light", "lamp", "turntable", "draw"];
const RENDERER_NAMES = ["webgpu", "webgl", "software"];
// Names that a sentence lists at most.
const MOST_NAMES = 12;

/**
 * @typedef {ReturnType<typeof readOptions>} Options
 */

/** @param {string} words the address after # */
export function readAddress(words) {
  return readOptions(new URLSearchParams(words));
}

/**
 * What is no such option is left out, and `faults` has a sentence on it.
 * @param {{has: (name: string) => boolean, get: (name: string) => string | null}} given
 */
export function readOptions(given) {
  /** @type {string[]} */
  const faults = [];
  const refuse = (name, expected, value = given.get(name)) => {
    faults.push(`${name}=${value.slice(0, 40)} is left out: expected ${expected}`);
    return null;
  };
  const number = (name, low, high, expected) => {
    if (!given.has(name)) return null;
    const value = readNumber(given.get(name));
    return value >= low && value <= high ? value : refuse(name, expected);
  };
  const oneOf = (name, words) => {
    if (!given.has(name)) return null;
    return words.includes(given.get(name)) ? given.get(name) : refuse(name, words.filter(Boolean).join(" or "));
  };
  const place = given.has("target") ? given.get("target").split(",").map(readNumber) : null;
  const aimed = !place || place.length === 3 && place.every((x) => Math.abs(x) <= 100);
  const background = given.get("bg");
  const coloured = background === null || /^[0-9a-f]{6}$/i.test(background);
  const turntable = oneOf("turntable", ["", "on", "off"]);
  return {
    // clip=NAME or pose=T|A: what plays. Default: the A-pose.
    clip: given.get("clip"),
    pose: given.get("pose"),
    // t=SECONDS: where the clip begins. Default: 0.
    seconds: number("t", 0, 1e6, "seconds, from 0") ?? 0,
    // yaw=DEGREES of the camera around the avatar. Default: 0, from the front.
    yaw: number("yaw", -36000, 36000, "degrees") ?? 0,
    // fov=DEGREES: the vertical field of view. Default: 30.
    fov: number("fov", 1, 150, "degrees, 1 to 150") ?? 30,
    // pitch=DEGREES, dist=METRES, target=X,Y,Z in metres: the camera's height, distance and aim. Default: the whole figure in view.
    pitch: number("pitch", -90, 90, "degrees, -90 to 90"),
    distance: number("dist", 0.05, 100, "metres, 0.05 to 100"),
    target: aimed ? place : refuse("target", "three numbers, metres, as 0,0.5,0"),
    // bg=RRGGBB: the background. Default: as it is.
    background: coloured ? background && `#${background}` : refuse("bg", "a colour's six digits, as 2b303b"),
    // expression=NAME:WEIGHT,...: the face. Default: none; without a weight 1.
    expression: readExpression(given.get("expression") ?? "", refuse),
    // joints=NAME:X,Y,Z;...: turns on top of what plays, axis-angle in degrees. Default: none.
    turned: readTurns(given.get("joints") ?? "", refuse),
    // light=off: even light instead of the clip's. Default: the clip's.
    lit: oneOf("light", ["", "on", "off"]) !== "off",
    // lamp=AROUND,ABOVE: a lamp in place of the clip's light, degrees from the person's front to her left and above. Default: none.
    lamp: readLamp(given.get("lamp") ?? "", refuse),
    // turntable, or turntable=off: whether the avatar turns. Default: where nothing else is picked, and until something is.
    turntable: turntable === null ? null : turntable !== "off",
    picked: PICKED.some((name) => given.has(name)),
    // still: one frame without controls and floor. Default: it moves.
    still: given.has("still"),
    // draw=webgpu|webgl|software, only when the avatar opens: the renderer. Default: what suits the device.
    draw: oneOf("draw", RENDERER_NAMES),
    // rate: the frames a second are shown. Default: they are not.
    rate: given.has("rate"),
    faults,
  };
}

/**
 * @param {Options} options
 * @param {import("./reader.js").Avatar} avatar
 * @returns {string[]} a sentence for each name that the avatar does not have
 */
export function findUnknown({ clip, pose, expression, turned }, { clips, poses, expressions, names }) {
  /** @type {[string, string[], string[]][]} */
  const asked = [["clip", [clip ?? []].flat(), Object.keys(clips)], ["pose", [pose ?? []].flat(), Object.keys(poses)],
    ["expression", Object.keys(expression), expressions], ["joints", Object.keys(turned), names]];
  return asked.flatMap(([what, wanted, known]) => {
    const some = `${known.slice(0, MOST_NAMES).join(", ") || "none"}${known.length > MOST_NAMES ? " and more" : ""}`;
    const strange = wanted.filter((name) => !known.includes(name));
    return strange.map((name) => `${what}=${name.slice(0, 40)} is left out: this avatar has ${some}`);
  });
}

// NaN where the words are not one number and nothing else.
function readNumber(words) {
  return words.trim() ? Number(words) : NaN;
}

/** @returns {Object<string, number>} weights by name */
function readExpression(words, refuse) {
  return Object.fromEntries(words.split(",").filter(Boolean).map((part) => {
    const [name, weight] = part.split(":"), value = readNumber(weight ?? "1");
    return value >= -2 && value <= 2 ? [name, value] : refuse("expression", "a weight, as jawOpen:0.5", part);
  }).filter(Boolean));
}

/** @returns {number[] | null} two angles, degrees */
function readLamp(words, refuse) {
  if (!words) return null;
  const angles = words.split(",").map(readNumber);
  return angles.length === 2 && angles.every(Number.isFinite) ? angles : refuse("lamp", "two angles, degrees, as 40,30", words);
}

/** @returns {Object<string, number[]>} joint -> x, y, z, degrees */
function readTurns(words, refuse) {
  return Object.fromEntries(words.split(";").filter(Boolean).map((part) => {
    const [joint, degrees] = part.split(":"), turn = (degrees ?? "").split(",").map(readNumber);
    const whole = turn.length === 3 && turn.every(Number.isFinite);
    return whole ? [joint, turn] : refuse("joints", "x,y,z in degrees, as head:0,30,0", part);
  }).filter(Boolean));
}

// The options in the page's address after its #: name=value, with & between, as in #clip=walk&yaw=30&still.

// Options that pick what is seen: with one of them nothing turns by itself.
const PICKED = ["clip", "pose", "t", "yaw", "pitch", "dist", "target", "still"];

/** @param {string} words the address after # */
export function readAddress(words) {
  const given = new URLSearchParams(words);
  const number = (name) => (given.has(name) ? Number.parseFloat(given.get(name)) : null);
  return {
    // clip=NAME or pose=T|A: what plays. Default: the A-pose.
    clip: given.get("clip"),
    pose: given.get("pose"),
    // t=SECONDS: where the clip begins. Default: 0.
    seconds: number("t") ?? 0,
    // yaw=DEGREES of the camera around the avatar. Default: 0, from the front.
    yaw: number("yaw") ?? 0,
    // fov=DEGREES: the vertical field of view. Default: 30.
    fov: number("fov") ?? 30,
    // pitch=DEGREES, dist=METRES, target=X,Y,Z in metres: the camera's height, distance and aim. Default: the whole figure in view.
    pitch: number("pitch"),
    distance: number("dist"),
    target: given.has("target") ? given.get("target").split(",").map(Number) : null,
    // bg=RRGGBB: the background. Default: as it is.
    background: /^[0-9a-f]{6}$/i.test(given.get("bg") ?? "") ? `#${given.get("bg")}` : null,
    // expression=NAME:WEIGHT,...: the face. Default: none; without a weight 1.
    expression: readExpression(given.get("expression") ?? ""),
    // joints=NAME:X,Y,Z;...: turns on top of what plays, axis-angle in degrees. Default: none.
    turned: readTurns(given.get("joints") ?? ""),
    // light=off: even light instead of the clip's. Default: the clip's.
    lit: given.get("light") !== "off",
    // lamp=AROUND,ABOVE: a lamp in place of the clip's light, degrees from the person's front to her left and above. Default: none.
    lamp: readLamp(given.get("lamp")),
    // turntable, or turntable=off: whether the avatar turns. Default: where nothing else is picked, and until something is.
    turntable: given.has("turntable") ? given.get("turntable") !== "off" : null,
    picked: PICKED.some((name) => given.has(name)),
    // still: one frame without controls and floor. Default: it moves.
    still: given.has("still"),
    // draw=webgpu|webgl|software, only when the page opens: the renderer. Default: what suits the device.
    draw: given.get("draw"),
  };
}

/** @returns {number[] | null} two angles; null where there are not two numbers */
function readLamp(words) {
  const angles = (words ?? "").split(",").map(Number);
  return words && angles.length === 2 && angles.every(Number.isFinite) ? angles : null;
}

/** @returns {Object<string, number>} weights by name */
function readExpression(words) {
  return Object.fromEntries(words.split(",").filter(Boolean).map((part) => {
    const [name, weight] = part.split(":");
    return [name, Number.parseFloat(weight ?? "1")];
  }));
}

/** @returns {Object<string, number[]>} joint -> x, y, z, degrees; what is not three numbers is left out */
function readTurns(words) {
  return Object.fromEntries(words.split(";").filter(Boolean).map((part) => {
    const [joint, degrees] = part.split(":");
    return [joint, (degrees ?? "").split(",").map(Number)];
  }).filter(([, values]) => values.length === 3 && values.every(Number.isFinite)));
}

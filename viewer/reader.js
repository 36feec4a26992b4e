// The avatar of a .gsac file, from its head and blocks (docs/gsac-format.md). A bad file throws GsacError.

import { GsacError, unpackGsac } from "./container.js";
import { isTable } from "./json.js";

const GSAC_MAX_JOINTS = 256;
const GSAC_MAX_LEVELS = 16;

// The avatar that the viewer plays. Arrays are flat, row by row; shapes as in docs/gsac-format.md.
export function readAvatar(buffer) {
  const { head, blocks } = unpackGsac(buffer);
  const list = (value, what) => {
    if (!Array.isArray(value)) throw new GsacError("head", `${what} is missing`);
    return value;
  };
  const block = (name, ...shape) => {
    const found = blocks[name];
    if (!found) throw new GsacError("block", `block ${name} is missing`);
    if (found.shape.length !== shape.length || !shape.every((n, i) => n === null || n === found.shape[i])) {
      throw new GsacError("block", `block ${name} has shape ${found.shape}`);
    }
    return found.data;
  };
  const typed = (name, real, shape) => {
    const data = block(name, ...shape);
    if ((data instanceof Float32Array) !== real) throw new GsacError("block", `block ${name} has another type than expected`);
    return data;
  };
  const index = (name, limit, ...shape) => {
    const data = typed(name, false, shape);
    for (const i of data) if (!(i >= 0 && i < limit)) throw new GsacError("value", `${name} points outside`);
    return data;
  };
  const finite = (name, ...shape) => {
    const data = typed(name, true, shape);
    for (const x of data) if (!Number.isFinite(x)) throw new GsacError("value", `${name} is not finite`);
    return data;
  };
  const words = (value, what) => {
    if (!isTable(value) || !Object.values(value).every((w) => typeof w === "string")) throw new GsacError("head", `${what} holds more than text`);
  };
  const different = (value, what) => {
    if (!list(value, what).every((n) => typeof n === "string") || new Set(value).size !== value.length) {
      throw new GsacError("head", `${what} is not a list of different names`);
    }
    return value;
  };
  if (head.format !== "gsac") throw new GsacError("head", "format is not gsac");
  if (!isTable(head.joints) || !isTable(head.poses)) throw new GsacError("head", "a table is missing");
  words(head.licence, "licence");
  words(head.provenance, "provenance");
  const names = different(head.joints.names, "joints.names"), parents = list(head.joints.parents, "joints.parents");
  if (!names.length || names.length > GSAC_MAX_JOINTS || parents.length !== names.length ||
      !parents.every((p, j) => Number.isInteger(p) && (j === 0 ? p === -1 : p >= 0 && p < j))) {
    throw new GsacError("value", "parents must name an earlier joint each");
  }
  const vertices = finite("rest.vertices", null, 3), V = vertices.length / 3;
  const faces = index("rest.faces", V, null, 3);
  const expressions = different(head.expressions, "expressions");
  finite("expression.jaw", expressions.length, 3);
  const moved = index("expression.vertex", V, null);
  const start = index("expression.start", moved.length + 1, expressions.length + 1);
  let rises = start[0] === 0 && start[expressions.length] === moved.length;
  for (let e = 0; e < expressions.length; e++) rises = rises && start[e] <= start[e + 1];
  if (!rises) throw new GsacError("value", "expression.start must rise from 0 to the number of moved vertices");
  const weights = finite("skin.weight", V, 4);
  for (let w = 0; w < weights.length; w += 4) {
    const four = weights.subarray(w, w + 4), sum = four.reduce((a, b) => a + b, 0);
    if (Math.abs(sum - 1) > 1e-3 || Math.min(...four) < 0) throw new GsacError("value", "skin.weight must have rows that sum to 1");
  }
  if (V === 0) throw new GsacError("value", "the mesh has no vertices");
  const levels = list(head.levels, "levels").map((level) => {
    if (!isTable(level) || typeof level.prefix !== "string") throw new GsacError("head", "a level has no prefix");
    const face = index(`${level.prefix}.face`, faces.length / 3, null), N = face.length;
    if (level.count !== N) throw new GsacError("value", `a level says it has other than ${N} gaussians`);
    const gaussian = (name, ...shape) => finite(`${level.prefix}.${name}`, N, ...shape);
    const quat = gaussian("quat", 4);
    for (let q = 0; q < quat.length; q += 4) {
      if (Math.abs(Math.hypot(...quat.subarray(q, q + 4)) ** 2 - 1) > 1e-2) throw new GsacError("value", "quat must hold unit quaternions");
    }
    return { face, mu: gaussian("mu", 3), quat, logScale: gaussian("log_scale", 3), rgb: gaussian("rgb", 3), opacity: gaussian("opacity") };
  });
  if (levels.length === 0 || levels.length > GSAC_MAX_LEVELS) throw new GsacError("head", "levels is empty or too long");
  if (new Set(head.levels.map((level) => level.prefix)).size !== levels.length) throw new GsacError("head", "two levels have the same gaussians");
  for (const pose of Object.values(head.poses)) {
    const rows = isTable(pose) ? Object.entries(pose) : [["", null]];
    for (const [joint, r] of rows) {
      if (!names.includes(joint) || !Array.isArray(r) || r.length !== 3 || !r.every((x) => typeof x === "number" && Math.abs(x) < 100)) {
        throw new GsacError("head", "a pose is not a table of joint -> axis-angle");
      }
    }
  }
  const clips = {};
  for (const clip of list(head.clips, "clips")) {
    if (!isTable(clip)) throw new GsacError("head", "a clip is not a table");
    const joints = different(clip.joints, "clip.joints").map((name) => names.indexOf(name));
    if (typeof clip.name !== "string" || typeof clip.fps !== "number" || typeof clip.loop !== "boolean") {
      throw new GsacError("head", "a clip lacks its name, fps or loop");
    }
    if (Object.hasOwn(clips, clip.name)) throw new GsacError("value", `clip ${clip.name} comes twice`);
    if (!(clip.fps >= 0.1 && clip.fps <= 1000) || joints.includes(-1)) throw new GsacError("value", "a clip names unknown joints or has no rate");
    const rotation = finite(`clip.${clip.name}.rotation`, null, joints.length, 3);
    const keys = blocks[`clip.${clip.name}.rotation`].shape[0];
    if (keys === 0) throw new GsacError("value", "a clip has no keys");
    clips[clip.name] = { fps: clip.fps, loop: clip.loop, joints, keys, rotation, transl: finite(`clip.${clip.name}.transl`, keys, 3) };
  }
  const within = (table, key, least, most) => {
    if (!Object.hasOwn(table, key)) return;
    if (typeof table[key] !== "number") throw new GsacError("head", `${key} is of the wrong kind`);
    if (!(table[key] >= least && table[key] <= most)) throw new GsacError("value", `${key} is out of range`);
  };
  within(head, "ground", -1e6, 1e6);
  if (Object.hasOwn(head, "blend")) {
    if (!isTable(head.blend)) throw new GsacError("head", "blend is of the wrong kind");
    within(head.blend, "low_pass_px2", 0, 100);
    within(head.blend, "alpha_max", 0, 1);
    within(head.blend, "alpha_min", 1e-6, 1);
  }
  return {
    names, parents, vertices, faces, expressions, start, moved, clips, head,
    joints: finite("rest.joints", names.length, 3),
    skinIndex: index("skin.index", names.length, V, 4), skinWeight: weights,
    delta: finite("expression.delta", moved.length, 3), poses: head.poses,
    light: blocks.light ? finite("light", 4, 3) : null,
    ...levels[0],
  };
}

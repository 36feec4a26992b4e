// The avatar of a .gsac file, from its head and blocks (docs/gsac-format.md). A file that breaks the format throws GsacError.

import { GsacError, unpackGsac } from "./container.js";
import { isTable } from "./json.js";

const GSAC_MAX_JOINTS = 256;
const GSAC_MAX_LEVELS = 16;

/**
 * What the viewer plays. Arrays are flat, row by row; V vertices, F faces, J joints, E expressions, M moved vertices;
 * canonical axes, m, rad.
 * @typedef {ReturnType<typeof readAvatar>} Avatar
 */

/** @param {ArrayBuffer} buffer the whole file */
export function readAvatar(buffer) {
  const { head, blocks } = unpackGsac(buffer), arrays = new Arrays(blocks);
  checkHead(head);
  const skeleton = readSkeleton(head, arrays), mesh = readMesh(arrays, skeleton.names.length);
  const expressions = readExpressions(head, arrays, mesh.vertices.length / 3);
  if (mesh.vertices.length === 0) throw new GsacError("value", "the mesh has no vertices");
  const levels = readLevels(head, arrays, mesh.faces.length / 3);
  const correctives = readCorrectives(arrays, mesh.vertices.length / 3, skeleton.names.length);
  checkPoses(head.poses, skeleton.names);
  checkNumber(head, "ground", -1e6, 1e6);
  return {
    ...skeleton, ...mesh, ...expressions, correctives,
    // Of detail, the finest first.
    levels,
    // Name -> joint -> axis-angle.
    poses: head.poses,
    clips: readClips(head, arrays, skeleton.names),
    // Spherical harmonics of the clip's light, (4, 3), or null.
    light: arrays.has("light") ? arrays.real("light", 4, 3) : null,
    blend: readBlend(head),
  };
}

// The file's blocks by name, each with the shape, type and values that its reader expects.
class Arrays {
  constructor(blocks) {
    this.blocks = blocks;
  }

  has(name) {
    return Boolean(this.blocks[name]);
  }

  rows(name) {
    return this.blocks[name].shape[0];
  }

  // shape: lengths, null where any will do.
  take(name, isReal, shape) {
    const found = this.blocks[name];
    if (!found) throw new GsacError("block", `block ${name} is missing`);
    if (found.shape.length !== shape.length || !shape.every((n, i) => n === null || n === found.shape[i])) {
      throw new GsacError("block", `block ${name} has shape ${found.shape}`);
    }
    if ((found.data instanceof Float32Array) !== isReal) throw new GsacError("block", `block ${name} has an unexpected type`);
    return found.data;
  }

  /** @returns {Uint8Array | Uint16Array | Uint32Array} indices below limit */
  index(name, limit, ...shape) {
    const data = this.take(name, false, shape);
    for (const i of data) if (!(i >= 0 && i < limit)) throw new GsacError("value", `${name} points outside`);
    return data;
  }

  /** @returns {Float32Array} finite numbers */
  real(name, ...shape) {
    const data = this.take(name, true, shape);
    for (const x of data) if (!Number.isFinite(x)) throw new GsacError("value", `${name} is not finite`);
    return data;
  }
}

function checkHead(head) {
  if (head.format !== "gsac") throw new GsacError("head", "format is not gsac");
  if (!isTable(head.joints) || !isTable(head.poses)) throw new GsacError("head", "a table is missing");
  for (const key of ["licence", "provenance"]) {
    if (!isTable(head[key]) || !Object.values(head[key]).every((word) => typeof word === "string")) {
      throw new GsacError("head", `${key} holds more than text`);
    }
  }
}

// Returns names [J], parents [J] (-1 for the root), joints (J, 3).
function readSkeleton(head, arrays) {
  const names = checkNames(head.joints.names, "joints.names"), parents = checkList(head.joints.parents, "joints.parents");
  if (!names.length || names.length > GSAC_MAX_JOINTS || parents.length !== names.length ||
      !parents.every((p, j) => Number.isInteger(p) && (j === 0 ? p === -1 : p >= 0 && p < j))) {
    throw new GsacError("value", "parents must name an earlier joint each");
  }
  return { names, parents, joints: arrays.real("rest.joints", names.length, 3) };
}

// Returns vertices (V, 3), faces (F, 3), skinIndex and skinWeight (V, 4).
function readMesh(arrays, jointCount) {
  const vertices = arrays.real("rest.vertices", null, 3), V = vertices.length / 3;
  const faces = arrays.index("rest.faces", V, null, 3), skinWeight = arrays.real("skin.weight", V, 4);
  for (let w = 0; w < skinWeight.length; w += 4) {
    const four = skinWeight.subarray(w, w + 4), sum = four.reduce((a, b) => a + b, 0);
    if (Math.abs(sum - 1) > 1e-3 || Math.min(...four) < 0) throw new GsacError("value", "rows of skin.weight must sum to 1");
  }
  return { vertices, faces, skinIndex: arrays.index("skin.index", jointCount, V, 4), skinWeight };
}

// Returns expressions [E], start (E + 1,), moved (M,), delta (M, 3): expression e moves vertex moved[i] by row i of delta, for each
// i from start[e] to below start[e + 1].
function readExpressions(head, arrays, vertexCount) {
  const expressions = checkNames(head.expressions, "expressions"), E = expressions.length;
  arrays.real("expression.jaw", E, 3);
  const moved = arrays.index("expression.vertex", vertexCount, null), M = moved.length;
  const start = arrays.index("expression.start", M + 1, E + 1);
  checkRise(start, M, "expression.start");
  return { expressions, start, moved, delta: arrays.real("expression.delta", M, 3) };
}

/**
 * Pose correctives: a joint's rotation less the identity, row by row, moves vertex v at rest by the three rows of nine numbers of
 * delta, for each i from start[v] to below start[v + 1] and joint[i]; null where the file has none.
 * @returns {{start: Uint32Array, joint: Uint8Array | Uint16Array | Uint32Array, delta: Float32Array} | null}
 */
function readCorrectives(arrays, vertexCount, jointCount) {
  if (!arrays.has("corrective.start")) return null;
  const joint = arrays.index("corrective.joint", jointCount, null), C = joint.length;
  const start = arrays.index("corrective.start", C + 1, vertexCount + 1);
  checkRise(start, C, "corrective.start");
  return { start, joint, delta: arrays.real("corrective.delta", C, 3, 9) };
}

// Throws unless start rises from 0 to end.
function checkRise(start, end, what) {
  if (start[0] !== 0 || start[start.length - 1] !== end || start.some((at, i) => i > 0 && at < start[i - 1])) {
    throw new GsacError("value", `${what} must rise from 0 to ${end}, the number of its rows`);
  }
}

/**
 * N gaussians: face and opacity (N,), mu, logScale and rgb (N, 3), quat (N, 4) wxyz; maxHeight: px, of the person up to which the
 * level is drawn, or null.
 * @typedef {{face: Uint8Array | Uint16Array | Uint32Array, mu: Float32Array, quat: Float32Array, logScale: Float32Array,
 *   rgb: Float32Array, opacity: Float32Array, maxHeight: number | null}} Level
 */

/** @returns {Level[]} the finest first */
function readLevels(head, arrays, faceCount) {
  const given = checkList(head.levels, "levels"), prefixes = new Set(given.map((level) => level?.prefix));
  if (given.length === 0 || given.length > GSAC_MAX_LEVELS) throw new GsacError("head", "levels is empty or too long");
  if (prefixes.size !== given.length) throw new GsacError("head", "two levels have the same gaussians");
  return given.map((level) => {
    if (!isTable(level) || typeof level.prefix !== "string") throw new GsacError("head", "a level has no prefix");
    const face = arrays.index(`${level.prefix}.face`, faceCount, null), N = face.length;
    if (level.count !== N) throw new GsacError("value", `a level says it has other than ${N} gaussians`);
    const real = (name, ...shape) => arrays.real(`${level.prefix}.${name}`, N, ...shape), quat = real("quat", 4);
    for (let q = 0; q < quat.length; q += 4) {
      const length = Math.hypot(...quat.subarray(q, q + 4));
      if (Math.abs(length ** 2 - 1) > 1e-2) throw new GsacError("value", "quat must hold unit quaternions");
    }
    const { max_height_px: maxHeight = null } = level, shape = { face, mu: real("mu", 3), quat, logScale: real("log_scale", 3) };
    if (maxHeight !== null) checkNumber(level, "max_height_px", 1, 1e6);
    return { ...shape, rgb: real("rgb", 3), opacity: real("opacity"), maxHeight };
  });
}

function checkPoses(poses, names) {
  for (const pose of Object.values(poses)) {
    const isTurn = (r) => Array.isArray(r) && r.length === 3 && r.every((x) => typeof x === "number" && Math.abs(x) < 100);
    if (!isTable(pose) || !Object.entries(pose).every(([joint, r]) => names.includes(joint) && isTurn(r))) {
      throw new GsacError("head", "a pose is not a table of joint -> axis-angle");
    }
  }
}

/**
 * A motion of K keys: rotation (K, joints, 3) axis-angle and transl (K, 3); joints: indices of the joints that it turns.
 * @typedef {{fps: number, loop: boolean, joints: number[], keys: number, rotation: Float32Array, transl: Float32Array}} MotionClip
 */

/** @returns {Object<string, MotionClip>} by name, in the file's order */
function readClips(head, arrays, names) {
  /** @type {Object<string, MotionClip>} */
  const clips = {};
  for (const clip of checkList(head.clips, "clips")) {
    if (!isTable(clip)) throw new GsacError("head", "a clip is not a table");
    const { name, fps, loop } = clip, joints = checkNames(clip.joints, "clip.joints").map((joint) => names.indexOf(joint));
    if (typeof name !== "string" || typeof fps !== "number" || typeof loop !== "boolean") {
      throw new GsacError("head", "a clip lacks its name, fps or loop");
    }
    if (Object.hasOwn(clips, name)) throw new GsacError("value", `clip ${name} comes twice`);
    if (!(fps >= 0.1 && fps <= 1000) || joints.includes(-1)) {
      throw new GsacError("value", "a clip names unknown joints or has no rate");
    }
    const rotation = arrays.real(`clip.${name}.rotation`, null, joints.length, 3), keys = arrays.rows(`clip.${name}.rotation`);
    if (keys === 0) throw new GsacError("value", "a clip has no keys");
    clips[name] = { fps, loop, joints, keys, rotation, transl: arrays.real(`clip.${name}.transl`, keys, 3) };
  }
  return clips;
}

// How gaussians become pixels, with the format's defaults: lowPass is added to a projected covariance, px^2, and if keepsEnergy the
// opacity falls as much as the area grows; the alpha of a gaussian in a pixel is at most alphaMax, and below alphaMin nothing is
// drawn.
function readBlend(head) {
  const { blend = {} } = head;
  if (!isTable(blend)) throw new GsacError("head", "blend is of the wrong kind");
  checkNumber(blend, "low_pass_px2", 0, 100);
  checkNumber(blend, "alpha_max", 0, 1);
  checkNumber(blend, "alpha_min", 1e-6, 1);
  const { low_pass_energy: keepsEnergy = false } = blend;
  if (typeof keepsEnergy !== "boolean") throw new GsacError("head", "low_pass_energy is of the wrong kind");
  const { low_pass_px2: lowPass = 0.3, alpha_max: alphaMax = 0.999, alpha_min: alphaMin = 1 / 255 } = blend;
  return { lowPass, keepsEnergy, alphaMax, alphaMin };
}

function checkList(value, what) {
  if (!Array.isArray(value)) throw new GsacError("head", `${what} is missing`);
  return value;
}

/** @returns {string[]} */
function checkNames(value, what) {
  if (!checkList(value, what).every((name) => typeof name === "string") || new Set(value).size !== value.length) {
    throw new GsacError("head", `${what} is not a list of different names`);
  }
  return value;
}

// A number that the table may leave out.
function checkNumber(table, key, least, most) {
  if (!Object.hasOwn(table, key)) return;
  if (typeof table[key] !== "number") throw new GsacError("head", `${key} is of the wrong kind`);
  if (!(table[key] >= least && table[key] <= most)) throw new GsacError("value", `${key} is out of range`);
}

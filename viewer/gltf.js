// Reads the animations of a glTF 2.0 file: .glb, or .gltf with its buffers inside or beside it. The rest pose is the skin's bind
// pose where there is one, else that of the nodes. An error names the file and the part.

import { decodeBase64 } from "./base64.js";
import { isTable } from "./json.js";
import { MotionError, MotionSource } from "./motion.js";
import { placeNodes } from "./places.js";
import { Quat, Vec } from "./quat.js";

const GLTF_MAGIC = 0x46546c67;
// Animations are sampled at this rate, frames a second.
const GLTF_RATE = 30;
const GLTF_TYPES = {
  5120: Int8Array, 5121: Uint8Array, 5122: Int16Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array,
};
const GLTF_WIDTHS = { SCALAR: 1, VEC3: 3, VEC4: 4, MAT4: 16 };
const GLTF_DEEPEST = 1000;
// Values in the JSON, and numbers that its animations read: a small file can ask for many.
const GLTF_MOST_PARTS = 2e6;
const GLTF_MOST_NUMBERS = 32e6;

/** @typedef {{data: Float64Array, count: number, width: number}} Rows */

/**
 * @param {Uint8Array} bytes
 * @param {string} where the file's name, for errors
 * @param {Object<string, Uint8Array>} beside file name -> bytes of the files that came with it
 * @returns {{name: string, source: MotionSource}[]} one for each animation
 */
export function readGltf(bytes, where, beside = {}) {
  return new GltfReader(bytes, where, beside).motions();
}

class GltfReader {
  constructor(bytes, where, beside) {
    this.where = where;
    this.beside = beside;
    // The binary part of a .glb.
    this.chunk = null;
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    let text = bytes;
    if (bytes.length >= 20 && view.getUint32(0, true) === GLTF_MAGIC) {
      const total = view.getUint32(8, true), rest = 20 + view.getUint32(12, true);
      if (total > bytes.length) throw this.bad(`it says ${total} bytes and has ${bytes.length}`);
      if (rest > bytes.length) throw this.bad("its JSON ends after the file");
      text = bytes.subarray(20, rest);
      if (rest + 8 <= bytes.length) this.chunk = bytes.subarray(rest + 8, rest + 8 + view.getUint32(rest, true));
    }
    if (countParts(text) > GLTF_MOST_PARTS) throw this.bad(`its JSON has more than ${GLTF_MOST_PARTS} parts`);
    try {
      this.document = JSON.parse(new TextDecoder().decode(text));
    } catch (e) {
      throw this.bad("it is not glTF: its JSON does not parse");
    }
    if (!isTable(this.document) || !isTable(this.document.asset)) throw this.bad("it is not glTF: `asset` is missing");
    this.buffers = new Map();
    /** @type {Map<number, Rows>} */
    this.rows = new Map();
    this.read = 0;
    // Accessors whose times are known to rise.
    this.rising = new Set();
  }

  bad(why) {
    return new MotionError(`${this.where}: ${why}`);
  }

  // A list that may be left out.
  list(owner, name, what = name) {
    const found = owner[name] ?? [];
    if (!Array.isArray(found)) throw this.bad(`${what} is not a list`);
    return found;
  }

  // Table i of a list; what: its name.
  entry(list, i, what) {
    const found = Number.isInteger(i) ? list[i] : undefined;
    if (!isTable(found)) throw this.bad(`${what}[${Number.isInteger(i) ? i : "?"}] is missing`);
    return found;
  }

  // Entry i of a list of the document.
  part(name, i) {
    return this.entry(this.list(this.document, name), i, name);
  }

  buffer(i) {
    if (!this.buffers.has(i)) this.buffers.set(i, this.loadBuffer(i));
    return this.buffers.get(i);
  }

  loadBuffer(i) {
    const { uri } = this.part("buffers", i);
    if (uri === undefined && this.chunk) return this.chunk;
    if (typeof uri !== "string") throw this.bad(`buffers[${i}] has no content`);
    const inside = uri.match(/^data:[^,]*;base64,/);
    try {
      if (inside) return decodeBase64(uri.slice(inside[0].length));
    } catch (e) {
      throw this.bad(`buffers[${i}] is not base64`);
    }
    let name = uri.split("/").at(-1);
    try {
      name = decodeURIComponent(name);
    } catch (e) {
      throw this.bad(`buffers[${i}] lies in ${uri}, which is no file's name`);
    }
    if (!Object.hasOwn(this.beside, name)) throw this.bad(`it needs ${name}; drop both files together`);
    return this.beside[name];
  }

  /**
   * Rows of numbers of an accessor; `normalized` integers become -1..1.
   * @returns {Rows}
   */
  numbers(i, width) {
    const known = this.rows.get(i);
    if (known && known.width === width) return known;
    const { count, componentType, type, bufferView, byteOffset = 0, normalized, sparse } = this.part("accessors", i);
    const Type = typeof componentType === "number" ? GLTF_TYPES[componentType] : undefined;
    if (!Type || typeof type !== "string" || GLTF_WIDTHS[type] !== width || !isCount(count) || count === 0 || sparse) {
      throw this.bad(`accessors[${i}] is of a kind that an animation does not have`);
    }
    const { buffer, byteOffset: start = 0, byteStride } = this.part("bufferViews", bufferView), bytes = this.buffer(buffer);
    const size = Type.BYTES_PER_ELEMENT, stride = byteStride || size * width;
    if (![start, byteOffset, stride].every(isCount) || stride < size * width) {
      throw this.bad(`accessors[${i}] has an odd offset or byteStride`);
    }
    const first = start + byteOffset;
    if (first + (count - 1) * stride + size * width > bytes.length) {
      throw this.bad(`accessors[${i}] ends after its buffer; was the file cut off?`);
    }
    this.read += count * width;
    if (this.read > GLTF_MOST_NUMBERS) throw this.bad("its animations have more keys than this page takes");
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength), get = `get${Type.name.replace("Array", "")}`;
    const factor = normalized && Type !== Float32Array ? 2 ** (8 * size - (Type.name[0] === "U" ? 0 : 1)) - 1 : 1;
    const rows = { data: new Float64Array(count * width), count, width };
    for (let k = 0; k < rows.data.length; k++) {
      const column = k % width, value = view[get](first + (k - column) / width * stride + column * size, true) / factor;
      if (!Number.isFinite(value)) throw this.bad(`accessors[${i}] is not finite`);
      rows.data[k] = value;
    }
    this.rows.set(i, rows);
    return rows;
  }

  // The numbers of an accessor, which rise.
  times(i, where) {
    const rows = this.numbers(i, 1);
    if (!this.rising.has(i) && rows.data.some((time, k) => k > 0 && time < rows.data[k - 1])) {
      throw this.bad(`${where} has times that do not rise`);
    }
    this.rising.add(i);
    return rows;
  }

  motions() {
    const animations = this.list(this.document, "animations");
    if (!animations.length) throw this.bad("it holds no animation");
    if (animations.length > MotionSource.MOST_MOTIONS) {
      throw this.bad(`it holds ${animations.length} animations; at most ${MotionSource.MOST_MOTIONS} are taken`);
    }
    const skeleton = this.skeleton(), joints = skeleton.order.length;
    let frames = 0;
    return animations.map((_, i) => {
      const animation = this.part("animations", i), { tracks, end } = this.tracks(animation, `animations[${i}]`, skeleton);
      const length = Math.max(1, Math.floor(end * GLTF_RATE + 1e-6) + 1);
      frames += length;
      const refused = MotionSource.refuse(frames, joints);
      if (refused) throw this.bad(refused);
      const name = typeof animation.name === "string" && animation.name ? animation.name : `animation ${i + 1}`;
      return { name, source: this.sample(tracks, length, skeleton) };
    });
  }

  // Nodes of the first skin and all above them, parents first; without a skin all nodes.
  skeleton() {
    const nodes = this.list(this.document, "nodes").map((_, i) => this.part("nodes", i)), above = nodes.map(() => -1);
    nodes.forEach((node, i) => this.list(node, "children", `nodes[${i}].children`).forEach((child) => {
      if (!isCount(child) || child >= nodes.length || above[child] >= 0) {
        throw this.bad(`nodes[${i}] has a child that is not there or has another parent`);
      }
      above[child] = i;
    }));
    const skin = this.list(this.document, "skins").length ? this.part("skins", 0) : null;
    const joints = skin ? this.joints(skin, nodes) : [];
    // Node -> its place in the skeleton.
    const index = new Map();
    for (const i of skin ? joints : nodes.keys()) {
      const line = [];
      for (let at = i; at >= 0 && !index.has(at); at = above[at]) {
        if (line.push(at) > GLTF_DEEPEST) throw this.bad("its nodes are not a tree");
      }
      for (const at of line.reverse()) index.set(at, index.size);
    }
    const order = [...index.keys()], refused = MotionSource.refuse(1, order.length);
    if (!order.length) throw this.bad("it holds no skeleton");
    if (refused) throw this.bad(refused);
    const local = order.map((i) => this.local(nodes[i], i)), parents = order.map((i) => index.get(above[i]) ?? -1);
    const names = order.map((i) => (typeof nodes[i].name === "string" ? nodes[i].name : `node ${i}`));
    const rest = this.rest(skin, joints.map((i) => index.get(i)), local, parents);
    return { order, index, local, parents, names, rest };
  }

  // The nodes that a skin moves.
  joints(skin, nodes) {
    const found = this.list(skin, "joints", "skins[0].joints");
    if (!found.every((i) => isCount(i) && i < nodes.length)) throw this.bad("skins[0].joints names a node that is not there");
    return found;
  }

  /**
   * A node's place from its parent, with the mean of its scales.
   * @returns {import("./places.js").NodePlace}
   */
  local(node, i) {
    const given = (name, fallback) => {
      const value = node[name] ?? fallback;
      if (!Array.isArray(value) || value.length !== fallback.length || !value.every(Number.isFinite)) {
        throw this.bad(`nodes[${i}].${name} is odd`);
      }
      return value;
    };
    if (node.matrix) return splitMatrix(given("matrix", new Array(16).fill(0)));
    const scale = given("scale", [1, 1, 1]);
    return { translation: given("translation", [0, 0, 0]), rotation: Quat.unit(given("rotation", [0, 0, 0, 1])),
      scale: (scale[0] + scale[1] + scale[2]) / 3 };
  }

  // What an animation moves, and its end, s.
  tracks(animation, where, { index }) {
    const tracks = new Map(), samplers = this.list(animation, "samplers", `${where}.samplers`);
    let end = 0;
    for (const channel of this.list(animation, "channels", `${where}.channels`)) {
      const { node, path } = isTable(channel) && isTable(channel.target) ? channel.target : {}, at = index.get(node);
      if (at === undefined || !["translation", "rotation"].includes(path)) continue;
      const { input, output, interpolation: how } = this.entry(samplers, channel.sampler, `${where}.samplers`);
      const times = this.times(input, where), values = this.numbers(output, path === "rotation" ? 4 : 3);
      if (values.count !== times.count * (how === "CUBICSPLINE" ? 3 : 1)) {
        throw this.bad(`${where} has a sampler whose times and values do not fit`);
      }
      end = Math.max(end, times.data.at(-1));
      tracks.set(`${at} ${path}`, { at, path, times: times.data, values, how });
    }
    if (!tracks.size) throw this.bad(`${where} turns no joint of its skeleton`);
    return { tracks: [...tracks.values()], end };
  }

  // Turns and places of all joints, GLTF_RATE times a second.
  sample(tracks, frames, { local, parents, names, rest: [turns, places] }) {
    const pose = local.map((node) => ({ ...node })), source = new MotionSource(GLTF_RATE, frames, names, parents, turns, places);
    for (let t = 0; t < frames; t++) {
      for (const track of tracks) pose[track.at][track.path] = sampleTrack(track, t / GLTF_RATE);
      placeNodes(pose, parents).forEach(({ turn, place }, j) => source.set(t, j, turn, place));
    }
    return source;
  }

  /**
   * World turns and places of the rest pose; a bind pose is scaled to the size of the nodes.
   * @param {Object<string, any> | null} skin
   * @param {number[]} joints the skin's, as places in the skeleton
   * @param {import("./places.js").NodePlace[]} local
   * @param {number[]} parents
   * @returns {[number[][], number[][]]}
   */
  rest(skin, joints, local, parents) {
    const standing = placeNodes(local, parents), turns = standing.map((s) => s.turn), places = standing.map((s) => s.place);
    if (!skin || skin.inverseBindMatrices === undefined) return [turns, places];
    const matrices = this.numbers(skin.inverseBindMatrices, 16);
    if (matrices.count < joints.length) throw this.bad("its skin has fewer bind matrices than joints");
    const bind = joints.map((_, k) => splitMatrix(rowOf(matrices, k)));
    let ours = 0, theirs = 0;
    const bound = new Map(joints.map((j, k) => {
      const turn = Quat.inverse(bind[k].rotation);
      return [j, { turn, place: Quat.rotate(turn, Vec.times(bind[k].translation, -1 / bind[k].scale)) }];
    }));
    for (const [j, { place }] of bound) {
      const parent = bound.get(parents[j]);
      if (!parent) continue;
      ours += Vec.length(Vec.minus(places[j], places[parents[j]]));
      theirs += Vec.length(Vec.minus(place, parent.place));
    }
    for (const [j, { turn, place }] of bound) {
      turns[j] = turn;
      places[j] = Vec.times(place, theirs > 1e-9 ? ours / theirs : 1);
    }
    return [turns, places];
  }
}

// Whole and not below 0.
const isCount = (value) => Number.isInteger(value) && value >= 0;

// An upper bound of the values in a JSON text: each but the first has one of these before it.
function countParts(text) {
  let count = 0;
  for (let i = 0; i < text.length; i++) count += text[i] === 0x2c || text[i] === 0x5b || text[i] === 0x7b ? 1 : 0;
  return count;
}

/** @param {Rows} rows */
const rowOf = ({ data, width }, k) => Array.from(data.subarray(k * width, (k + 1) * width));

/**
 * Of a column-major 4x4 matrix, with the mean of its scales.
 * @returns {import("./places.js").NodePlace}
 */
function splitMatrix(m) {
  const columns = [0, 4, 8].map((o) => m.slice(o, o + 3)), lengths = columns.map(Vec.length);
  const x = Vec.unit(columns[0]), z = Vec.unit(Vec.cross(x, columns[1])), y = Vec.cross(z, x);
  const scale = (lengths[0] + lengths[1] + lengths[2]) / 3 || 1;
  return { translation: m.slice(12, 15), rotation: Quat.fromColumns(x, y, z), scale };
}

// The value of a track at a time, s: a step, linear, or a cubic spline as glTF 2.0 has it.
function sampleTrack({ path, times, values, how }, seconds) {
  const cubic = how === "CUBICSPLINE", value = (k) => rowOf(values, cubic ? 3 * k + 1 : k), last = times.length - 1;
  const finish = (v) => (path === "rotation" ? Quat.unit(v) : v);
  if (seconds <= times[0]) return finish(value(0));
  if (seconds >= times[last]) return finish(value(last));
  let low = 0, high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= seconds) low = middle;
    else high = middle;
  }
  if (how === "STEP") return finish(value(low));
  const length = times[high] - times[low], t = (seconds - times[low]) / length;
  if (!cubic && path === "rotation") return Quat.mix(value(low), value(high), t);
  if (!cubic) return value(low).map((v, i) => v + t * (value(high)[i] - v));
  const t2 = t * t, t3 = t2 * t, leaving = rowOf(values, 3 * low + 2), arriving = rowOf(values, 3 * high);
  return finish(value(low).map((v, i) => (2 * t3 - 3 * t2 + 1) * v + (t3 - 2 * t2 + t) * length * leaving[i]
    + (3 * t2 - 2 * t3) * value(high)[i] + (t3 - t2) * length * arriving[i]));
}

// Reads the animations of a glTF 2.0 file: .glb, or .gltf with its buffers inside or beside it. The rest pose is the skin's bind
// pose where there is one, else that of the nodes. An error names the file and the part.

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
    try {
      this.document = JSON.parse(new TextDecoder().decode(text));
    } catch (e) {
      throw this.bad("it is not glTF: its JSON does not parse");
    }
    if (!isTable(this.document) || !isTable(this.document.asset)) throw this.bad("it is not glTF: `asset` is missing");
    this.buffers = new Map();
  }

  bad(why) {
    return new MotionError(`${this.where}: ${why}`);
  }

  // Entry i of a list of the document.
  entry(list, i) {
    const found = Array.isArray(this.document[list]) ? this.document[list][i] : undefined;
    if (!isTable(found)) throw this.bad(`${list}[${i}] is missing`);
    return found;
  }

  buffer(i) {
    if (!this.buffers.has(i)) this.buffers.set(i, this.loadBuffer(i));
    return this.buffers.get(i);
  }

  loadBuffer(i) {
    const { uri } = this.entry("buffers", i);
    if (uri === undefined && this.chunk) return this.chunk;
    if (typeof uri !== "string") throw this.bad(`buffers[${i}] has no content`);
    const inside = uri.match(/^data:[^,]*;base64,/);
    if (inside) {
      try {
        return Uint8Array.from(atob(uri.slice(inside[0].length)), (c) => c.charCodeAt(0));
      } catch (e) {
        throw this.bad(`buffers[${i}] is not base64`);
      }
    }
    const name = decodeURIComponent(uri).split("/").at(-1);
    if (!Object.hasOwn(this.beside, name)) throw this.bad(`it needs ${name}; drop both files together`);
    return this.beside[name];
  }

  // Rows of numbers of an accessor; `normalized` integers become -1..1.
  numbers(i, width) {
    const accessor = this.entry("accessors", i);
    const { count, componentType, type, bufferView, byteOffset = 0, normalized } = accessor;
    const Type = GLTF_TYPES[componentType];
    if (!Type || GLTF_WIDTHS[type] !== width || !(Number.isInteger(count) && count > 0) || accessor.sparse) {
      throw this.bad(`accessors[${i}] is of a kind that an animation does not have`);
    }
    const { buffer, byteOffset: start = 0, byteStride } = this.entry("bufferViews", bufferView), bytes = this.buffer(buffer);
    const size = Type.BYTES_PER_ELEMENT, stride = byteStride || size * width, first = start + byteOffset;
    if (!(first >= 0 && stride > 0 && first + (count - 1) * stride + size * width <= bytes.length)) {
      throw this.bad(`accessors[${i}] ends after its buffer; was the file cut off?`);
    }
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength), get = `get${Type.name.replace("Array", "")}`;
    const factor = normalized && Type !== Float32Array ? 2 ** (8 * size - (Type.name[0] === "U" ? 0 : 1)) - 1 : 1;
    return Array.from({ length: count }, (_, row) => Array.from({ length: width }, (_, column) => {
      const value = view[get](first + row * stride + column * size, true) / factor;
      if (!Number.isFinite(value)) throw this.bad(`accessors[${i}] is not finite`);
      return value;
    }));
  }

  motions() {
    const animations = this.document.animations || [];
    if (!Array.isArray(animations) || !animations.length) throw this.bad("it holds no animation");
    const skeleton = this.skeleton();
    return animations.map((animation, i) => {
      const name = typeof animation.name === "string" && animation.name ? animation.name : `animation ${i + 1}`;
      return { name, source: this.sampleAnimation(animation, `animations[${i}]`, skeleton) };
    });
  }

  // Nodes of the first skin and all above them, parents first; without a skin all nodes.
  skeleton() {
    const nodes = (this.document.nodes || []).map((_, i) => this.entry("nodes", i)), above = nodes.map(() => -1);
    nodes.forEach((node, i) => (node.children || []).forEach((child) => {
      if (!(child in nodes) || above[child] >= 0) throw this.bad(`nodes[${i}] has a child that is not there or has another parent`);
      above[child] = i;
    }));
    const order = [], seen = new Set(), skin = Array.isArray(this.document.skins) ? this.entry("skins", 0) : null;
    const visit = (i, depth) => {
      if (!(i in nodes) || depth > 1000) throw this.bad("its nodes are not a tree");
      if (seen.has(i)) return;
      if (above[i] >= 0) visit(above[i], depth + 1);
      seen.add(i);
      order.push(i);
    };
    for (const i of skin ? skin.joints : nodes.keys()) visit(i, 0);
    if (!order.length) throw this.bad("it holds no skeleton");
    const local = order.map((i) => this.local(nodes[i], i));
    return { order, skin, local, parents: order.map((i) => order.indexOf(above[i])),
      names: order.map((i) => String(nodes[i].name ?? `node ${i}`)) };
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

  // Turns and places of all joints, GLTF_RATE times a second.
  sampleAnimation(animation, where, { order, skin, local, parents, names }) {
    const tracks = [];
    let end = 0;
    for (const channel of Array.isArray(animation.channels) ? animation.channels : []) {
      const at = order.indexOf(channel.target?.node), path = channel.target?.path;
      if (at < 0 || !["translation", "rotation"].includes(path)) continue;
      const sampler = (animation.samplers || [])[channel.sampler];
      if (!isTable(sampler)) throw this.bad(`${where} has a channel without its sampler`);
      const times = this.numbers(sampler.input, 1).map(([t]) => t);
      const values = this.numbers(sampler.output, path === "rotation" ? 4 : 3);
      const cubic = sampler.interpolation === "CUBICSPLINE";
      if (values.length !== times.length * (cubic ? 3 : 1) || times.some((t, k) => k && t < times[k - 1])) {
        throw this.bad(`${where} has a sampler whose times and values do not fit`);
      }
      end = Math.max(end, times.at(-1));
      tracks.push({ at, path, times, values, how: sampler.interpolation });
    }
    if (!tracks.length) throw this.bad(`${where} turns no joint of its skeleton`);
    const frames = Math.max(1, Math.floor(end * GLTF_RATE + 1e-6) + 1), pose = local.map((node) => ({ ...node }));
    const [restTurns, restPlaces] = this.rest(order, skin, local, parents);
    const source = new MotionSource(GLTF_RATE, frames, names, parents, restTurns, restPlaces);
    for (let t = 0; t < frames; t++) {
      for (const track of tracks) pose[track.at][track.path] = sampleTrack(track, t / GLTF_RATE);
      placeNodes(pose, parents).forEach(({ turn, place }, j) => source.set(t, j, turn, place));
    }
    return source;
  }

  // World turns and places of the rest pose; a bind pose is scaled to the size of the nodes.
  rest(order, skin, local, parents) {
    const standing = placeNodes(local, parents), turns = standing.map((s) => s.turn), places = standing.map((s) => s.place);
    if (!skin || skin.inverseBindMatrices === undefined) return [turns, places];
    const bind = this.numbers(skin.inverseBindMatrices, 16).map((m) => splitMatrix(m));
    const joints = skin.joints.map((i) => order.indexOf(i));
    if (bind.length < joints.length) throw this.bad("its skin has fewer bind matrices than joints");
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
  const cubic = how === "CUBICSPLINE", value = (k) => values[cubic ? 3 * k + 1 : k], last = times.length - 1;
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
  const t2 = t * t, t3 = t2 * t, leaving = values[3 * low + 2], arriving = values[3 * high];
  return finish(value(low).map((v, i) => (2 * t3 - 3 * t2 + 1) * v + (t3 - 2 * t2 + t) * length * leaving[i]
    + (3 * t2 - 2 * t3) * value(high)[i] + (t3 - t2) * length * arriving[i]));
}

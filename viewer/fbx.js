// Reads the animations of a binary FBX file, as Mixamo gives it, as avatar/motion/fbx.py does. The rest pose is that of the nodes
// without an animation. An error names the file.

import { FbxCurve } from "./fbx_curve.js";
import { FbxFile } from "./fbx_file.js";
import { MotionError, MotionSource } from "./motion.js";
import { placeNodes } from "./places.js";
import { Quat, Vec } from "./quat.js";

// Animations are sampled at this rate, frames a second.
const FBX_RATE = 30;
const FBX_TICKS = 46186158000, FBX_NEW_TICKS = 141120000, FBX_OLD_TIME = 127;
const FBX_BONES = ["LimbNode", "Limb", "Root"];
const FBX_AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };
// By the number that a file has for it, the axes in the order in which a joint turns about them; 6 is not in use.
const FBX_ORDERS = ["xyz", "xzy", "yzx", "yxz", "zxy", "zyx", "xyz"];
const FBX_CHANNELS = ["d|X", "d|Y", "d|Z"];
const FBX_TRACKS = ["Lcl Translation", "Lcl Rotation", "Lcl Scaling"];
// Connections that are followed.
const FBX_MOST_STEPS = 4e6;
// Beyond it sums and products say nothing any more.
const FBX_LARGEST = 1e9;

/** @typedef {{still: number[], moved: {joint: number, track: number}[]}} Mover */

/**
 * @param {Uint8Array} bytes
 * @param {string} where the file's name, for errors
 * @returns {Promise<{name: string, source: MotionSource}[]>} one for each animation, the longest first
 */
export async function readFbx(bytes, where) {
  return new FbxReader(new FbxFile(bytes, where), where).motions();
}

// Children of that name.
const childrenOf = (node, name) => (node ? node.children.filter((child) => child.name === name) : []);

// The number of the first child of that name, if it is there.
function numberOf(node, name) {
  const value = childrenOf(node, name)[0]?.values[0];
  return value === undefined ? undefined : Number(value);
}

// An object's name without its class, which stands after it.
const plainLabel = (value) => String(value ?? "").split("\0")[0];

/**
 * The properties of a node: name -> values.
 * @returns {Map<string, any[]>}
 */
function propertiesOf(node) {
  return new Map(childrenOf(node, "Properties70").flatMap((list) => childrenOf(list, "P"))
    .map(({ values }) => [String(values[0]), values.slice(4).map(Number)]));
}

class FbxReader {
  /**
   * @param {FbxFile} file
   * @param {string} where
   */
  constructor(file, where) {
    this.file = file;
    this.where = where;
    const [head] = childrenOf(file.root, "FBXHeaderExtension"), version = numberOf(head, "FBXHeaderVersion");
    const time = numberOf(childrenOf(head, "OtherFlags")[0], "TCDefinition") ?? FBX_OLD_TIME;
    this.ticks = version >= 1004 && time !== FBX_OLD_TIME ? FBX_NEW_TICKS : FBX_TICKS;
    // Objects by id, as text, and what is connected below each: {id, at}, where `at` is the property that it moves.
    /** @type {Map<string, import("./fbx_file.js").FbxNode>} */
    this.objects = new Map();
    for (const part of childrenOf(file.root, "Objects")) {
      for (const node of part.children) this.objects.set(String(node.values[0]), node);
    }
    this.steps = 0;
    /** @type {Map<string, FbxCurve | null>} */
    this.curves = new Map();
    /** @type {Map<string, {id: string, at: string}[]>} */
    this.below = new Map();
    for (const { values } of childrenOf(file.root, "Connections").flatMap((part) => childrenOf(part, "C"))) {
      const above = String(values[2]), one = { id: String(values[1]), at: String(values[3] ?? "") };
      if (this.below.has(above)) this.below.get(above).push(one);
      else this.below.set(above, [one]);
    }
    this.defaults = propertiesOf(childrenOf(file.root, "Definitions").flatMap((part) => childrenOf(part, "ObjectType"))
      .filter((type) => type.values[0] === "Model").flatMap((type) => childrenOf(type, "PropertyTemplate"))[0]);
  }

  bad(why) {
    return new MotionError(`${this.where}: ${why}`);
  }

  // What is connected below an object, of that kind: {id, at, node}.
  connected(above, kind) {
    const all = this.below.get(above) || [];
    this.follow(all.length);
    return all.map(({ id, at }) => ({ id, at, node: this.objects.get(id) })).filter(({ node }) => node?.name === kind);
  }

  // Counts connections that are followed, which a small file can make many of.
  follow(more) {
    this.steps += more;
    if (this.steps > FBX_MOST_STEPS) throw this.bad("its objects have more connections than this page follows");
  }

  async motions() {
    const stacks = [...this.objects].filter(([, node]) => node.name === "AnimationStack");
    if (!stacks.length) throw this.bad("it holds no animation");
    if (stacks.length > MotionSource.MOST_MOTIONS) {
      throw this.bad(`it holds ${stacks.length} animations; at most ${MotionSource.MOST_MOTIONS} are taken`);
    }
    const joints = this.joints(), movers = this.movers(joints), found = [];
    let total = 0;
    for (const [id, node] of stacks) {
      const label = plainLabel(node.values[1]), tracks = await this.tracks(id, label, movers);
      if (!tracks.length) continue;
      const { begin, frames } = this.span(node);
      total += frames;
      const refused = MotionSource.refuse(total, joints.length);
      if (refused) throw this.bad(refused);
      found.push({ name: label, begin, frames, tracks });
    }
    if (!found.length) throw this.bad("it holds no animation that moves a joint");
    found.sort((a, b) => b.frames - a.frames);
    const alone = found.length === 1 ? this.where.replace(/\.[^.]*$/, "") : "";
    return found.map((one) => ({ name: alone || one.name || "animation", source: this.sample(joints, one) }));
  }

  // Bones and all nodes above them, parents first; without a bone all nodes: {id, name, parent, place}.
  joints() {
    const above = new Map(), bones = new Set(), models = [...this.objects].filter(([, node]) => node.name === "Model");
    for (const [id] of models) {
      for (const one of this.connected(id, "Model")) above.set(one.id, id);
      if (this.connected(id, "NodeAttribute").some(({ node }) => FBX_BONES.includes(node.values[2]))) bones.add(id);
    }
    const out = [], index = new Map();
    for (const [id] of models.filter(([one]) => !bones.size || bones.has(one))) {
      const line = [];
      for (let at = id; at !== undefined && !index.has(at); at = above.get(at)) {
        if (line.length > 1000) throw this.bad("its nodes are not a tree");
        line.unshift(at);
      }
      for (const at of line) {
        const node = this.objects.get(at);
        index.set(at, out.length);
        out.push({ id: at, name: plainLabel(node.values[1]), parent: index.get(above.get(at)) ?? -1,
          place: new FbxPlace(propertiesOf(node), this.defaults) });
      }
    }
    const refused = MotionSource.refuse(1, out.length);
    if (!out.length) throw this.bad("it holds no skeleton");
    if (refused) throw this.bad(refused);
    return out;
  }

  // Where an animation begins, s, and its frames.
  span(node) {
    const given = propertiesOf(node), span = given.has("LocalStart") && given.has("LocalStop") ? "Local" : "Reference";
    const [begin, end] = ["Start", "Stop"].map((side) => (given.get(span + side)?.[0] ?? 0) / this.ticks);
    return { begin, frames: Math.max(1, Math.floor((end - begin) * FBX_RATE + 1e-6) + 1) };
  }

  /**
   * What each curve node moves, joints and which of FBX_TRACKS, and to where without a curve: its id -> that.
   * @returns {Map<string, Mover>}
   */
  movers(joints) {
    const out = new Map();
    joints.forEach(({ id }, joint) => {
      for (const { id: mover, at, node } of this.connected(id, "AnimationCurveNode")) {
        if (!FBX_TRACKS.includes(at)) continue;
        if (!out.has(mover)) {
          const given = propertiesOf(node);
          out.set(mover, { still: FBX_CHANNELS.map((channel) => given.get(channel)?.[0] ?? 0), moved: [] });
        }
        out.get(mover).moved.push({ joint, track: FBX_TRACKS.indexOf(at) });
      }
    });
    return out;
  }

  /**
   * What an animation moves: joint, which of FBX_TRACKS, its value where a curve is missing, and the curves of x, y and z.
   * @param {string} id the animation's
   * @param {string} label its name, for errors
   * @param {Map<string, Mover>} movers
   */
  async tracks(id, label, movers) {
    const out = new Map(), layers = new Set();
    for (const layer of this.connected(id, "AnimationLayer")) {
      for (const mover of this.connected(layer.id, "AnimationCurveNode").filter((one) => movers.has(one.id))) {
        const { still, moved } = movers.get(mover.id), curves = [null, null, null];
        for (const one of this.connected(mover.id, "AnimationCurve").filter(({ at }) => FBX_CHANNELS.includes(at))) {
          curves[FBX_CHANNELS.indexOf(one.at)] = await this.curve(one);
        }
        layers.add(layer.id);
        this.follow(moved.length);
        for (const { joint, track } of moved) out.set(3 * joint + track, { joint, track, still, curves });
      }
    }
    if (layers.size > 1) throw this.bad(`${label} is mixed from ${layers.size} layers; bake it to one`);
    return [...out.values()];
  }

  /** @returns {Promise<FbxCurve | null>} null without a key */
  async curve({ id, node }) {
    if (!this.curves.has(id)) this.curves.set(id, await this.readCurve(node));
    return this.curves.get(id);
  }

  /** @param {import("./fbx_file.js").FbxNode} node */
  async readCurve(node) {
    const part = (name) => this.file.numbers(childrenOf(node, name)[0]?.values[0]);
    const times = Float64Array.from(await part("KeyTime"), (tick) => tick / this.ticks), values = await part("KeyValueFloat");
    const flags = await part("KeyAttrFlags"), data = await part("KeyAttrDataFloat"), runs = await part("KeyAttrRefCount");
    if (values.length !== times.length || flags.length !== runs.length || data.byteLength !== 16 * runs.length
      || times.some((time, k) => k && time < times[k - 1])) {
      throw this.bad("the keys of a curve do not fit each other");
    }
    const beyond = ["Pre-Extrapolation", "Post-Extrapolation"].map((side) => {
      const [found] = childrenOf(node, side);
      return { how: numberOf(found, "Type") ?? 0, count: numberOf(found, "Repetition") ?? -1 };
    });
    return times.length ? new FbxCurve(times, values, flags, new Float32Array(data.buffer), runs, beyond) : null;
  }

  /**
   * Turns and places of all joints, FBX_RATE times a second.
   * @returns {MotionSource}
   */
  sample(joints, { begin, frames, tracks }) {
    const parents = joints.map(({ parent }) => parent), nodes = joints.map(({ place }) => place);
    const stand = (j, moved) => {
      const { translation, rotation, scale } = nodes[j].at(moved);
      if (![...translation, ...rotation, scale].every((v) => Math.abs(v) <= FBX_LARGEST)) {
        throw this.bad(`${joints[j].name} is somewhere that is not finite, or far too far away`);
      }
      return { translation, rotation, scale };
    };
    const rest = nodes.map((node, j) => stand(j, node.given)), standing = placeNodes(rest, parents);
    const source = new MotionSource(FBX_RATE, frames, joints.map(({ name }) => name), parents, standing.map((s) => s.turn),
      standing.map((s) => s.place));
    const moved = nodes.map((node) => [...node.given]), moving = [...new Set(tracks.map(({ joint }) => joint))], pose = [...rest];
    for (let t = 0; t < frames; t++) {
      for (const { joint, track, still, curves } of tracks) {
        moved[joint][track] = curves.map((curve, axis) => (curve ? curve.at(begin + t / FBX_RATE) : still[axis]));
      }
      for (const j of moving) pose[j] = stand(j, moved[j]);
      placeNodes(pose, parents).forEach(({ turn, place }, j) => source.set(t, j, turn, place));
    }
    return source;
  }
}

// How a node stands to its parent by its properties: moved, then turned and scaled about pivots.
class FbxPlace {
  /**
   * @param {Map<string, number[]>} properties
   * @param {Map<string, number[]>} defaults of properties that the node leaves out
   */
  constructor(properties, defaults) {
    const find = (name) => properties.get(name) ?? defaults.get(name);
    const triple = (name, fallback = 0) => [0, 1, 2].map((axis) => find(name)?.[axis] ?? fallback);
    this.given = [triple(FBX_TRACKS[0]), triple(FBX_TRACKS[1]), triple(FBX_TRACKS[2], 1)];
    this.order = FBX_ORDERS[find("RotationOrder")?.[0]] ?? FBX_ORDERS[0];
    this.before = eulerTurn(triple("PreRotation"), FBX_ORDERS[0]);
    this.after = Quat.inverse(eulerTurn(triple("PostRotation"), FBX_ORDERS[0]));
    this.turnPivot = triple("RotationPivot");
    this.scalePivot = triple("ScalingPivot");
    this.turnOffset = triple("RotationOffset");
    this.scaleOffset = triple("ScalingOffset");
  }

  /**
   * @param {number[][]} moved place, turn about x, y and z in degrees, and scale
   * @returns {import("./places.js").NodePlace} with the mean of the scales
   */
  at([place, angles, scale]) {
    const rotation = Quat.multiply(this.before, Quat.multiply(eulerTurn(angles, this.order), this.after));
    const scaled = this.scalePivot.map((c, axis) => c - scale[axis] * c + this.scaleOffset[axis] - this.turnPivot[axis]);
    const translation = Vec.add(Vec.add(place, this.turnOffset), Vec.add(this.turnPivot, Quat.rotate(rotation, scaled)));
    return { translation, rotation, scale: (scale[0] + scale[1] + scale[2]) / 3 };
  }
}

// The turn by angles about x, y and z, degrees; order: the axes, the first one turned about first.
function eulerTurn(angles, order) {
  let out = [0, 0, 0, 1];
  for (const axis of order) {
    out = Quat.multiply(Quat.about(FBX_AXES[axis], angles["xyz".indexOf(axis)] * Math.PI / 180), out);
  }
  return out;
}

// Puts a motion of another skeleton on the avatar's joints, by the steps of avatar/motion/retarget.py.

import { matchNames } from "./match_names.js";
import { MotionError } from "./motion.js";
import { Quat, Vec } from "./quat.js";

const SIDE_PREFIXES = ["left_", "right_"];
const NEEDED = SIDE_PREFIXES.flatMap((s) => ["hip", "knee", "shoulder", "elbow"].map((joint) => s + joint));
// Bones that are laid along the source's.
const LIMBS = SIDE_PREFIXES.flatMap((s) => [["hip", "knee"], ["knee", "ankle"], ["shoulder", "elbow"], ["elbow", "wrist"]]
  .map(([a, b]) => [s + a, s + b]));
const FINGERS = ["index", "middle", "pinky", "ring", "thumb"];
const SPINE = ["spine1", "spine2", "spine3"];
// A rest pose is a reference if the mean cosine between its limbs and the T-pose's is at least this: arms that hang give 0.5.
const STANDS = 0.4;
// Frames that are looked at for a reference otherwise.
const REFERENCES = 64;
// An axis of the source's world is up if the torso's mean direction has at least this cosine with it.
const UPRIGHT = 0.7;
// The floor is the lowest place of the feet, but for this share of the frames.
const FLOOR_SHARE = 0.02;

/** @typedef {Object<string, number[]>} Places joint of ours -> point, m */
/** @typedef {Object<string, number>} Found joint of ours -> index of theirs */

/**
 * @param {import("./motion.js").MotionSource} source
 * @param {import("./reader.js").Avatar} avatar
 * @param {string} where the file's name, for errors
 * @returns {import("./reader.js").MotionClip}
 */
export function retarget(source, avatar, where) {
  const { names, parents } = avatar, T = source.frames, J = names.length;
  /** @type {Places} */
  const ours = Object.fromEntries(names.map((name, j) => [name, Array.from(avatar.joints.subarray(j * 3, j * 3 + 3))]));
  const lacking = ["pelvis", ...NEEDED].filter((name) => !names.includes(name));
  if (lacking.length) throw new MotionError(`${where}: this avatar has no joint ${lacking.join(", ")} that a motion could turn`);
  const { found, torso } = matchSkeleton(source, names, where);
  const reference = new Reference(source, found, torso, ours), laid = reference.lay();
  // The world turn of our joint in frame t: `turn` where the source's joint `at` is as in the reference.
  const follow = (t, at, turn) => Quat.multiply(source.turn(t, at), Quat.multiply(Quat.inverse(reference.turns[at]), turn));
  const pelvis = Array.from({ length: T }, (_, t) => follow(t, torso[0], laid.pelvis));
  const upright = uprightTurn(pelvis, reference.up), scale = legScale(source, found, ours), spine = spinePlaces(torso);
  const worldTurn = (t, name) => {
    if (name === "pelvis") return pelvis[t];
    if (SPINE.includes(name)) {
      const { below, above, share } = spine[SPINE.indexOf(name)];
      return Quat.mix(follow(t, below, laid.pelvis), follow(t, above, laid.pelvis), share);
    }
    return Object.hasOwn(found, name) ? follow(t, found[name], laid[name] || laid.pelvis) : null;
  };
  const rotation = new Float32Array(T * J * 3), transl = new Float64Array(T * 3), lowest = new Float64Array(T);
  const feet = names.filter((name) => /_(ankle|foot)$/.test(name)), turns = [], places = {};
  for (let t = 0; t < T; t++) {
    names.forEach((name, j) => {
      const parent = parents[j], above = parent < 0 ? [0, 0, 0, 1] : turns[parent], world = worldTurn(t, name);
      turns[j] = world ? Quat.multiply(upright, world) : above;
      rotation.set(Quat.toAxisAngle(Quat.multiply(Quat.inverse(above), turns[j])), (t * J + j) * 3);
      places[name] = parent < 0 ? ours[name]
        : Vec.add(places[names[parent]], Quat.rotate(turns[parent], Vec.minus(ours[name], ours[names[parent]])));
    });
    const moved = Vec.minus(Vec.times(Quat.rotate(upright, source.place(t, torso[0])), scale), ours.pelvis);
    transl.set(moved, t * 3);
    lowest[t] = Math.min(...feet.map((name) => places[name][1] - ours[name][1])) + moved[1];
  }
  if (!rotation.every(Number.isFinite) || !transl.every(Number.isFinite)) {
    throw new MotionError(`${where}: a joint is somewhere that is not finite, or far too far away`);
  }
  const floor = feet.length ? lowest.sort()[Math.floor(FLOOR_SHARE * T)] : 0;
  return { fps: source.fps, loop: false, joints: names.map((_, j) => j), keys: T, rotation, transl: startAtOrigin(transl, floor) };
}

// Where each joint of our spine lies on their torso: between two of its joints, at a share of the way.
function spinePlaces(torso) {
  return SPINE.map((_, k) => {
    const place = (k + 1) * (torso.length - 1) / SPINE.length;
    const below = Math.min(Math.floor(place + 1e-9), Math.max(torso.length - 2, 0));
    return { below: torso[below], above: torso[Math.min(below + 1, torso.length - 1)], share: place - below };
  });
}

// transl (T, 3) from the first frame's x and z, above the floor.
function startAtOrigin(transl, floor) {
  const [x, , z] = transl, origin = [x, floor, z];
  return Float32Array.from(transl, (value, i) => value - origin[i % 3]);
}

/**
 * Finds our joints, by their names, in theirs; torso: their joints from the hips to the chest.
 * @returns {{found: Found, torso: number[]}}
 */
function matchSkeleton(source, names, where) {
  const found = Object.fromEntries(Object.entries(matchNames(source.names)).filter(([name]) => names.includes(name)));
  const missing = NEEDED.filter((name) => !(name in found));
  if (missing.length) {
    throw new MotionError(`${where}: no joint for ${missing.join(", ")} among the ${source.names.length} of the skeleton `
      + `(${source.names.slice(0, 12).join(", ")} ...); known are the names of Mixamo, CMU, SMPL, VRM, Rigify and Unreal`);
  }
  // The joint and all above it, root first.
  const line = (at) => {
    const out = [];
    for (; at >= 0; at = source.parents[at]) out.unshift(at);
    return out;
  };
  const meeting = (a, b) => {
    const other = line(found[b]), shared = line(found[a]).filter((at, i) => at === other[i]);
    if (!shared.length) throw new MotionError(`${where}: ${a} and ${b} belong to two skeletons; one is expected`);
    return shared;
  };
  const below = meeting("left_hip", "right_hip"), above = meeting("left_shoulder", "right_shoulder"), hips = below.at(-1);
  const torso = above.includes(hips) ? above.slice(above.indexOf(hips)) : [hips, ...above.filter((at) => !below.includes(at))];
  return { found, torso };
}

// The pose in which the skeletons are laid on each other: their turns and places, and the axis that is up there.
class Reference {
  /**
   * @param {import("./motion.js").MotionSource} source
   * @param {Found} found
   * @param {number[]} torso
   * @param {Places} ours
   */
  constructor(source, found, torso, ours) {
    this.found = found;
    this.torso = torso;
    this.ours = ours;
    this.turns = source.restTurns;
    this.places = source.restPlaces;
    if (this.likeness(source.restPlaces) < STANDS) {
      const count = Math.min(REFERENCES, source.frames);
      const frames = Array.from({ length: count }, (_, k) => Math.trunc(k * (source.frames - 1) / Math.max(count - 1, 1)));
      const likeness = frames.map((t) => this.likeness(source.places(t)));
      const best = frames[likeness.indexOf(Math.max(...likeness))];
      this.turns = source.turns(best);
      this.places = source.places(best);
    }
    this.up = this.standing(this.places).up;
  }

  // Mean cosine between the limbs and those of the T-pose.
  likeness(places) {
    const { found, ours } = this, turn = this.standing(places).turn;
    const bones = LIMBS.filter(([a, b]) => a in found && b in found).map(([a, b]) => Vec.dot(
      Vec.unit(Vec.minus(places[found[b]], places[found[a]])), Vec.unit(Quat.rotate(turn, Vec.minus(ours[b], ours[a])))));
    return bones.reduce((sum, c) => sum + c, 0) / bones.length;
  }

  // The turn from our axes to those of an upright person in these places, and the axis that is up there.
  standing(places) {
    const { found, torso, ours } = this, top = found.head ?? found.neck ?? torso.at(-1);
    const rise = Vec.minus(places[top], places[torso[0]]), size = rise.map(Math.abs), axis = size.indexOf(Math.max(...size));
    const up = [0, 1, 2].map((i) => (i === axis ? (rise[axis] >= 0 ? 1 : -1) : 0));
    const theirs = facing((name) => places[found[name]], up);
    return { turn: Quat.multiply(theirs, Quat.inverse(facing((name) => ours[name], [0, 1, 0]))), up };
  }

  // Our bone from a to b and theirs, or null.
  bone(a, b) {
    const { found, ours, places } = this;
    return a in found && b in found && a in ours && b in ours
      ? [Vec.minus(ours[b], ours[a]), Vec.minus(places[found[b]], places[found[a]])] : null;
  }

  // Turns `start` by the smallest turn that lays our bone from a to b on theirs.
  layAlong(a, b, start) {
    const bone = this.bone(a, b);
    if (!bone || Vec.length(bone[1]) <= 1e-9) return start;
    return Quat.multiply(Quat.between(Quat.rotate(start, bone[0]), bone[1]), start);
  }

  // Turns `start` about an axis until our bone is as near to theirs as it gets.
  turnAbout(start, axis, a, b) {
    const bone = this.bone(a, b);
    if (!bone || Vec.length(axis) < 1e-9) return start;
    axis = Vec.unit(axis);
    const here = Vec.across(Quat.rotate(start, bone[0]), axis), there = Vec.across(bone[1], axis);
    if (Math.min(Vec.length(here), Vec.length(there)) < 1e-9) return start;
    return Quat.multiply(Quat.about(axis, Math.atan2(Vec.dot(Vec.cross(here, there), axis), Vec.dot(here, there))), start);
  }

  // Turns of our joints in the source's world, as the reference pose has them; those without one are the pelvis's.
  lay() {
    const standing = this.standing(this.places).turn, laid = { pelvis: standing };
    for (const s of SIDE_PREFIXES) {
      laid[`${s}hip`] = this.layAlong(`${s}hip`, `${s}knee`, standing);
      laid[`${s}knee`] = this.layAlong(`${s}knee`, `${s}ankle`, laid[`${s}hip`]);
      laid[`${s}ankle`] = laid[`${s}foot`] = this.turnAbout(standing, this.up, `${s}ankle`, `${s}foot`);
      laid[`${s}shoulder`] = this.layAlong(`${s}shoulder`, `${s}elbow`, standing);
      laid[`${s}elbow`] = this.layAlong(`${s}elbow`, `${s}wrist`, laid[`${s}shoulder`]);
      laid[`${s}wrist`] = this.layAlong(`${s}wrist`, `${s}middle1`, laid[`${s}elbow`]);
      const palm = this.bone(`${s}wrist`, `${s}middle1`);
      if (palm) laid[`${s}wrist`] = this.turnAbout(laid[`${s}wrist`], palm[1], `${s}pinky1`, `${s}index1`);
      for (const finger of FINGERS) {
        const name = s + finger;
        laid[`${name}1`] = this.layAlong(`${name}1`, `${name}2`, laid[`${s}wrist`]);
        laid[`${name}2`] = this.layAlong(`${name}2`, `${name}3`, laid[`${name}1`]);
        laid[`${name}3`] = laid[`${name}2`];
      }
    }
    return laid;
  }
}

// The turn that takes x to the person's left and y to up; place: name -> point.
function facing(place, up) {
  let left = Vec.across(Vec.add(Vec.minus(place("left_hip"), place("right_hip")),
    Vec.minus(place("left_shoulder"), place("right_shoulder"))), up);
  if (Vec.length(left) < 1e-9) left = [up[2], up[0], up[1]];
  left = Vec.unit(left);
  return Quat.fromColumns(left, up, Vec.cross(left, up));
}

// The turn from the source's world to ours; pelvis: its turns in all frames.
function uprightTurn(pelvis, up) {
  const mean = pelvis.reduce((sum, q) => Vec.add(sum, Quat.rotate(q, [0, 1, 0])), [0, 0, 0]).map((c) => c / pelvis.length);
  const size = mean.map(Math.abs), axis = size.indexOf(Math.max(...size));
  if (size[axis] >= UPRIGHT) up = [0, 1, 2].map((i) => (i === axis ? Math.sign(mean[axis]) : 0));
  let left = Vec.across(Quat.rotate(pelvis[0], [1, 0, 0]), up);
  if (Vec.length(left) < 0.3) left = Vec.cross(up, Quat.rotate(pelvis[0], [0, 0, 1]));
  left = Vec.unit(left);
  return Quat.inverse(Quat.fromColumns(left, up, Vec.cross(left, up)));
}

// Our legs' length over theirs.
function legScale(source, found, ours) {
  const legs = LIMBS.filter(([a, b]) => a in found && b in found && /hip|knee/.test(a));
  const sum = (bone) => legs.reduce((total, [a, b]) => total + Vec.length(bone(a, b)), 0);
  return sum((a, b) => Vec.minus(ours[b], ours[a]))
    / Math.max(sum((a, b) => Vec.minus(source.restPlaces[found[b]], source.restPlaces[found[a]])), 1e-12);
}

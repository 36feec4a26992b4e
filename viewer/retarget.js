// A motion of another skeleton on the avatar's joints: the steps of avatar/motion/retarget.py, one by one.

import { matchNames } from "./match_names.js";
import { MotionError } from "./motion.js";
import { Quat, Vec } from "./quat.js";

const SIDE_PREFIXES = ["left_", "right_"];
const NEEDED = SIDE_PREFIXES.flatMap((s) => ["hip", "knee", "shoulder", "elbow"].map((joint) => s + joint));
const LIMBS = SIDE_PREFIXES.flatMap((s) => [["hip", "knee"], ["knee", "ankle"], ["shoulder", "elbow"], ["elbow", "wrist"]]
  .map(([a, b]) => [s + a, s + b]));
const HAND = ["index", "middle", "pinky", "ring", "thumb"];
const SPINE = ["spine1", "spine2", "spine3"];
const STANDS = 0.4;
const REFERENCES = 64;
const UPRIGHT = 0.7;
const FLOOR_SHARE = 0.02;

// source: MotionSource; avatar: as readAvatar gives it. Returns a clip for avatar.clips.
export function retarget(source, avatar, where) {
  const ours = Object.fromEntries(avatar.names.map((name, j) => [name, Array.from(avatar.joints.subarray(j * 3, j * 3 + 3))]));
  const { found, torso } = matchSkeleton(source, where);
  const reference = new Reference(source, found, torso, ours);
  const laid = reference.lay(), T = source.frames, J = avatar.names.length;
  const followed = (t, at, turn) => Quat.multiply(source.turn(t, at), Quat.multiply(Quat.inverse(reference.turns[at]), turn));
  const pelvis = (t) => followed(t, torso[0], laid.pelvis);
  const upright = uprightTurn(Array.from({ length: T }, (_, t) => pelvis(t)), reference.up);
  const spineAt = SPINE.map((_, k) => {
    const place = (k + 1) * (torso.length - 1) / SPINE.length;
    const below = Math.min(Math.floor(place + 1e-9), Math.max(torso.length - 2, 0));
    return [torso[below], torso[Math.min(below + 1, torso.length - 1)], place - below];
  });
  const scale = legScale(source, found, ours);
  const rotation = new Float32Array(T * J * 3), transl = new Float64Array(T * 3), lowest = [];
  const rootOfOurs = ours.pelvis, feet = avatar.names.flatMap((name, j) => (/_(ankle|foot)$/.test(name) ? [j] : []));
  const turns = [], places = [];
  for (let t = 0; t < T; t++) {
    avatar.names.forEach((name, j) => {
      const parent = avatar.parents[j], above = parent < 0 ? [0, 0, 0, 1] : turns[parent], k = SPINE.indexOf(name);
      let world = null;
      if (name === "pelvis") world = pelvis(t);
      else if (k >= 0) {
        const [a, b, share] = spineAt[k];
        world = Quat.mix(followed(t, a, laid.pelvis), followed(t, b, laid.pelvis), share);
      } else if (name in found) world = followed(t, found[name], laid[name] || laid.pelvis);
      turns[j] = world ? Quat.multiply(upright, world) : above;
      rotation.set(Quat.toAxisAngle(Quat.multiply(Quat.inverse(above), turns[j])), (t * J + j) * 3);
      places[j] = parent < 0 ? ours[name]
        : Vec.add(places[parent], Quat.rotate(turns[parent], Vec.minus(ours[name], ours[avatar.names[parent]])));
    });
    const moved = Vec.minus(Vec.times(Quat.rotate(upright, source.place(t, torso[0])), scale), rootOfOurs);
    transl.set(moved, t * 3);
    lowest.push(Math.min(...feet.map((j) => places[j][1] - ours[avatar.names[j]][1])) + moved[1]);
  }
  const [x, , z] = transl, floor = feet.length ? lowest.sort((a, b) => a - b)[Math.floor(FLOOR_SHARE * T)] : 0;
  for (let t = 0; t < T; t++) {
    transl[t * 3] -= x;
    transl[t * 3 + 1] -= floor;
    transl[t * 3 + 2] -= z;
  }
  return { fps: source.fps, loop: false, joints: avatar.names.map((_, j) => j), keys: T, rotation, transl: Float32Array.from(transl) };
}

// Our joint -> theirs; their joints of the torso from the hips to the chest.
function matchSkeleton(source, where) {
  const found = matchNames(source.names), missing = NEEDED.filter((name) => !(name in found));
  if (missing.length) {
    throw new MotionError(`${where}: no joint for ${missing.join(", ")} among the ${source.names.length} of the skeleton `
      + `(${source.names.slice(0, 12).join(", ")} ...); known are the names of Mixamo, CMU, SMPL, VRM, Rigify and Unreal`);
  }
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

// The pose in which the skeletons are laid on each other: turns, places of theirs, and their up axis.
class Reference {
  constructor(source, found, torso, ours) {
    Object.assign(this, { found, torso, ours, turns: source.restTurns, places: source.restPlaces });
    if (this.likeness(source.restPlaces) < STANDS) {
      const count = Math.min(REFERENCES, source.frames);
      const frames = Array.from({ length: count }, (_, k) => Math.trunc(k * (source.frames - 1) / Math.max(count - 1, 1)));
      const likeness = frames.map((t) => this.likeness(source.places(t))), best = frames[likeness.indexOf(Math.max(...likeness))];
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

  // Turn from our axes to an upright person's in these places, and the axis that is up there.
  standing(places) {
    const { found, torso, ours } = this, top = found.head ?? found.neck ?? torso.at(-1);
    const rise = Vec.minus(places[top], places[torso[0]]), size = rise.map(Math.abs), axis = size.indexOf(Math.max(...size));
    const up = [0, 1, 2].map((i) => (i === axis ? (rise[axis] >= 0 ? 1 : -1) : 0));
    const theirs = facing((name) => places[found[name]], up);
    return { turn: Quat.multiply(theirs, Quat.inverse(facing((name) => ours[name], [0, 1, 0]))), up };
  }

  bone(a, b) {
    const { found, ours, places } = this;
    return a in found && b in found && a in ours && b in ours
      ? [Vec.minus(ours[b], ours[a]), Vec.minus(places[found[b]], places[found[a]])] : null;
  }

  // `start` turned by the smallest turn that lays our bone from a to b on theirs.
  along(a, b, start) {
    const bone = this.bone(a, b);
    if (!bone || Vec.length(bone[1]) <= 1e-9) return start;
    return Quat.multiply(Quat.between(Quat.rotate(start, bone[0]), bone[1]), start);
  }

  // `start` turned about an axis until our bone lies beside theirs as well as that can be.
  turned(start, axis, a, b) {
    const bone = this.bone(a, b);
    if (!bone || Vec.length(axis) < 1e-9) return start;
    axis = Vec.unit(axis);
    const here = Vec.across(Quat.rotate(start, bone[0]), axis), there = Vec.across(bone[1], axis);
    if (Math.min(Vec.length(here), Vec.length(there)) < 1e-9) return start;
    return Quat.multiply(Quat.about(axis, Math.atan2(Vec.dot(Vec.cross(here, there), axis), Vec.dot(here, there))), start);
  }

  // Turns of our joints in the source's world.
  lay() {
    const standing = this.standing(this.places).turn, laid = { pelvis: standing };
    for (const s of SIDE_PREFIXES) {
      laid[`${s}hip`] = this.along(`${s}hip`, `${s}knee`, standing);
      laid[`${s}knee`] = this.along(`${s}knee`, `${s}ankle`, laid[`${s}hip`]);
      laid[`${s}ankle`] = laid[`${s}foot`] = this.turned(standing, this.up, `${s}ankle`, `${s}foot`);
      laid[`${s}shoulder`] = this.along(`${s}shoulder`, `${s}elbow`, standing);
      laid[`${s}elbow`] = this.along(`${s}elbow`, `${s}wrist`, laid[`${s}shoulder`]);
      laid[`${s}wrist`] = this.along(`${s}wrist`, `${s}middle1`, laid[`${s}elbow`]);
      const palm = this.bone(`${s}wrist`, `${s}middle1`);
      if (palm) laid[`${s}wrist`] = this.turned(laid[`${s}wrist`], palm[1], `${s}pinky1`, `${s}index1`);
      for (const finger of HAND) {
        let start = laid[`${s}wrist`];
        for (const k of [1, 2]) start = laid[`${s}${finger}${k}`] = this.along(`${s}${finger}${k}`, `${s}${finger}${k + 1}`, start);
        laid[`${s}${finger}3`] = start;
      }
    }
    return laid;
  }
}

// The turn that takes x to the person's left, y to up; place: name -> [x, y, z].
function facing(place, up) {
  let left = Vec.across(Vec.add(Vec.minus(place("left_hip"), place("right_hip")),
    Vec.minus(place("left_shoulder"), place("right_shoulder"))), up);
  if (Vec.length(left) < 1e-9) left = [up[2], up[0], up[1]];
  left = Vec.unit(left);
  return Quat.fromColumns(left, up, Vec.cross(left, up));
}

// From the source's world to ours; pelvis: turns over time in the source's world.
function uprightTurn(pelvis, up) {
  const mean = pelvis.reduce((sum, q) => Vec.add(sum, Quat.rotate(q, [0, 1, 0])), [0, 0, 0]).map((c) => c / pelvis.length);
  const size = mean.map(Math.abs), axis = size.indexOf(Math.max(...size));
  if (size[axis] >= UPRIGHT) up = [0, 1, 2].map((i) => (i === axis ? Math.sign(mean[axis]) : 0));
  let left = Vec.across(Quat.rotate(pelvis[0], [1, 0, 0]), up);
  if (Vec.length(left) < 0.3) left = Vec.cross(up, Quat.rotate(pelvis[0], [0, 0, 1]));
  left = Vec.unit(left);
  return Quat.inverse(Quat.fromColumns(left, up, Vec.cross(left, up)));
}

// Our legs' length by theirs.
function legScale(source, found, ours) {
  const legs = LIMBS.filter(([a, b]) => a in found && b in found && /hip|knee/.test(a));
  const sum = (bone) => legs.reduce((total, [a, b]) => total + Vec.length(bone(a, b)), 0);
  return sum((a, b) => Vec.minus(ours[b], ours[a]))
    / Math.max(sum((a, b) => Vec.minus(source.restPlaces[found[b]], source.restPlaces[found[a]])), 1e-12);
}

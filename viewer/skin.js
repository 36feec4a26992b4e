// The skeleton's pose, and linear blend skinning (LBS) of the mesh by it.

import { quatFromAxisAngle, quatMix, quatToMatrix } from "./flat_quat.js";
import { transformPoint } from "./projection.js";

export class Pose {
  /** @param {import("./reader.js").Avatar} avatar */
  constructor(avatar) {
    this.avatar = avatar;
    // (J, 4) xyzw, each joint's turn from its parent; and where the root goes, m.
    this.quats = new Float32Array(avatar.names.length * 4);
    this.transl = new Float32Array(3);
    // Scratch quaternions.
    this.a = new Float32Array(4);
    this.b = new Float32Array(4);
    this.reset();
  }

  // To the T-pose.
  reset() {
    this.quats.fill(0);
    for (let j = 3; j < this.quats.length; j += 4) this.quats[j] = 1;
    this.transl.fill(0);
  }

  // Sets a pose of the file.
  still(name) {
    this.reset();
    for (const [joint, r] of Object.entries(this.avatar.poses[name] || {})) {
      quatFromAxisAngle(this.quats, this.avatar.names.indexOf(joint) * 4, r[0], r[1], r[2]);
    }
  }

  // Sets a place in a clip, s, between its two nearest keys.
  clip(name, seconds) {
    this.reset();
    const clip = this.avatar.clips[name], at = seconds * clip.fps;
    const step = Math.floor(at), t = at - step;
    const place = (k) => clip.loop ? ((k % clip.keys) + clip.keys) % clip.keys : Math.min(Math.max(k, 0), clip.keys - 1);
    const k0 = place(step), k1 = place(step + 1), width = clip.joints.length * 3;
    clip.joints.forEach((joint, n) => {
      const i = k0 * width + n * 3, j = k1 * width + n * 3, r = clip.rotation;
      quatFromAxisAngle(this.a, 0, r[i], r[i + 1], r[i + 2]);
      quatFromAxisAngle(this.b, 0, r[j], r[j + 1], r[j + 2]);
      quatMix(this.quats, joint * 4, this.a, 0, this.b, 0, t);
    });
    for (let i = 0; i < 3; i++) this.transl[i] = clip.transl[k0 * 3 + i] * (1 - t) + clip.transl[k1 * 3 + i] * t;
  }

  // Turns a joint further, in its own frame; x, y, z: axis-angle, rad.
  turn(joint, x, y, z) {
    const q = this.quats, o = joint * 4, ax = q[o], ay = q[o + 1], az = q[o + 2], aw = q[o + 3];
    quatFromAxisAngle(this.b, 0, x, y, z);
    const [bx, by, bz, bw] = this.b;
    q[o] = aw * bx + ax * bw + ay * bz - az * by; q[o + 1] = aw * by - ax * bz + ay * bw + az * bx;
    q[o + 2] = aw * bz + ax * by - ay * bx + az * bw; q[o + 3] = aw * bw - ax * bx - ay * by - az * bz;
  }

  // Mixes another pose (t = 0) with this one (t = 1).
  fadeFrom(other, t) {
    for (let q = 0; q < this.quats.length; q += 4) quatMix(this.quats, q, other.quats, q, this.quats, q, t);
    for (let i = 0; i < 3; i++) this.transl[i] = other.transl[i] * (1 - t) + this.transl[i] * t;
  }

  copy(other) {
    this.quats.set(other.quats);
    this.transl.set(other.transl);
  }
}

export class Skin {
  /** @param {import("./reader.js").Avatar} avatar */
  constructor(avatar) {
    this.avatar = avatar;
    // Of joints.
    this.count = avatar.names.length;
    // (J, 3, 4) [R | t], from the rest place to the posed one.
    this.bones = new Float32Array(avatar.names.length * 12);
    this.local = new Float32Array(9);
    // (J, 12), nine numbers of each joint's rotation less the identity and three zeros, where the avatar has pose correctives.
    this.turns = new Float32Array(avatar.correctives ? avatar.names.length * 12 : 0);
    // (V, 3), m: at rest with the pose's correctives and the expression, and posed.
    this.rest = new Float32Array(avatar.vertices.length);
    this.vertices = new Float32Array(avatar.vertices.length);
  }

  /**
   * Fills this.bones and this.vertices.
   * @param {Pose} pose
   * @param {Object<string, number>} expression weights by name
   */
  update(pose, expression) {
    this.moveBones(pose);
    this.bend(pose);
    const { expressions, start, moved, delta } = this.avatar;
    for (let e = 0; e < expressions.length; e++) {
      const weight = expression[expressions[e]] || 0;
      if (weight === 0) continue;
      for (let i = start[e]; i < start[e + 1]; i++) {
        const v = moved[i] * 3;
        for (let axis = 0; axis < 3; axis++) this.rest[v + axis] += weight * delta[i * 3 + axis];
      }
    }
    this.blend();
  }

  // Fills this.bones.
  moveBones(pose) {
    const { parents, joints } = this.avatar, B = this.bones, L = this.local;
    for (let j = 0; j < parents.length; j++) {
      const o = j * 12, p = parents[j] * 12, jx = joints[j * 3], jy = joints[j * 3 + 1], jz = joints[j * 3 + 2];
      quatToMatrix(L, 0, pose.quats, j * 4);
      for (let r = 0; r < 3; r++) {
        let place;
        if (p < 0) {
          for (let c = 0; c < 3; c++) B[o + r * 4 + c] = L[r * 3 + c];
          place = joints[j * 3 + r] + pose.transl[r];
        } else {
          const x = B[p + r * 4], y = B[p + r * 4 + 1], z = B[p + r * 4 + 2];
          for (let c = 0; c < 3; c++) B[o + r * 4 + c] = x * L[c] + y * L[3 + c] + z * L[6 + c];
          place = x * jx + y * jy + z * jz + B[p + r * 4 + 3];
        }
        B[o + r * 4 + 3] = place - (B[o + r * 4] * jx + B[o + r * 4 + 1] * jy + B[o + r * 4 + 2] * jz);
      }
    }
  }

  // Fills this.turns.
  turn(pose) {
    for (let o = 0, j = 0; o < this.turns.length; o += 12, j += 4) {
      quatToMatrix(this.turns, o, pose.quats, j);
      for (let c = 0; c < 9; c += 4) this.turns[o + c] -= 1;
    }
  }

  // Fills this.rest: the vertices at rest, as the pose's correctives move them.
  bend(pose) {
    const { vertices, correctives } = this.avatar, { rest, turns } = this;
    rest.set(vertices);
    if (!correctives) return;
    this.turn(pose);
    const { start, joint, delta } = correctives;
    for (let v = 0, n = rest.length / 3; v < n; v++) {
      let x = rest[v * 3], y = rest[v * 3 + 1], z = rest[v * 3 + 2];
      for (let i = start[v]; i < start[v + 1]; i++) {
        const t = joint[i] * 12, d = i * 27;
        for (let c = 0; c < 9; c++) {
          const turn = turns[t + c];
          x += delta[d + c] * turn; y += delta[d + 9 + c] * turn; z += delta[d + 18 + c] * turn;
        }
      }
      rest[v * 3] = x; rest[v * 3 + 1] = y; rest[v * 3 + 2] = z;
    }
  }

  // Where this.bones put a joint, m.
  place(joint) {
    return transformPoint(this.bones.subarray(joint * 12, joint * 12 + 12), this.avatar.joints.subarray(joint * 3, joint * 3 + 3));
  }

  // Fills this.vertices from this.rest and this.bones.
  blend() {
    const { skinIndex, skinWeight } = this.avatar, B = this.bones, rest = this.rest, out = this.vertices;
    for (let v = 0, n = out.length / 3; v < n; v++) {
      const x = rest[v * 3], y = rest[v * 3 + 1], z = rest[v * 3 + 2];
      let px = 0, py = 0, pz = 0;
      for (let k = v * 4; k < v * 4 + 4; k++) {
        const w = skinWeight[k];
        if (w === 0) continue;
        const o = skinIndex[k] * 12;
        px += w * (B[o] * x + B[o + 1] * y + B[o + 2] * z + B[o + 3]);
        py += w * (B[o + 4] * x + B[o + 5] * y + B[o + 6] * z + B[o + 7]);
        pz += w * (B[o + 8] * x + B[o + 9] * y + B[o + 10] * z + B[o + 11]);
      }
      out[v * 3] = px; out[v * 3 + 1] = py; out[v * 3 + 2] = pz;
    }
  }
}

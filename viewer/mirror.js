// The user before the camera moves the avatar, as in a mirror: face, head and arms. Nothing leaves this machine.

import { mirrorArms, mirrorFace, mirrorHead } from "./mirror_pose.js";

// Time constants with which the avatar follows, s: the face at once nearly, the limbs more calmly.
const FACE_S = 0.04;
const LIMB_S = 0.1;
// What is not seen for this long goes back to rest, s.
const LOST_S = 0.7;
// Below these a weight, or an angle in degrees, is rest.
const LEAST = 1e-3;

/**
 * Networks of MediaPipe's package `@mediapipe/tasks-vision`, made for running mode VIDEO: a FaceLandmarker with blendshapes and
 * transformation matrixes, and a PoseLandmarker; one of them is enough.
 * @typedef {{face?: any, pose?: any}} Kit
 */

export class Mirror {
  /**
   * @param {import("./viewer.js").Viewer} viewer
   * @param {Kit} kit
   * @param {HTMLVideoElement} video
   */
  constructor(viewer, kit, video) {
    this.viewer = viewer;
    this.kit = kit;
    this.video = video;
    this.ended = false;
    /** @type {(error: Error) => void} called when it cannot go on */
    this.onFail = () => {};
    // What was seen last, and when, ms: weights by expression, and joint -> axis-angle, degrees.
    this.seen = { face: {}, head: {}, arms: {} };
    this.since = { face: -Infinity, arms: -Infinity };
    // The last picture that the networks looked at, by its time, s.
    this.looked = -1;
    // Time of the last step, ms.
    this.last = null;
  }

  /**
   * Asks for the camera and follows it. Rejects where the user or the machine has none to give.
   * @param {import("./viewer.js").Viewer} viewer
   * @param {Kit} kit
   * @param {() => boolean} wanted whether it still is, once the camera is there; null where it is not
   */
  static async start(viewer, kit, wanted) {
    if (!viewer.avatar) throw new Error("no avatar is there yet");
    if (!kit.face && !kit.pose) throw new Error("a mirror needs a FaceLandmarker, a PoseLandmarker, or both");
    if (!navigator.mediaDevices) throw new Error("here the browser gives no camera; serve the page by https or from this machine");
    const stream = await navigator.mediaDevices.getUserMedia({ video: { facingMode: "user", width: 640, height: 480 } });
    const video = Object.assign(document.createElement("video"), { muted: true, playsInline: true, srcObject: stream });
    const mirror = new Mirror(viewer, kit, video);
    for (const track of stream.getTracks()) track.addEventListener("ended", () => mirror.onFail(new Error("the camera is gone")));
    try {
      await video.play();
    } catch (error) {
      mirror.release();
      throw error;
    }
    if (!wanted()) {
      mirror.release();
      return null;
    }
    viewer.choose({ pose: "T" });
    viewer.seek(0);
    mirror.run();
    return mirror;
  }

  // Goes on until `end`.
  run() {
    const frame = (now) => {
      if (this.ended) return;
      try {
        this.step(now);
      } catch (error) {
        this.onFail(error);
      }
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  // Looks at the camera's picture if it is a new one, and moves the avatar; now: ms.
  step(now) {
    const { video, kit, viewer, viewer: { avatar } } = this;
    if (video.currentTime !== this.looked) {
      this.looked = video.currentTime;
      const face = kit.face?.detectForVideo(video, now), pose = kit.pose?.detectForVideo(video, now);
      if (face?.faceBlendshapes?.[0]) {
        this.seen.face = mirrorFace(face.faceBlendshapes[0].categories, avatar.expressions);
        if (face.facialTransformationMatrixes?.[0]) this.seen.head = mirrorHead(face.facialTransformationMatrixes[0].data);
        this.since.face = now;
      }
      const arms = pose?.worldLandmarks?.[0] ? mirrorArms(pose.worldLandmarks[0], avatar) : {};
      if (Object.keys(arms).length) {
        this.seen.arms = arms;
        this.since.arms = now;
      }
    }
    const seconds = this.last === null ? 0 : (now - this.last) / 1000;
    this.last = now;
    const there = (what) => now - this.since[what] < LOST_S * 1000;
    const face = there("face") ? this.seen.face : {}, head = there("face") ? this.seen.head : {};
    viewer.expression = approach(viewer.expression, face, 1 - Math.exp(-seconds / FACE_S));
    viewer.turned = approachTurns(viewer.turned, { ...hangingArms(avatar), ...head, ...there("arms") ? this.seen.arms : {} },
      1 - Math.exp(-seconds / LIMB_S));
  }

  // Gives the camera back.
  release() {
    this.ended = true;
    for (const track of /** @type {MediaStream} */ (this.video.srcObject).getTracks()) track.stop();
  }

  // Gives the camera back; the avatar goes to its A-pose.
  end() {
    this.release();
    this.viewer.expression = {};
    this.viewer.turned = {};
    this.viewer.choose({ pose: Object.hasOwn(this.viewer.avatar.poses, "A") ? "A" : "T" });
  }
}

// Arms of the A-pose, as turns from the T-pose, degrees.
function hangingArms({ poses, names }) {
  const turns = Object.entries(poses.A ?? {}).filter(([joint]) => names.includes(joint));
  return Object.fromEntries(turns.map(([joint, turn]) => [joint, turn.map((x) => x * 180 / Math.PI)]));
}

// Weights on their way to others; share: 0..1 of the way.
function approach(from, to, share) {
  const names = [...new Set([...Object.keys(from), ...Object.keys(to)])];
  const weights = names.map((name) => [name, (from[name] ?? 0) + share * ((to[name] ?? 0) - (from[name] ?? 0))]);
  return Object.fromEntries(weights.filter(([name, weight]) => name in to || Math.abs(weight) > LEAST));
}

// As `approach`, of turns.
function approachTurns(from, to, share) {
  const still = [0, 0, 0], names = [...new Set([...Object.keys(from), ...Object.keys(to)])];
  const turns = names.map((name) => {
    const a = from[name] ?? still, b = to[name] ?? still;
    return [name, a.map((x, i) => x + share * (b[i] - x))];
  });
  return Object.fromEntries(turns.filter(([name, turn]) => name in to || Math.hypot(...turn) > LEAST));
}

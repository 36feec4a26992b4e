// A motion as a file holds it: P joints of some skeleton over T frames, in the file's own axes and units.

// Letters of a sentence about a file, which may quote it.
const MOST_SAID = 600;
// A joint's name is cut after these.
const LONGEST_NAME = 200;

// A motion file that cannot be used; the message names the file and the place in it.
export class MotionError extends Error {
  constructor(message) {
    super(message.length > MOST_SAID ? `${message.slice(0, MOST_SAID)} ...` : message);
  }
}

export class MotionSource {
  // More would fill the page's memory: frames times joints, joints, and motions in a file.
  static MOST = 4e6;
  static MOST_JOINTS = 4000;
  static MOST_MOTIONS = 256;

  /**
   * @param {number} fps
   * @param {number} frames
   * @param {string[]} names [P], parents first
   * @param {number[]} parents [P], -1 for a root
   * @param {number[][]} restTurns [P] quaternions of the rest pose in the file's world
   * @param {number[][]} restPlaces [P] points of the rest pose in the file's world
   */
  constructor(fps, frames, names, parents, restTurns, restPlaces) {
    this.fps = fps;
    this.frames = frames;
    this.names = names.map((name) => name.slice(0, LONGEST_NAME));
    this.parents = parents;
    this.restTurns = restTurns;
    this.restPlaces = restPlaces;
    this.turnData = new Float64Array(frames * names.length * 4);
    this.placeData = new Float64Array(frames * names.length * 3);
  }

  // Why so much is not taken, or nothing.
  static refuse(frames, joints) {
    const fits = frames * joints <= MotionSource.MOST && joints <= MotionSource.MOST_JOINTS;
    return fits ? "" : `${frames} frames of ${joints} joints are more than this page takes`;
  }

  // World turn of joint j in frame t, as a quaternion.
  turn(t, j) {
    const o = (t * this.names.length + j) * 4, d = this.turnData;
    return [d[o], d[o + 1], d[o + 2], d[o + 3]];
  }

  // World place of joint j in frame t.
  place(t, j) {
    const o = (t * this.names.length + j) * 3, d = this.placeData;
    return [d[o], d[o + 1], d[o + 2]];
  }

  set(t, j, turn, place) {
    const at = t * this.names.length + j;
    for (let k = 0; k < 4; k++) this.turnData[at * 4 + k] = turn[k];
    for (let k = 0; k < 3; k++) this.placeData[at * 3 + k] = place[k];
  }

  places(t) {
    return this.names.map((_, j) => this.place(t, j));
  }

  turns(t) {
    return this.names.map((_, j) => this.turn(t, j));
  }
}

// A motion as a file holds it: P joints of some skeleton over T frames, in the file's own axes and units.

// A motion file that cannot be used; the message names the file and the place in it.
export class MotionError extends Error {}

export class MotionSource {
  // A longer motion would fill the page's memory: frames times joints.
  static MOST = 4e6;

  /**
   * @param {number} fps
   * @param {number} frames
   * @param {string[]} names [P], parents first
   * @param {number[]} parents [P], -1 for a root
   * @param {number[][]} restTurns [P] quaternions of the rest pose in the file's world
   * @param {number[][]} restPlaces [P] points of the rest pose in the file's world
   */
  constructor(fps, frames, names, parents, restTurns, restPlaces) {
    if (!(frames * names.length <= MotionSource.MOST)) {
      throw new MotionError(`${frames} frames of ${names.length} joints are more than this page takes`);
    }
    this.fps = fps;
    this.frames = frames;
    this.names = names;
    this.parents = parents;
    this.restTurns = restTurns;
    this.restPlaces = restPlaces;
    this.turnData = new Float64Array(frames * names.length * 4);
    this.placeData = new Float64Array(frames * names.length * 3);
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
    this.turnData.set(turn, (t * this.names.length + j) * 4);
    this.placeData.set(place, (t * this.names.length + j) * 3);
  }

  places(t) {
    return this.names.map((_, j) => this.place(t, j));
  }

  turns(t) {
    return this.names.map((_, j) => this.turn(t, j));
  }
}

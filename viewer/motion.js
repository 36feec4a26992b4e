// A motion as a file has it: P joints of some skeleton over T frames, in its own axes and units; parents come first.
// What is wrong with a file is told by a MotionError that names the file and the place.

export class MotionError extends Error {}

export class MotionSource {
  // parents: [P], -1 for a root; restTurns, restPlaces: [P] of [x, y, z, w] and [x, y, z] in the file's world.
  constructor(fps, frames, names, parents, restTurns, restPlaces) {
    if (!(frames * names.length <= MotionSource.MOST)) {
      throw new MotionError(`${frames} frames of ${names.length} joints are more than this page takes`);
    }
    Object.assign(this, { fps, frames, names, parents, restTurns, restPlaces });
    this.turnData = new Float64Array(frames * names.length * 4);
    this.placeData = new Float64Array(frames * names.length * 3);
  }

  turn(t, j) {
    const o = (t * this.names.length + j) * 4, d = this.turnData;
    return [d[o], d[o + 1], d[o + 2], d[o + 3]];
  }

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
MotionSource.MOST = 4e6;

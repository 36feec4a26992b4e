// Reads Biovision BVH text. The rest pose has all rotations zero. An error names the file and the line.

import { MotionError, MotionSource } from "./motion.js";
import { Quat, Vec } from "./quat.js";

const BVH_CHANNELS = ["xposition", "yposition", "zposition", "xrotation", "yrotation", "zrotation"];
const BVH_AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const BVH_MOST_JOINTS = 1000;
// Of a joint's name.
const BVH_MOST_WORDS = 100;

/**
 * @param {string} text
 * @param {string} where the file's name, for errors
 */
export function readBvh(text, where) {
  return new BvhReader(text, where).read();
}

class BvhReader {
  constructor(text, where) {
    this.where = where;
    this.text = text;
    // Where the next line begins, the number of lines read, and the last one with the place up to which its words are read. One
    // line and one word are held at a time, of which a file may have as many as it has bytes.
    this.at = 0;
    this.line = 0;
    this.row = "";
    this.column = 0;
    this.ends = /\r\n|\r|\n/g;
    this.words = /\S+/g;
    // Of each joint: name, index of the parent, offset from it, and indices into BVH_CHANNELS.
    this.names = [];
    this.parents = [];
    this.offsets = [];
    this.channels = [];
  }

  bad(why) {
    return new MotionError(`${this.where}, line ${this.line}: ${why}`);
  }

  get ended() {
    return this.at > this.text.length;
  }

  // The next line, without spaces around it.
  nextLine() {
    this.ends.lastIndex = this.at;
    const end = this.ends.exec(this.text), row = this.text.slice(this.at, end?.index).trim();
    this.at = end ? this.ends.lastIndex : this.text.length + 1;
    this.line++;
    return row;
  }

  // The next word; with `wanted`, one of them in any case.
  word(...wanted) {
    for (;;) {
      this.words.lastIndex = this.column;
      const found = this.words.exec(this.row)?.[0];
      if (found === undefined) {
        if (this.ended) throw this.bad(`the file ends where ${wanted.join(" or ") || "more"} is expected`);
        this.row = this.nextLine();
        this.column = 0;
        continue;
      }
      this.column = this.words.lastIndex;
      if (wanted.length && !wanted.some((w) => w.toLowerCase() === found.toLowerCase())) {
        throw this.bad(`"${found.slice(0, 40)}" stands where ${wanted.join(" or ")} is expected`);
      }
      return found;
    }
  }

  number() {
    const word = this.word(), value = Number(word);
    if (!Number.isFinite(value)) throw this.bad(`"${word.slice(0, 40)}" stands where a number is expected`);
    return value;
  }

  // Reads the whole file.
  read() {
    this.word("HIERARCHY");
    this.word("ROOT");
    this.joint(-1, 0);
    if (this.word("MOTION", "ROOT").toLowerCase() === "root") throw this.bad("a second ROOT; files with one skeleton are read");
    this.word("Frames:");
    const frames = this.number();
    if (!(Number.isInteger(frames) && frames >= 1)) throw this.bad(`${frames} frames; at least one is expected`);
    this.word("Frame");
    this.word("Time:");
    const seconds = this.number();
    if (!(seconds >= 1e-4 && seconds <= 10)) throw this.bad(`a frame time of ${seconds} s; 0.0001 to 10 is expected`);
    const refused = MotionSource.refuse(frames, this.names.length);
    if (refused) throw this.bad(refused);
    return this.toSource(this.table(frames), 1 / seconds);
  }

  // Reads a joint after its keyword, with all below it.
  joint(parent, depth) {
    const at = this.names.length, name = [];
    if (at >= BVH_MOST_JOINTS || depth > 200) throw this.bad(`more than ${BVH_MOST_JOINTS} joints or 200 generations`);
    for (let word = this.word(); word !== "{"; word = this.word()) {
      if (name.push(word) > BVH_MOST_WORDS) throw this.bad(`a joint's name has more than ${BVH_MOST_WORDS} words`);
    }
    if (!name.length) throw this.bad("a joint without a name");
    this.names.push(name.join(" "));
    this.parents.push(parent);
    this.offsets.push([0, 0, 0]);
    this.channels.push([]);
    for (let word = ""; word !== "}";) {
      word = this.word("OFFSET", "CHANNELS", "JOINT", "End", "}").toLowerCase();
      if (word === "offset") this.offsets[at] = this.triple();
      else if (word === "joint") this.joint(at, depth + 1);
      else if (word === "channels") this.channels[at] = this.channelList();
      else if (word === "end") {
        for (const part of ["Site", "{", "OFFSET"]) this.word(part);
        this.triple();
        this.word("}");
      }
    }
  }

  triple() {
    return [this.number(), this.number(), this.number()];
  }

  channelList() {
    const n = this.number();
    if (![0, 1, 2, 3, 4, 5, 6].includes(n)) throw this.bad(`${n} channels; 0 to 6 are expected`);
    return Array.from({ length: n }, () => {
      const word = this.word(), kind = BVH_CHANNELS.indexOf(word.toLowerCase());
      if (kind < 0) throw this.bad(`"${word.slice(0, 40)}" is not a channel; they are Xposition ... Zrotation`);
      return kind;
    });
  }

  // Reads the motion: a line of numbers for each frame.
  table(frames) {
    const width = this.channels.reduce((sum, c) => sum + c.length, 0), out = [];
    while (!this.ended) {
      const row = this.nextLine();
      if (!row) continue;
      if (out.length >= frames) throw this.bad(`a frame more than the ${frames} that the file says`);
      const values = row.split(/\s+/, width + 1).map(Number), count = values.length > width ? "more" : values.length;
      if (values.length !== width) throw this.bad(`${count} numbers; the skeleton has ${width} channels`);
      if (!values.every(Number.isFinite)) throw this.bad("something other than finite numbers");
      out.push(values);
    }
    if (out.length < frames) throw this.bad(`the file ends after ${out.length} of ${frames} frames; was it cut off?`);
    return out;
  }

  // World places and turns of all joints, from the channels' values in each frame.
  toSource(table, fps) {
    const { names, parents, offsets, channels } = this, rest = [];
    parents.forEach((p, j) => rest.push(p < 0 ? offsets[j] : Vec.add(rest[p], offsets[j])));
    const source = new MotionSource(fps, table.length, names, parents, names.map(() => [0, 0, 0, 1]), rest);
    table.forEach((row, t) => {
      let column = 0;
      parents.forEach((p, j) => {
        const local = [...offsets[j]];
        let turn = [0, 0, 0, 1];
        for (const kind of channels[j]) {
          const value = row[column++];
          if (kind < 3) local[kind] = value;
          else turn = Quat.multiply(turn, Quat.about(BVH_AXES[kind - 3], value * Math.PI / 180));
        }
        if (p < 0) return source.set(t, j, turn, local);
        const above = source.turn(t, p);
        return source.set(t, j, Quat.multiply(above, turn), Vec.add(source.place(t, p), Quat.rotate(above, local)));
      });
    });
    return source;
  }
}

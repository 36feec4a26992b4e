// Reads the tree of a binary FBX file, version 7. An error names the file and the byte.
//
// Of what the file says about its own size nothing is believed: a node lies inside of its parent, a count fits the bytes that are
// there, and an array is unpacked when it is asked for, to the size that it tells.

import { MotionError } from "./motion.js";

const FBX_MAGIC = "Kaydara FBX Binary  \0\x1a\0";
// Nodes below these are read, with all that is in them; a mesh is passed over.
const FBX_PARTS = {
  "": ["FBXHeaderExtension", "Definitions", "Objects", "Connections"],
  Objects: ["Model", "NodeAttribute", "AnimationStack", "AnimationLayer", "AnimationCurveNode", "AnimationCurve"],
};
// Nodes and their values.
const FBX_MOST_PARTS = 2e6;
const FBX_DEEPEST = 32;
// Bytes of all unpacked arrays.
const FBX_MOST_UNPACKED = 128 * 2 ** 20;
// The most that deflate makes of a byte.
const FBX_DEFLATE = 1032;
// Bytes that are unpacked at a time.
const FBX_CHUNK = 2 ** 14;
const FBX_SIZES = { C: 1, B: 1, Y: 2, I: 4, F: 4, L: 8, D: 8 };
const FBX_GETTERS = {
  C: "getUint8", B: "getUint8", Y: "getInt16", I: "getInt32", F: "getFloat32", L: "getBigInt64", D: "getFloat64",
};
const FBX_ITEMS = { f: 4, i: 4, d: 8, l: 8, b: 1, c: 1 };

/** @typedef {{name: string, values: any[], children: FbxNode[]}} FbxNode an L among the values is a BigInt */
/** @typedef {{kind: string, count: number, packed: number, bytes: Uint8Array}} FbxArray */

export class FbxFile {
  /**
   * @param {Uint8Array} bytes
   * @param {string} where the file's name, for errors
   */
  constructor(bytes, where) {
    this.bytes = bytes;
    this.where = where;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.decoder = new TextDecoder();
    if (bytes.length < 27 || this.text(0, FBX_MAGIC.length) !== FBX_MAGIC) {
      const written = /^\s*;|FBXHeaderExtension/.test(this.text(0, Math.min(bytes.length, 4096)));
      throw this.bad(written ? "it is FBX as text; binary FBX is read here, both by `gsac render --motion`" : "it is not FBX");
    }
    this.version = this.view.getUint32(23, true);
    if (!(this.version >= 7000 && this.version < 8000)) {
      throw this.bad(`it is FBX of version ${this.version / 1000}; version 7 is read here, older ones by \`gsac render --motion\``);
    }
    this.wide = this.version >= 7500;
    this.parts = 0;
    this.unpacked = 0;
    this.root = { name: "", values: [], children: this.list(27, bytes.length, "", 0) };
  }

  bad(why) {
    return new MotionError(`${this.where}: ${why}`);
  }

  text(at, length) {
    return this.decoder.decode(this.bytes.subarray(at, at + length));
  }

  /**
   * The nodes from byte `at` to an empty one or to `end`.
   * @returns {FbxNode[]}
   */
  list(at, end, parent, depth) {
    const out = [], size = this.wide ? 8 : 4, head = 3 * size + 1;
    if (depth > FBX_DEEPEST) throw this.bad(`more than ${FBX_DEEPEST} nodes lie in each other`);
    while (at + head <= end) {
      const [next, count, length] = [0, size, 2 * size].map((o) => this.offset(at + o));
      if (next === 0) break;
      const first = at + head + this.bytes[at + head - 1], inner = first + length, name = this.text(at + head, first - at - head);
      if (!(inner <= next && next <= end)) {
        throw this.bad(`the node at byte ${at} ends outside of its parent; was the file cut off?`);
      }
      if (!Object.hasOwn(FBX_PARTS, parent) || FBX_PARTS[parent].includes(name)) {
        this.count();
        out.push({ name, values: this.values(first, inner, count), children: this.list(inner, next, name, depth + 1) });
      }
      at = next;
    }
    return out;
  }

  count() {
    if (++this.parts > FBX_MOST_PARTS) throw this.bad(`more than ${FBX_MOST_PARTS} nodes and values`);
  }

  offset(at) {
    return this.wide ? Number(this.view.getBigUint64(at, true)) : this.view.getUint32(at, true);
  }

  // The `count` values between two bytes.
  values(at, end, count) {
    const out = [], { view } = this;
    const take = (bytes) => {
      if (!(bytes <= end - at)) throw this.bad(`a value at byte ${at} is longer than its node`);
      at += bytes;
      return at - bytes;
    };
    // Ends where `take` does: each value has at least one byte.
    for (let k = 0; k < count; k++) {
      this.count();
      const code = String.fromCharCode(this.bytes[take(1)]);
      if (code in FBX_SIZES) {
        out.push(view[FBX_GETTERS[code]](take(FBX_SIZES[code]), true));
      } else if (code in FBX_ITEMS) {
        const o = take(12), [items, packed, length] = [0, 4, 8].map((more) => view.getUint32(o + more, true)), start = take(length);
        out.push({ kind: code, count: items, packed, bytes: this.bytes.subarray(start, start + length) });
      } else if (code === "S" || code === "R") {
        const length = view.getUint32(take(4), true), start = take(length);
        out.push(code === "S" ? this.text(start, length) : null);
      } else {
        throw this.bad(`a value at byte ${at} is of no known kind`);
      }
    }
    return out;
  }

  /**
   * The numbers of an array; those of kind l as Float64Array.
   * @param {FbxArray | undefined} array
   * @returns {Promise<Float32Array | Float64Array | Int32Array>}
   */
  async numbers(array) {
    const Type = { f: Float32Array, d: Float64Array, i: Int32Array, l: BigInt64Array }[array?.kind];
    if (!Type) throw this.bad("a curve of its animation has no keys");
    const { count, packed, bytes } = array, size = count * FBX_ITEMS[array.kind];
    this.unpacked += size;
    if (packed ? size > FBX_DEFLATE * bytes.length : size !== bytes.length) {
      throw this.bad("a curve's keys are not as many as it says");
    }
    if (this.unpacked > FBX_MOST_UNPACKED) throw this.bad("its curves have more keys than this page takes");
    const raw = packed ? await inflate(bytes, size) : bytes.slice();
    if (!raw) throw this.bad("a curve's keys cannot be unpacked; is the file whole?");
    const numbers = new Type(raw.buffer);
    return numbers instanceof BigInt64Array ? Float64Array.from(numbers, Number) : numbers;
  }
}

// The `size` bytes that were packed by zlib; null where they are other or not so many.
async function inflate(bytes, size) {
  const out = new Uint8Array(size), stream = new DecompressionStream("deflate");
  const reader = stream.readable.getReader(), writer = stream.writable.getWriter();
  const feed = async () => {
    for (let at = 0; at < bytes.length; at += FBX_CHUNK) await writer.write(bytes.subarray(at, at + FBX_CHUNK));
    await writer.close();
  };
  const fed = feed().catch(() => null);
  let filled = 0;
  try {
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      if (filled + part.value.length > size) {
        await reader.cancel();
        return null;
      }
      out.set(part.value, filled);
      filled += part.value.length;
    }
  } catch (error) {
    return null;
  } finally {
    await fed;
  }
  return filled === size ? out : null;
}

// Damages whole files by a seed and lets one of the page's readers read them. Prints, as JSON, what came of it.
//
// node attack_readers.mjs READER COUNT SEED FILE... in the folder of the page's modules; READER is bvh, fbx, gltf or gsac. The
// first file is avatar.gsac, on whose avatar motions are put.

import { readFileSync } from "node:fs";
import { readBvh } from "./bvh.js";
import { GsacError } from "./container.js";
import { readFbx } from "./fbx.js";
import { readGltf } from "./gltf.js";
import { MotionError } from "./motion.js";
import { readAvatar } from "./reader.js";
import { retarget } from "./retarget.js";

const [kind, count, seed, ...paths] = process.argv.slice(2);
const files = paths.map((path) => new Uint8Array(readFileSync(path)));
const decode = (bytes) => new TextDecoder().decode(bytes), encode = (text) => new TextEncoder().encode(text);
const concat = (...parts) => new Uint8Array(Buffer.concat(parts));

let state = Number(seed) + 1;
// A whole number from 0 to below n.
function random(n) {
  state = (state * 48271) % 2147483647;
  return Math.floor(state / 2147483647 * n);
}
const pick = (list) => list[random(list.length)];

const ODD = [null, true, 0, -1, 1, 1.5, 1e-7, 1e7, 1e308, 2 ** 31, 2 ** 32, 2 ** 53, "", "x", "%", "length", "__proto__",
  "constructor", "data:;base64,", "data:;base64,AAAA", "data:;base64,?", [], {}, [[]], [null], [0, 0, 0], { toString: 1 },
  { a: 1 }, [1e9]];
const NUMBERS = [0, 1, 2, 3, 255, 65535, 2 ** 24, 2 ** 31 - 1, 2 ** 31, 2 ** 32 - 1];
const WORDS = ["{", "}", "ROOT", "JOINT", "End", "Site", "OFFSET", "CHANNELS", "MOTION", "Frames:", "Frame", "Time:", "-1", "0",
  "3", "6", "nan", "1e999", "1e308", "999999999", "0x10", "Zrotation", "\0", "\ud800", "", "{ } { }", "hips\n\n"];

// Where a file is damaged by its bytes: anywhere, unless `spans` [from, to) say where.
function spoilBytes(whole, spans = [[0, whole.length]]) {
  const bytes = whole.slice(), view = new DataView(bytes.buffer);
  for (let k = random(1 + random(4)); k >= 0; k--) {
    const [from, to] = pick(spans), at = from + random(Math.max(to - from, 1)), how = random(6);
    if (at + 8 > bytes.length) bytes[Math.min(at, bytes.length - 1)] = random(256);
    else if (how === 0) view.setUint32(at, pick(NUMBERS), true);
    else if (how === 1) view.setUint32(at, view.getUint32(at, true) + random(5) - 2, true);
    else if (how === 2) bytes.copyWithin(at, ...pick(spans).map((o) => Math.min(o, bytes.length - 8)));
    else bytes[at] = how === 3 ? random(256) : pick([0, 1, 127, 128, 255]);
  }
  return random(20) ? bytes : bytes.slice(0, random(bytes.length));
}

// The list or table that holds a random value of a JSON document, and the value's key there.
function somewhere(document) {
  let holder = document, key = pick(Object.keys(document));
  while (typeof holder[key] === "object" && holder[key] !== null && Object.keys(holder[key]).length && random(5)) {
    holder = holder[key];
    key = pick(Object.keys(holder));
  }
  return [holder, key];
}

function spoilDocument(document) {
  const changed = structuredClone(document);
  for (let k = random(1 + random(3)); k >= 0; k--) {
    const [holder, key] = somewhere(changed), how = random(8);
    if (how < 5) holder[key] = structuredClone(pick(ODD));
    else if (how === 5) delete holder[key];
    else if (how === 6) {
      const [other, name] = somewhere(document);
      holder[key] = structuredClone(other[name]);
    } else if (!Array.isArray(holder)) {
      Object.defineProperty(holder, pick(["__proto__", "constructor", "toString", "length", "x"]),
        { value: structuredClone(pick(ODD)), enumerable: true, configurable: true, writable: true });
    }
  }
  return changed;
}

function spoilText(text) {
  const words = text.split(/(\s+)/);
  for (let k = random(1 + random(3)); k >= 0; k--) {
    const at = random(random(2) ? words.length : Math.min(words.length, 900)), how = random(5);
    if (how < 3) words[at] = pick(WORDS);
    else if (how === 3) words.splice(at, random(40));
    else words.splice(at, 0, ...words.slice(random(words.length)).slice(0, random(60)));
  }
  return words.join("");
}

// The parts of a file of 32-bit FBX that a motion is read from: heads and values of all nodes but meshes.
function fbxSpans(bytes) {
  const view = new DataView(bytes.buffer), spans = [[0, 27]];
  const walk = (at, end) => {
    for (let next; at + 13 <= end; at = next) {
      next = view.getUint32(at, true);
      if (next === 0) return;
      const first = at + 13 + bytes[at + 12], inner = first + view.getUint32(at + 8, true);
      const name = decode(bytes.subarray(at + 13, first));
      if (["Geometry", "Deformer", "Material", "Pose"].includes(name)) continue;
      spans.push([at, Math.min(inner, at + 400)]);
      walk(inner, next);
    }
  };
  walk(27, bytes.length);
  return spans;
}

function crc32(bytes) {
  let crc = 0xffffffff;
  for (const byte of bytes) {
    crc ^= byte;
    for (let k = 0; k < 8; k++) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
  }
  return ~crc >>> 0;
}

// The file with a checksum that is right again.
function mendGsac(bytes) {
  if (bytes.length >= 32) new DataView(bytes.buffer).setUint32(24, crc32(bytes.subarray(32)), true);
  return bytes;
}

function gsacOf(head, body) {
  const text = encode(JSON.stringify(head)), room = (16 - (32 + text.length) % 16) % 16;
  const padded = concat(text, new Uint8Array(room).fill(32));
  const header = files[0].slice(0, 32), view = new DataView(header.buffer);
  view.setUint32(12, padded.length, true);
  view.setBigUint64(16, BigInt(32 + padded.length + body.length), true);
  return mendGsac(concat(header, padded, body));
}

const avatar = readAvatar(files[0].slice().buffer);
const put = (motions) => motions.map(({ source }) => retarget(source, avatar, "it"));

/** Reader -> a damaged file and how it is read. */
const ATTACKS = {
  bvh() {
    const whole = pick(files.slice(1)), bytes = random(3) ? encode(spoilText(decode(whole))) : spoilBytes(whole);
    return () => put([{ source: readBvh(decode(bytes), "it") }]);
  },
  async fbx() {
    const whole = pick(files.slice(1)), bytes = spoilBytes(whole, random(8) ? fbxSpans(whole) : undefined);
    return async () => put(await readFbx(bytes, "it"));
  },
  gltf() {
    const whole = pick(files.slice(1)), length = new DataView(whole.buffer).getUint32(12, true), how = random(8);
    let bytes = spoilBytes(whole, [[0, 40], [0, 20 + length], [20 + length, 28 + length]]);
    if (how) {
      const chunk = whole.subarray(20 + length), document = spoilDocument(JSON.parse(decode(whole.subarray(20, 20 + length))));
      if (how < 4 && Array.isArray(document.buffers) && document.buffers[0] && !("uri" in Object(document.buffers[0]))) {
        document.buffers[0] = { uri: `data:;base64,${Buffer.from(chunk.subarray(8)).toString("base64")}` };
      }
      const text = encode(JSON.stringify(document));
      bytes = text;
      if (how >= 4) {
        const head = new DataView(new ArrayBuffer(20));
        [0x46546c67, 2, 20 + text.length + chunk.length, text.length, 0x4e4f534a].forEach((n, k) => head.setUint32(4 * k, n, true));
        bytes = concat(new Uint8Array(head.buffer), text, chunk);
      }
    }
    return () => put(readGltf(bytes, "it", { "a.bin": new Uint8Array(8) }));
  },
  gsac() {
    const whole = files[0], start = 32 + new DataView(whole.buffer).getUint32(12, true), how = random(8);
    let bytes = spoilBytes(whole, [[0, 32], [32, start], [start, whole.length]]);
    if (how === 0) bytes = mendGsac(bytes);
    if (how > 2) bytes = gsacOf(spoilDocument(JSON.parse(decode(whole.subarray(32, start)))), whole.subarray(start));
    return () => readAvatar(bytes.slice().buffer);
  },
};

const out = { reader: kind, mutants: 0, read: 0, refused: 0, uncaught: [], slowest_s: 0, slow: 0 };
for (; out.mutants < Number(count); out.mutants++) {
  const read = await ATTACKS[kind](), start = process.cpuUsage();
  try {
    await read();
    out.read++;
  } catch (error) {
    if (error instanceof MotionError || error instanceof GsacError) out.refused++;
    else out.uncaught.push(`mutant ${out.mutants}: ${error.stack}`);
  }
  const { user, system } = process.cpuUsage(start), seconds = (user + system) / 1e6;
  out.slowest_s = Math.max(out.slowest_s, seconds);
  if (seconds > 10) out.slow++;
}
// What the operating system counts for the process that started this one is not in it.
out.peak_mb = Math.round(Number(readFileSync("/proc/self/status", "latin1").match(/VmHWM:\s*(\d+)/)[1]) / 1024);
console.log(JSON.stringify(out));

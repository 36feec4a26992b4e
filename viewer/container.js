// The container of a .gsac file: header, checksum, JSON head and blocks of numbers (docs/gsac-format.md).

import { isDeep, isTable } from "./json.js";

const GSAC_MAGIC = [0x47, 0x53, 0x41, 0x43, 13, 10, 26, 10];
const GSAC_VERSION = 1;
const GSAC_HEADER = 32;
const GSAC_MAX_FILE = 256 * 2 ** 20;
const GSAC_MAX_HEAD = 2 ** 20;
const GSAC_MAX_BLOCKS = 1024;
const GSAC_MAX_DEPTH = 100;
const GSAC_TYPES = { f32: Float32Array, f16: Uint16Array, u8: Uint8Array, u16: Uint16Array, u32: Uint32Array, i16: Int16Array };

// A file that breaks the format. fault: one of the format's fault names.
export class GsacError extends Error {
  constructor(fault, detail) {
    super(`not a usable avatar (${fault}): ${detail}`);
    this.fault = fault;
  }
}

/**
 * Block name -> shape and numbers; halves and scaled integers are Float32Array, other integers as they are stored.
 * @typedef {Object<string, {shape: number[], data: any}>} Blocks
 */

/**
 * @param {ArrayBuffer} buffer the whole file
 * @returns {{head: Object<string, any>, blocks: Blocks}}
 */
export function unpackGsac(buffer) {
  const start = checkHeader(buffer), head = parseHead(new Uint8Array(buffer, GSAC_HEADER, start - GSAC_HEADER));
  const spans = Object.entries(head.blocks).map(([name, entry]) => {
    const size = blockBytes(name, entry, buffer.byteLength - start);
    return { name, entry, size, from: entry.offset, to: entry.offset + size };
  });
  // Before a block is read: as many as lie in one place would take the memory of each.
  const sorted = [...spans].sort((a, b) => a.from - b.from || a.to - b.to);
  for (let i = 1; i < sorted.length; i++) {
    if (sorted[i].from < sorted[i - 1].to) throw new GsacError("block", `${sorted[i - 1].name} and ${sorted[i].name} overlap`);
  }
  /** @type {Blocks} */
  const blocks = {};
  for (const { name, entry, size, from } of spans) {
    blocks[name] = { shape: entry.shape, data: readBlock(entry, buffer, start + from, size) };
  }
  return { head, blocks };
}

// Checks magic, version, sizes and checksum. Returns the byte at which the blocks begin.
function checkHeader(buffer) {
  const bytes = new Uint8Array(buffer), view = new DataView(buffer);
  const begins = GSAC_MAGIC.slice(0, bytes.length).every((b, i) => bytes[i] === b);
  if (!begins || bytes.length === 0) throw new GsacError("not_gsac", "it does not begin with the GSAC magic bytes");
  if (bytes.length < GSAC_HEADER) throw new GsacError("truncated", `it has ${bytes.length} bytes`);
  if (view.getUint32(8, true) !== GSAC_VERSION) throw new GsacError("version", `it has version ${view.getUint32(8, true)}`);
  const headBytes = view.getUint32(12, true), fileBytes = Number(view.getBigUint64(16, true));
  if (bytes.length > fileBytes || bytes.length > GSAC_MAX_FILE || fileBytes > GSAC_MAX_FILE) {
    throw new GsacError("oversized", `${bytes.length} bytes are there, ${fileBytes} are said`);
  }
  if (bytes.length < fileBytes) throw new GsacError("truncated", `${bytes.length} of ${fileBytes} bytes are there`);
  const start = GSAC_HEADER + headBytes;
  if (headBytes > GSAC_MAX_HEAD || start > fileBytes || start % 16 || view.getUint32(28, true)) {
    throw new GsacError("head", `the header gives it ${headBytes} bytes`);
  }
  if (crc32(bytes.subarray(GSAC_HEADER)) !== view.getUint32(24, true)) {
    throw new GsacError("checksum", "it was damaged after it was written");
  }
  return start;
}

function parseHead(bytes) {
  let head;
  try {
    head = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(bytes));
  } catch (e) {
    throw new GsacError("head", "it does not parse");
  }
  if (isDeep(head, GSAC_MAX_DEPTH)) throw new GsacError("head", `it is nested more than ${GSAC_MAX_DEPTH} deep`);
  if (!isTable(head) || !isTable(head.blocks)) throw new GsacError("head", "it lacks the table `blocks`");
  if (Object.keys(head.blocks).length > GSAC_MAX_BLOCKS) throw new GsacError("block", "it lists too many blocks");
  return head;
}

// Checks a block's entry in the head. Returns its size in bytes; room: bytes from the head's end to the file's.
function blockBytes(name, entry, room) {
  const bad = (why) => new GsacError("block", `block ${name} ${why}`);
  if (!isTable(entry) || !Object.keys(GSAC_TYPES).includes(entry.dtype)) throw bad("has an unknown type");
  const { offset, shape, scale } = entry;
  if (!Array.isArray(shape) || shape.length > 4 || !shape.every((n) => Number.isInteger(n) && n >= 0 && n <= 2 ** 26)) {
    throw bad("has a shape that is not a short list of lengths");
  }
  if (!Number.isInteger(offset) || offset < 0 || offset % 16) throw bad("has a bad offset");
  if (scale !== undefined && !(typeof scale === "number" && Math.abs(scale) > 0 && Math.abs(scale) < 1e6)) {
    throw bad("has a bad scale");
  }
  const size = shape.reduce((a, b) => a * b, GSAC_TYPES[entry.dtype].BYTES_PER_ELEMENT);
  if (offset + size > room) throw bad("ends after the file");
  return size;
}

function readBlock({ dtype, scale }, buffer, at, size) {
  const Type = GSAC_TYPES[dtype];
  let data = new Type(buffer, at, size / Type.BYTES_PER_ELEMENT);
  if (dtype === "f16") data = Float32Array.from(data, halfToFloat);
  if (scale !== undefined) data = Float32Array.from(data, (x) => x * scale);
  return data;
}

// As zip and PNG have it.
function crc32(bytes) {
  const table = new Uint32Array(256);
  for (let i = 0; i < 256; i++) {
    let c = i;
    for (let k = 0; k < 8; k++) c = c & 1 ? (c >>> 1) ^ 0xedb88320 : c >>> 1;
    table[i] = c;
  }
  let crc = 0xffffffff;
  for (let i = 0; i < bytes.length; i++) crc = (crc >>> 8) ^ table[(crc ^ bytes[i]) & 255];
  return (crc ^ 0xffffffff) >>> 0;
}

// The value of the 16 bits of an IEEE half.
function halfToFloat(bits) {
  const sign = bits & 0x8000 ? -1 : 1, exponent = (bits >> 10) & 31, fraction = bits & 1023;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

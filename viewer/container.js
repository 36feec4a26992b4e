// Reader of .gsac bytes (docs/gsac-format.md). A bad file throws GsacError with one of the format's fault names.

import { isTable } from "./json.js";

const GSAC_MAGIC = [0x47, 0x53, 0x41, 0x43, 13, 10, 26, 10];
const GSAC_VERSION = 1;
const GSAC_HEADER = 32;
const GSAC_MAX_FILE = 256 * 2 ** 20;
const GSAC_MAX_HEAD = 2 ** 20;
const GSAC_MAX_BLOCKS = 1024;
const GSAC_TYPES = { f32: Float32Array, f16: Uint16Array, u8: Uint8Array, u16: Uint16Array, u32: Uint32Array, i16: Int16Array };

export class GsacError extends Error {
  constructor(fault, detail) {
    super(`not a usable avatar (${fault}): ${detail}`);
    this.fault = fault;
  }
}

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

function halfToFloat(h) {
  const sign = h & 0x8000 ? -1 : 1, exponent = (h >> 10) & 31, fraction = h & 1023;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

// buffer: ArrayBuffer. Returns {head, blocks: name -> {shape, data}}, halves and scaled integers turned to Float32Array.
export function unpackGsac(buffer) {
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
  let head;
  try {
    head = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(bytes.subarray(GSAC_HEADER, start)));
  } catch (e) {
    throw new GsacError("head", "it does not parse");
  }
  if (!isTable(head) || !isTable(head.blocks)) throw new GsacError("head", "it lacks the table `blocks`");
  if (Object.keys(head.blocks).length > GSAC_MAX_BLOCKS) throw new GsacError("block", "it lists too many blocks");
  const blocks = {}, spans = [];
  for (const [name, entry] of Object.entries(head.blocks)) {
    const size = blockBytes(name, entry, fileBytes - start);
    spans.push([entry.offset, entry.offset + size, name]);
    const Type = GSAC_TYPES[entry.dtype];
    let data = new Type(buffer, start + entry.offset, size / Type.BYTES_PER_ELEMENT);
    if (entry.dtype === "f16") data = Float32Array.from(data, halfToFloat);
    if (entry.scale !== undefined) data = Float32Array.from(data, (x) => x * entry.scale);
    blocks[name] = { shape: entry.shape, data };
  }
  spans.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  for (let i = 1; i < spans.length; i++) {
    if (spans[i][0] < spans[i - 1][1]) throw new GsacError("block", `${spans[i - 1][2]} and ${spans[i][2]} overlap`);
  }
  return { head, blocks };
}

// Size in bytes of a block that can be believed; room: bytes after the head.
function blockBytes(name, entry, room) {
  const bad = (why) => new GsacError("block", `block ${name} ${why}`);
  if (!isTable(entry) || !Object.hasOwn(GSAC_TYPES, entry.dtype)) throw bad("has an unknown type");
  const { offset, shape, scale } = entry;
  if (!Array.isArray(shape) || shape.length > 4 || !shape.every((n) => Number.isInteger(n) && n >= 0 && n <= 2 ** 26)) {
    throw bad("has a shape that is not a short list of lengths");
  }
  if (!Number.isInteger(offset) || offset < 0 || offset % 16) throw bad("has a bad offset");
  if (scale !== undefined && !(typeof scale === "number" && Math.abs(scale) > 0 && Math.abs(scale) < 1e6)) throw bad("has a bad scale");
  const size = shape.reduce((a, b) => a * b, GSAC_TYPES[entry.dtype].BYTES_PER_ELEMENT);
  if (offset + size > room) throw bad("ends after the file");
  return size;
}

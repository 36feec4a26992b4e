// The networks of the mirror, from files that the user gives: the page fetches nothing.

import { MotionError } from "./motion.js";

// What the user is to give: what it is for -> the names of its files, and how it is called.
const KIT_PARTS = {
  bundle: [/vision_bundle\.m?js$/, "vision_bundle.mjs"],
  loader: [/vision_wasm_internal\.js$/, "vision_wasm_internal.js"],
  binary: [/vision_wasm_internal\.wasm$/, "vision_wasm_internal.wasm"],
};
const FACE_FILE = /face_?landmarker.*\.task$/i;
const POSE_FILE = /pose_?landmarker.*\.task$/i;
const TAR_FILE = /\.(tgz|tar\.gz)$/i;
// Of a tar archive.
const TAR_BLOCK = 512;
// An archive that unpacks to more is refused, bytes.
const MOST_UNPACKED = 256 * 2 ** 20;

/**
 * Throws MotionError, which says what is missing.
 * @param {File[]} files the npm package @mediapipe/tasks-vision as .tgz, or its three files; face_landmarker.task, and
 *   pose_landmarker.task for the arms
 * @returns {Promise<import("./mirror.js").Kit>}
 */
export async function openKit(files) {
  /** @type {[string, Blob][]} */
  const given = [];
  for (const file of files) {
    if (TAR_FILE.test(file.name)) given.push(...await readArchive(file));
    else given.push([file.name, file]);
  }
  const find = (pattern) => given.find(([name]) => pattern.test(name))?.[1];
  const missing = Object.values(KIT_PARTS).filter(([pattern]) => !find(pattern)).map(([, name]) => name);
  if (!find(FACE_FILE) && !find(POSE_FILE)) missing.push("face_landmarker.task");
  if (missing.length) {
    throw new MotionError(`Mirror: ${missing.join(", ")} ${missing.length > 1 ? "are" : "is"} missing; give all files in one go`);
  }
  const address = (pattern, type) => URL.createObjectURL(new Blob([find(pattern)], { type }));
  const vision = await importModule(address(KIT_PARTS.bundle[0], "text/javascript"));
  const loader = address(KIT_PARTS.loader[0], "text/javascript"), binary = address(KIT_PARTS.binary[0], "application/wasm");
  // The loader takes an address only if it ends in the file's name.
  const set = { wasmLoaderPath: loader, wasmBinaryPath: `${binary}#/${KIT_PARTS.binary[1]}` };
  const make = async (kind, pattern, more) => {
    const model = find(pattern);
    if (!model) return null;
    try {
      const baseOptions = { modelAssetBuffer: new Uint8Array(await model.arrayBuffer()) };
      return await kind.createFromOptions(set, { baseOptions, runningMode: "VIDEO", ...more });
    } catch (error) {
      // MediaPipe also rejects with the event of a script that does not load.
      const why = error.message?.split("\n")[0] ?? "MediaPipe does not start";
      throw new MotionError(`Mirror: a network cannot be read (${why})`);
    }
  };
  const actions = { outputFaceBlendshapes: true, outputFacialTransformationMatrixes: true };
  return { face: await make(vision.FaceLandmarker, FACE_FILE, actions), pose: await make(vision.PoseLandmarker, POSE_FILE, {}) };
}

// The module at an address of this page's own memory.
function importModule(address) {
  return new Promise((done, fail) => {
    const script = Object.assign(document.createElement("script"), { type: "module" });
    const wrong = (why) => fail(new MotionError(`Mirror: vision_bundle.mjs cannot be run (${why})`));
    document.addEventListener("gsac-module", (event) => done(/** @type {CustomEvent} */ (event).detail), { once: true });
    window.addEventListener("error", (event) => wrong(event.message), { once: true });
    script.addEventListener("error", () => wrong("it is no module"));
    script.textContent = `import * as all from "${address}"; document.dispatchEvent(new CustomEvent("gsac-module", { detail: all }));`;
    document.head.append(script);
  });
}

// Files of a .tar.gz archive: name and bytes.
async function readArchive(file) {
  let size = 0;
  const bound = new TransformStream({ transform: (part, next) => {
    size += part.length;
    if (size > MOST_UNPACKED) next.error(new Error("too large"));
    else next.enqueue(part);
  } });
  const unpacked = new Response(file.stream().pipeThrough(new DecompressionStream("gzip")).pipeThrough(bound)).arrayBuffer();
  const bytes = new Uint8Array(await unpacked.catch(() => {
    const why = size > MOST_UNPACKED ? `it unpacks to more than ${MOST_UNPACKED} bytes` : "it is no .tgz archive";
    throw new MotionError(`${file.name}: ${why}`);
  }));
  const text = (from, most) => new TextDecoder().decode(bytes.subarray(from, from + most)).split("\0")[0];
  /** @type {[string, Blob][]} */
  const found = [];
  for (let at = 0; at + TAR_BLOCK <= bytes.length && bytes[at];) {
    const length = Number.parseInt(text(at + 124, 12), 8);
    if (!(length >= 0)) throw new MotionError(`${file.name}: it is no .tgz archive`);
    found.push([text(at, 100), new Blob([bytes.subarray(at + TAR_BLOCK, at + TAR_BLOCK + length)])]);
    at += TAR_BLOCK * (1 + Math.ceil(length / TAR_BLOCK));
  }
  return found;
}

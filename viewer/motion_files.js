// Files that the user drops on the page or chooses: an avatar, or motions, which become clips of the avatar.

import { readBvh } from "./bvh.js";
import { readFbx } from "./fbx.js";
import { readGltf } from "./gltf.js";
import { MotionError, MotionSource } from "./motion.js";
import { retarget } from "./retarget.js";

// Of all files that are dropped together.
const MOST_BYTES = 128 * 2 ** 20;
const READERS = { bvh: readBvhMotions, fbx: readFbx, glb: readGltf, gltf: readGltf, vrma: readGltf };

// Files of gaussians that stand still.
const SPLATS = ["ply", "spz", "sog", "splat"];

// The end of a file's name.
function kindOf(file) {
  return file.name.split(".").at(-1).toLowerCase();
}

/**
 * @param {File[]} files
 * @returns {File | undefined} the one that is an avatar
 */
export function findAvatar(files) {
  return files.find((file) => kindOf(file) === "gsac");
}

/**
 * Throws MotionError.
 * @param {File} file
 * @returns {Promise<ArrayBuffer>}
 */
export function readFile(file) {
  if (file.size > MOST_BYTES) throw new MotionError(`${file.name}: it has ${file.size} bytes; at most ${MOST_BYTES} are read`);
  return file.arrayBuffer().catch((error) => {
    throw new MotionError(`${file.name}: the browser could not read it (${error.name})`);
  });
}

function readBvhMotions(bytes, where) {
  return [{ name: where.replace(/\.[^.]*$/, ""), source: readBvh(new TextDecoder().decode(bytes), where) }];
}

/**
 * Adds clips to the avatar; throws MotionError.
 * @param {import("./reader.js").Avatar | undefined} avatar
 * @param {File[]} files motions, and buffers that belong to a .gltf
 * @returns {Promise<string[]>} the clips' names
 */
export async function addMotions(avatar, files) {
  const motions = files.filter((file) => Object.hasOwn(READERS, kindOf(file)));
  if (!motions.length) {
    const names = files.map((file) => file.name).join(", ") || "nothing";
    if (files.some((file) => SPLATS.includes(kindOf(file)))) {
      throw new MotionError(`${names}: gaussians without a body, which a splat viewer shows; drop the avatar itself, its .gsac`);
    }
    throw new MotionError(`${names}: a motion is read from .bvh, .fbx, .glb, .gltf and .vrma, an avatar from .gsac`);
  }
  if (!avatar) throw new MotionError(`${motions[0].name}: no avatar is there that a motion could move`);
  const size = files.reduce((sum, file) => sum + file.size, 0);
  if (size > MOST_BYTES) throw new MotionError(`${files[0].name}: it has ${size} bytes; at most ${MOST_BYTES} are read`);
  /** @type {Object<string, Uint8Array>} */
  const bytes = {};
  for (const file of files) bytes[file.name] = new Uint8Array(await readFile(file));
  const found = [];
  let frames = 0;
  for (const file of motions) {
    try {
      for (const { name, source } of await READERS[kindOf(file)](bytes[file.name], file.name, bytes)) {
        frames += source.frames;
        const refused = MotionSource.refuse(frames, avatar.names.length);
        if (refused) throw new MotionError(`${file.name}: ${refused}`);
        found.push({ name, clip: retarget(source, avatar, file.name) });
      }
    } catch (error) {
      if (error instanceof MotionError) throw error;
      console.error(error);
      throw new MotionError(`${file.name}: it cannot be read (${error.message})`);
    }
  }
  return found.map(({ name, clip }) => {
    const label = freeName(avatar, name.slice(0, 40) || "motion");
    avatar.clips[label] = clip;
    return label;
  });
}

// The name, with a number after it where a clip or a pose has it already.
function freeName({ clips, poses }, name) {
  let label = name;
  for (let k = 2; label in clips || label in poses; k++) label = `${name} ${k}`;
  return label;
}

/**
 * Listens for files that are dropped on the page.
 * @param {HTMLElement} sign shown while files are dragged over the page
 * @param {(files: File[]) => void} onFiles
 */
export function listenForDrops(sign, onFiles) {
  const carriesFiles = (e) => [...(e.dataTransfer?.types ?? [])].includes("Files");
  document.addEventListener("dragover", (e) => {
    if (!carriesFiles(e)) return;
    e.preventDefault();
    sign.hidden = false;
  });
  document.addEventListener("dragleave", (e) => {
    if (!e.relatedTarget) sign.hidden = true;
  });
  document.addEventListener("drop", (e) => {
    if (!carriesFiles(e)) return;
    e.preventDefault();
    sign.hidden = true;
    onFiles([...e.dataTransfer.files]);
  });
}

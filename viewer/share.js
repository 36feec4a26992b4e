// What leaves the page: a link to this view, and the avatar's own file.

/**
 * All that is seen now, as the words after # that address.js reads.
 * @param {import("./viewer.js").Viewer} viewer
 */
export function describeView(viewer) {
  const { camera, playing, levels, near } = viewer, words = [], round = (x) => String(Math.round(x * 1000) / 1000);
  words.push(playing.clip ? `clip=${encodeURIComponent(playing.clip)}` : `pose=${encodeURIComponent(playing.pose)}`);
  if (playing.clip && viewer.paused) words.push(`t=${round(viewer.clock)}`);
  if (viewer.turntable) words.push("turntable");
  words.push(`yaw=${round(camera.yaw % 360)}`);
  if (camera.moved || near) {
    words.push(`pitch=${round(camera.pitch)}`, `dist=${round(camera.distance)}`, `target=${camera.target.map(round).join(",")}`);
  }
  words.push(`bg=${viewer.background.slice(1)}`);
  const face = Object.entries(viewer.expression).filter(([, weight]) => weight).map(([name, weight]) => `${name}:${round(weight)}`);
  const turned = Object.entries(viewer.turned).filter(([, by]) => by.some(Boolean)).map(([name, by]) => `${name}:${by.join(",")}`);
  if (face.length) words.push(`expression=${face.join(",")}`);
  if (turned.length) words.push(`joints=${turned.join(";")}`);
  if (!levels.lit) words.push("light=off");
  if (levels.scene.share) words.push(`lamp=${round(levels.scene.around)},${round(levels.scene.above)}`);
  return words.join("&");
}

/**
 * Hands the link to the device's own sharing, or to the clipboard.
 * @param {string} link
 * @param {string} title
 * @returns {Promise<string>} a sentence on what became of it
 */
export async function shareLink(link, title) {
  try {
    if (navigator.share && matchMedia("(pointer: coarse)").matches && location.protocol !== "file:") {
      await navigator.share({ title, url: link });
      return "Shared.";
    }
    await navigator.clipboard.writeText(link);
    const only = location.protocol === "file:" ? " It opens on this machine; to others send the page's file." : "";
    return `The link to this view is in the clipboard.${only}`;
  } catch (error) {
    return error.name === "AbortError" ? "Not shared." : `Copy this link: ${link}`;
  }
}

// Offers bytes or a picture as a file.
export function saveFile(blob, name) {
  const link = document.createElement("a");
  link.download = name;
  link.href = URL.createObjectURL(blob);
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

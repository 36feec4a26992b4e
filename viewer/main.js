// Runs the page: unpacks the avatar inside it, shows it, and follows the address.

import { readAddress } from "./address.js";
import { decodeBase64 } from "./base64.js";
import { Controls } from "./controls.js";
import { readName } from "./name.js";
import { readAvatar } from "./reader.js";
import { Viewer } from "./viewer.js";
import { offerHeadset } from "./xr.js";

// The bytes of avatar.gsac, which page.html holds compressed and in base64.
async function unpackAvatar() {
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old: it cannot unpack the avatar");
  const packed = decodeBase64(document.getElementById("avatar").textContent.trim());
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

async function main() {
  const options = () => readAddress(location.hash.slice(1));
  const file = await unpackAvatar(), viewer = await Viewer.open(readAvatar(file), options().draw);
  // For the browser's console, tests and benchmarks.
  Object.assign(window, { gsac: viewer });
  const controls = new Controls(viewer, readName(location.pathname), file);
  const follow = () => {
    viewer.follow(options());
    controls.show();
  };
  follow();
  window.addEventListener("hashchange", follow);
  await offerHeadset(viewer, document.getElementById("tools"), (text) => controls.note(text));
  document.getElementById("message").hidden = true;
  viewer.run();
  document.documentElement.dataset.ready = "yes";
}

function showError(error) {
  const box = document.getElementById("message");
  box.textContent = `The avatar cannot be shown: ${error.message}`;
  box.hidden = false;
  console.error(error);
}

main().catch(showError);

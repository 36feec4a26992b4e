// The page: opens the avatar inside it, plays it, and listens to the buttons and to the address.
// Address: #pose=T|A or #clip=NAME, t=SECONDS, yaw, pitch, dist, fov (degrees, m), target=x,y,z, bg=rrggbb,
// expression=NAME:WEIGHT,..., joints=NAME:x,y,z;... (axis-angle, degrees), light=off, turntable,
// still (one frame, no controls, no floor);
// draw=webgpu|webgl|software, when the page opens.

import { Controls } from "./controls.js";
import { readAvatar } from "./reader.js";
import { Viewer } from "./viewer.js";
import { offerHeadset } from "./xr.js";

async function inlinedAvatar() {
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old: it cannot unpack the avatar");
  const text = atob(document.getElementById("avatar").textContent.trim());
  const packed = Uint8Array.from(text, (c) => c.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

function showError(error) {
  const box = document.getElementById("message");
  box.textContent = `The avatar cannot be shown: ${error.message}`;
  box.hidden = false;
  console.error(error);
}

async function main() {
  const viewer = await Viewer.open(readAvatar(await inlinedAvatar()), new URLSearchParams(location.hash.slice(1)).get("draw"));
  window.gsac = viewer;
  const controls = new Controls(viewer);
  const follow = () => {
    viewer.follow(location.hash.slice(1));
    controls.show();
  };
  follow();
  window.addEventListener("hashchange", follow);
  await offerHeadset(viewer, document.getElementById("tools"), (text) => controls.note(text));
  document.getElementById("message").hidden = true;
  viewer.run();
  document.documentElement.dataset.ready = "yes";
}

main().catch(showError);

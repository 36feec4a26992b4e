// Runs the page: unpacks the avatar inside it, shows it in the element <gsac-avatar>, and follows the address.

import { readAddress } from "./address.js";
import { unpackArrays } from "./arrays.js";
import { Controls } from "./controls.js";
import { GsacAvatar } from "./element.js";
import { decodeLetters } from "./letters.js";
import { listenForMessages, readOrigins } from "./messages.js";
import { readName } from "./name.js";
import { offerHeadset } from "./xr.js";

// The bytes of avatar.gsac, which page.html holds packed, compressed and as letters.
async function unpackAvatar() {
  const { textContent, dataset } = document.getElementById("avatar");
  const packed = new Blob([decodeLetters(textContent)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return unpackArrays(new Uint8Array(await new Response(packed).arrayBuffer()), JSON.parse(dataset.arrays));
}

async function main() {
  const options = () => readAddress(location.hash.slice(1));
  customElements.define("gsac-avatar", GsacAvatar);
  const person = /** @type {GsacAvatar} */ (document.getElementById("person"));
  person.screen = document.documentElement;
  // For the browser's console, tests and benchmarks.
  Object.assign(window, { gsac: person.viewer });
  const controls = new Controls(person, readName(location.pathname)), first = options();
  controls.follow(first);
  listenForMessages(person, readOrigins(person));
  await person.open((await unpackAvatar()).buffer, first);
  window.addEventListener("hashchange", () => {
    const next = options();
    controls.follow(next);
    person.follow(next);
  });
  await offerHeadset(person.viewer, document.getElementById("tools"), (text) => controls.note(text));
  document.getElementById("message").hidden = true;
  document.documentElement.dataset.ready = "yes";
}

function showError(error) {
  const box = document.getElementById("message");
  box.textContent = `The avatar cannot be shown: ${error.message}`;
  box.hidden = false;
  console.error(error);
}

main().catch(showError);

// Messages between the page and the one that holds it in an <iframe>: a few words, and only from origins that the page allows.

import { readOptions } from "./address.js";
import { isTable } from "./json.js";

// Any page may steer this one.
const ANYBODY = "*";

/**
 * Who may steer the page: the attribute `origins`, words with space between; without it the page's own origin. A page from disk has
 * no origin that means anything.
 * @param {Element} person
 */
export function readOrigins(person) {
  const given = person.getAttribute("origins") ?? (location.origin === "null" ? "" : location.origin);
  return given.split(/\s+/).filter(Boolean);
}

/**
 * Hears `{gsac: WORD, ...}` from the page around this one, and tells it what happens here in the same form.
 * @param {import("./element.js").GsacAvatar} person
 * @param {string[]} origins that may steer, or *
 */
export function listenForMessages(person, origins) {
  if (window.parent === window) return;
  const tell = (gsac, more = {}) => {
    for (const origin of origins) window.parent.postMessage({ gsac, ...more }, origin);
  };
  const sayReady = () => {
    const { clips, poses, expressions, joints } = person;
    if (person.file) tell("ready", { clips, poses, expressions, joints });
  };
  const words = wordsOf(person, sayReady);
  window.addEventListener("message", ({ source, origin, data }) => {
    if (source !== window.parent || !(origins.includes(origin) || origins.includes(ANYBODY))) return;
    if (!isTable(data) || typeof data.gsac !== "string") return;
    try {
      if (!Object.hasOwn(words, data.gsac)) throw new Error(`${data.gsac.slice(0, 40)}: expected ${Object.keys(words).join(", ")}`);
      if (!person.file && data.gsac !== "hello") throw new Error(`${data.gsac}: no avatar is there yet; wait for ready`);
      words[data.gsac](data);
    } catch (error) {
      tell("error", { text: error.message });
    }
  });
  const detail = (event) => /** @type {CustomEvent} */ (event).detail;
  person.addEventListener("load", sayReady);
  person.addEventListener("error", (event) => tell("error", { text: detail(event) }));
  person.addEventListener("note", (event) => tell("error", { text: detail(event) }));
  person.addEventListener("end", () => tell("end"));
  person.addEventListener("pick", (event) => tell("pick", detail(event)));
}

// What each word does with the message that it comes in.
function wordsOf(person, sayReady) {
  const { viewer } = person;
  const table = (value, what) => {
    if (!isTable(value)) throw new Error(`${what}: expected a table by name`);
    return value;
  };
  return {
    hello: sayReady,
    play: ({ name }) => person.play(name),
    pause: () => person.pause(),
    express: ({ weights }) => person.express(table(weights, "weights")),
    turn: ({ turns }) => person.turn(table(turns, "turns")),
    look: ({ at }) => person.look(at),
    view: (message) => {
      viewer.opening = viewer.turntable = false;
      viewer.aim(optionsOf(message));
      person.changed();
    },
    light: (message) => {
      viewer.shine(optionsOf(message));
      person.changed();
    },
  };
}

// The options of an address that a message names, as numbers, lists or words. Throws where one is none.
function optionsOf(message) {
  const has = (name) => Object.hasOwn(message, name) && message[name] !== null;
  const options = readOptions({ has, get: (name) => (has(name) ? String(message[name]) : null) });
  if (options.faults.length) throw new Error(options.faults.join(". "));
  return options;
}

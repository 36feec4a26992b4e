// The keys that move the avatar and its camera.

// Degrees and factor of one press.
const TURN = 10;
const NEARER = 0.9;

/**
 * Key -> what it does; the letters in either case.
 * @param {import("./element.js").GsacAvatar} person
 * @returns {Object<string, () => void>}
 */
export function keyActions(person) {
  const { viewer } = person, { camera } = viewer;
  const turn = (yaw, pitch) => () => {
    viewer.turntable = false;
    camera.turnBy(yaw, pitch);
    camera.moved = true;
  };
  const zoom = (factor) => () => {
    camera.zoom(factor);
    camera.moved = true;
  };
  return {
    " ": () => person.toggle(),
    f: () => person.fullscreen(),
    r: () => person.reset(),
    t: () => { viewer.turntable = !viewer.turntable; },
    z: () => viewer.look(viewer.near ? null : "face"),
    ArrowLeft: turn(-TURN, 0),
    ArrowRight: turn(TURN, 0),
    ArrowUp: turn(0, TURN),
    ArrowDown: turn(0, -TURN),
    "+": zoom(NEARER),
    "=": zoom(NEARER),
    "-": zoom(1 / NEARER),
  };
}

/**
 * Listens for keys; a slider, a list or a button that has the focus keeps the keys that it uses itself.
 * @param {EventTarget} place
 * @param {Object<string, () => void>} actions
 * @param {() => void} onAction called after each
 */
export function listenForKeys(place, actions, onAction) {
  place.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const at = /** @type {HTMLElement} */ (event.composedPath()[0]);
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || !Object.hasOwn(actions, key)) return;
    if (at.closest?.("dialog")) return;
    if (at.matches?.("input, select") && key !== "Escape" || at.matches?.("button") && key === " ") return;
    event.preventDefault();
    actions[key]();
    onAction();
  });
}

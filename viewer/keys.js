// The page's keys.

// Degrees and factor of one press.
const TURN = 10;
const NEARER = 0.9;

/**
 * Key -> what it does; the letters in either case.
 * @param {import("./controls.js").Controls} controls
 * @returns {Object<string, () => void>}
 */
function keyActions(controls) {
  const { viewer } = controls, { camera } = viewer;
  const turn = (yaw, pitch) => () => {
    viewer.turntable = false;
    camera.turn(-yaw / 0.35, pitch / 0.3);
    camera.moved = true;
  };
  const zoom = (factor) => () => {
    camera.zoom(factor);
    camera.moved = true;
  };
  return {
    " ": () => { controls.pause(); },
    f: () => controls.fullscreen(),
    r: () => controls.reset(),
    t: () => { viewer.turntable = !viewer.turntable; },
    "?": () => controls.help(),
    Escape: () => controls.openDrawer(null),
    ArrowLeft: turn(-TURN, 0),
    ArrowRight: turn(TURN, 0),
    ArrowUp: turn(0, TURN),
    ArrowDown: turn(0, -TURN),
    "+": zoom(NEARER),
    "=": zoom(NEARER),
    "-": zoom(1 / NEARER),
  };
}

// Listens on the page; a slider, a list or a button that has the focus keeps the keys that it uses itself.
export function listenForKeys(controls) {
  const actions = keyActions(controls);
  document.addEventListener("keydown", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key, at = /** @type {HTMLElement} */ (event.target);
    if (event.ctrlKey || event.metaKey || event.altKey || !Object.hasOwn(actions, key) || at.closest("dialog")) return;
    if (at.matches("input, select") && key !== "Escape" || at.matches("button") && key === " ") return;
    event.preventDefault();
    actions[key]();
    controls.show();
  });
}

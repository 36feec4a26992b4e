// The two drawers of sliders: one joint's turns, and the weights of the face's expressions.

// A joint turns by hand up to this, degrees.
const MOST_TURN = 170;
const AXIS_LABELS = ["x, degrees", "y, degrees", "z, degrees"];

/**
 * A slider with its label and its value as text. `show` makes it show what `read` gives.
 * @param {string} label
 * @param {number} low
 * @param {number} high
 * @param {number} step
 * @param {() => number} read
 * @param {(value: number) => void} write
 */
function makeSlider(label, low, high, step, read, write) {
  const row = document.createElement("label"), name = document.createElement("span"), value = document.createElement("output");
  const input = document.createElement("input");
  Object.assign(input, { type: "range", min: low, max: high, step });
  row.className = "row";
  name.textContent = label;
  row.append(name, input, value);
  const show = () => {
    input.value = String(read());
    value.textContent = Number(input.value).toFixed(step < 1 ? 2 : 0);
  };
  input.addEventListener("input", () => {
    write(Number(input.value));
    value.textContent = Number(input.value).toFixed(step < 1 ? 2 : 0);
  });
  input.setAttribute("aria-label", label);
  return { row, show };
}

// Expressions in one press: name -> weights of the face's actions.
const PRESETS = {
  Neutral: {},
  Smile: { mouthSmileLeft: 0.9, mouthSmileRight: 0.9, cheekSquintLeft: 0.4, cheekSquintRight: 0.4 },
  Laugh: { mouthSmileLeft: 1, mouthSmileRight: 1, jawOpen: 0.35, cheekSquintLeft: 0.6, cheekSquintRight: 0.6 },
  Blink: { eyeBlinkLeft: 1, eyeBlinkRight: 1 },
  Wink: { eyeBlinkLeft: 1, mouthSmileLeft: 0.6 },
  Surprise: { browInnerUp: 1, browOuterUpLeft: 0.8, browOuterUpRight: 0.8, eyeWideLeft: 0.8, eyeWideRight: 0.8, jawOpen: 0.4 },
  Angry: { browDownLeft: 1, browDownRight: 1, mouthFrownLeft: 0.5, mouthFrownRight: 0.5, noseSneerLeft: 0.4, noseSneerRight: 0.4 },
  Sad: { browInnerUp: 0.8, mouthFrownLeft: 0.8, mouthFrownRight: 0.8 },
};

/**
 * Fills `place` with a button for each preset whose actions the avatar has.
 * @param {import("./viewer.js").Viewer} viewer
 * @param {HTMLElement} place
 * @param {() => void} onChange
 */
export function addPresets(viewer, place, onChange) {
  for (const [name, weights] of Object.entries(PRESETS)) {
    if (!Object.keys(weights).every((action) => viewer.avatar.expressions.includes(action))) continue;
    const button = Object.assign(document.createElement("button"), { textContent: name });
    button.addEventListener("click", () => {
      viewer.expression = { ...weights };
      onChange();
    });
    place.append(button);
  }
}

/**
 * Fills `rows` with a choice of joint and its three turns.
 * @param {import("./viewer.js").Viewer} viewer
 * @param {HTMLElement} rows
 * @returns {() => void} makes them show the viewer's state
 */
export function addJointSliders(viewer, rows) {
  const choice = Object.assign(document.createElement("select"), { id: "joint" });
  choice.setAttribute("aria-label", "Joint");
  for (const name of viewer.avatar.names) choice.append(new Option(name.replaceAll("_", " ").replace(" smplhf", ""), name));
  choice.value = viewer.avatar.names.includes("left_elbow") ? "left_elbow" : viewer.avatar.names[0];
  const sliders = AXIS_LABELS.map((label, axis) => makeSlider(label, -MOST_TURN, MOST_TURN, 1,
    () => viewer.turned[choice.value]?.[axis] ?? 0,
    (degrees) => {
      const turn = viewer.turned[choice.value] ??= [0, 0, 0];
      turn[axis] = degrees;
    }));
  const show = () => sliders.forEach((slider) => slider.show());
  choice.addEventListener("change", show);
  rows.append(choice, ...sliders.map((slider) => slider.row));
  return show;
}

/**
 * Fills `rows` with a slider for each expression.
 * @param {import("./viewer.js").Viewer} viewer
 * @param {HTMLElement} rows
 * @returns {() => void} makes them show the viewer's state
 */
export function addFaceSliders(viewer, rows) {
  const sliders = viewer.avatar.expressions.map((name) => {
    const label = name.replace(/([a-z])([A-Z])/g, "$1 $2").toLowerCase();
    return makeSlider(label, 0, 1, 0.01, () => viewer.expression[name] ?? 0, (weight) => { viewer.expression[name] = weight; });
  });
  rows.append(...sliders.map((slider) => slider.row));
  return () => sliders.forEach((slider) => slider.show());
}

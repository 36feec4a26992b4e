// The two drawers of sliders: turns of one joint, and weights of the face's expressions.

function sliderRow(label, low, high, step, read, write) {
  const row = document.createElement("label"), name = document.createElement("span"), value = document.createElement("output");
  const input = Object.assign(document.createElement("input"), { type: "range", min: low, max: high, step });
  row.className = "row";
  name.textContent = label;
  row.append(name, input, value);
  const show = () => {
    input.value = read();
    value.textContent = Number(input.value).toFixed(step < 1 ? 2 : 0);
  };
  input.addEventListener("input", () => {
    write(Number(input.value));
    value.textContent = Number(input.value).toFixed(step < 1 ? 2 : 0);
  });
  input.setAttribute("aria-label", label);
  return { row, show };
}

const DEGREES = 170;
const AXIS_LABELS = ["x, degrees", "y, degrees", "z, degrees"];

// Fills `rows` with a choice of joint and its three turns. Returns what makes them show the viewer's state.
export function jointSliders(viewer, rows) {
  const choice = Object.assign(document.createElement("select"), { id: "joint" });
  choice.setAttribute("aria-label", "Joint");
  for (const name of viewer.avatar.names) choice.append(new Option(name.replaceAll("_", " ").replace(" smplhf", ""), name));
  choice.value = viewer.avatar.names.includes("left_elbow") ? "left_elbow" : viewer.avatar.names[0];
  const sliders = AXIS_LABELS.map((label, axis) => sliderRow(label, -DEGREES, DEGREES, 1,
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

// Fills `rows` with a slider for each expression.
export function faceSliders(viewer, rows) {
  const sliders = viewer.avatar.expressions.map((name) => sliderRow(name.replace(/([a-z])([A-Z])/g, "$1 $2").toLowerCase(), 0, 1, 0.01,
    () => viewer.expression[name] ?? 0, (weight) => { viewer.expression[name] = weight; }));
  rows.append(...sliders.map((slider) => slider.row));
  return () => sliders.forEach((slider) => slider.show());
}

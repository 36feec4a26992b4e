// The dial for the lamp's direction: a ball seen from the person's front, the lamp where it would shine on it.

// Degrees that an arrow key turns.
const STEP = 10;
// Steps of the keys: around, above.
const KEYS = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };
const BACK = ["Delete", "Backspace", "Escape"];

/**
 * Makes an element the dial, and the range beside it the slider from the clip's light to the lamp's. Returns what makes both show the light.
 * @param {() => import("./scene_light.js").SceneLight} lightNow of the avatar that is there
 * @param {HTMLElement} dial
 * @param {HTMLInputElement} slider
 * @param {() => void} onChange
 */
export function addLightDial(lightNow, dial, slider, onChange) {
  const put = (share) => {
    const light = lightNow();
    light.share = share;
    light.update();
    onChange();
  };
  const drag = ({ clientX, clientY }) => {
    const box = dial.getBoundingClientRect(), radius = box.width / 2;
    const x = (clientX - box.left) / radius - 1, y = 1 - (clientY - box.top) / radius, from = Math.hypot(x, y);
    // beyond the rim, to its double, the lamp goes round to the back
    const z = from <= 1 ? Math.sqrt(1 - from * from) : -Math.sqrt(Math.max(0, 1 - (2 - Math.min(from, 2)) ** 2));
    const side = Math.sqrt(1 - z * z) / (from || 1);
    lightNow().place(Math.atan2(x * side, z) * 180 / Math.PI, Math.asin(Math.min(1, Math.max(-1, y * side))) * 180 / Math.PI);
    onChange();
  };
  dial.addEventListener("pointerdown", (event) => {
    dial.setPointerCapture(event.pointerId);
    drag(event);
  });
  dial.addEventListener("pointermove", (event) => { if (dial.hasPointerCapture(event.pointerId)) drag(event); });
  dial.addEventListener("dblclick", () => put(0));
  dial.addEventListener("keydown", (event) => {
    if (BACK.includes(event.key)) put(0);
    else if (event.key in KEYS) {
      const [around, above] = KEYS[event.key], light = lightNow();
      light.place(light.around + (light.share ? around : 0), light.above + (light.share ? above : 0));
      onChange();
    } else return;
    event.preventDefault();
    event.stopPropagation();
  });
  slider.addEventListener("input", () => put(Number(slider.value)));
  return () => {
    const light = lightNow(), [x, y, z] = light.direction, on = light.share > 0;
    dial.style.setProperty("--x", String(x));
    dial.style.setProperty("--y", String(-y));
    dial.classList.toggle("lit", on);
    dial.classList.toggle("behind", z < 0);
    dial.setAttribute("aria-valuenow", String(Math.round(light.around)));
    dial.setAttribute("aria-valuetext", on ? `${Math.round(light.around)}° around, ${Math.round(light.above)}° above` : "off");
    slider.hidden = !on;
    slider.value = String(light.share);
  };
}

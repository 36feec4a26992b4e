// The page: opens the avatar inside it, plays it, and listens to the buttons and to the address.
// Address: #pose=T|A or #clip=NAME, t=SECONDS, yaw, pitch, dist, fov (degrees, m), target=x,y,z, bg=rrggbb,
// expression=NAME:WEIGHT, turntable, still (one frame, no controls, no floor).

const FADE_S = 0.35;
const BACKGROUND = "#2b303b";
const MAX_PIXEL_RATIO = 2;

async function inlinedAvatar() {
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old: it cannot unpack the avatar");
  const text = atob(document.getElementById("avatar").textContent.trim());
  const packed = Uint8Array.from(text, (c) => c.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

class Viewer {
  constructor(avatar) {
    this.avatar = avatar;
    this.pose = new Pose(avatar);
    this.before = new Pose(avatar);
    this.skin = new Skin(avatar);
    this.binding = new Binding(avatar);
    this.sort = new DepthSort(this.binding.count);
    this.canvas = document.getElementById("stage");
    this.painter = new Painter(this.canvas, avatar, this.binding, this.sort);
    this.camera = new OrbitCamera();
    [this.low, this.high] = bounds(avatar.vertices);
    this.expression = {};
    this.playing = { pose: "T" };
    this.clock = 0;
    this.fade = 1;
    this.turntable = false;
    this.still = false;
    this.background = BACKGROUND;
    this.frames = [];
  }

  play(what) {
    this.before.copy(this.pose);
    this.playing = what;
    this.clock = 0;
    this.fade = 0;
    markPressed(what);
  }

  // seconds: since the last frame.
  step(seconds) {
    this.clock += seconds;
    this.fade = Math.min(1, this.fade + seconds / FADE_S);
    if (this.playing.clip) this.pose.clip(this.playing.clip, this.clock);
    else this.pose.still(this.playing.pose);
    if (this.fade < 1) this.pose.fadeFrom(this.before, this.fade * this.fade * (3 - 2 * this.fade));
    this.skin.update(this.pose, this.expression);
    this.binding.update(this.skin.vertices);
  }

  draw() {
    this.resize();
    const [x, , z] = this.low.map((low, i) => (low + this.high[i]) / 2);
    const shadow = { x, y: this.low[1], z, radius: 0.3 * (this.high[1] - this.low[1]) };
    this.painter.draw(this.camera, colour(this.background), this.still ? null : shadow);
  }

  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, MAX_PIXEL_RATIO);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    const panel = this.still ? 0 : window.innerHeight - document.getElementById("panel").offsetTop;
    this.camera.covered = Math.min(0.5, panel / window.innerHeight);
  }

  run() {
    let last = null;
    const frame = (now) => {
      if (this.still) {
        last = null;
      } else {
        const seconds = last === null ? 0 : Math.min((now - last) / 1000, 0.25);
        if (this.turntable) this.camera.yaw += seconds * 30;
        this.step(seconds);
        this.draw();
        this.count(now);
        last = now;
      }
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  count(now) {
    this.frames.push(now);
    while (this.frames[0] < now - 1000) this.frames.shift();
    if (this.frames.length < 2) return;
    const rate = 1000 * (this.frames.length - 1) / (now - this.frames[0]);
    document.getElementById("fps").textContent = `${rate.toFixed(rate < 10 ? 1 : 0)} fps · ${this.binding.count.toLocaleString("en")} gaussians`;
  }

  // words: the part of the address after #.
  follow(words) {
    const asked = new URLSearchParams(words), number = (name, fallback) => Number.parseFloat(asked.get(name) ?? fallback);
    this.still = asked.has("still");
    document.body.classList.toggle("bare", this.still);
    if (/^[0-9a-f]{6}$/i.test(asked.get("bg") ?? "")) this.background = `#${asked.get("bg")}`;
    this.turntable = asked.has("turntable");
    this.expression = {};
    if (asked.has("expression")) {
      const [name, weight] = asked.get("expression").split(":");
      this.expression[name] = Number.parseFloat(weight ?? "1");
    }
    const first = Object.keys(this.avatar.clips)[0];
    const playing = Object.hasOwn(this.avatar.clips, asked.get("clip")) ? { clip: asked.get("clip") }
      : Object.hasOwn(this.avatar.poses, asked.get("pose")) ? { pose: asked.get("pose") }
        : first ? { clip: first } : { pose: "T" };
    this.play(playing);
    this.fade = 1;
    this.clock = number("t", 0);
    this.step(0);
    this.camera.fov = number("fov", 30);
    this.frame();
    this.camera.yaw = number("yaw", this.camera.yaw);
    this.camera.pitch = number("pitch", this.camera.pitch);
    this.camera.distance = number("dist", this.camera.distance);
    if (asked.has("target")) this.camera.target = asked.get("target").split(",").map(Number);
    this.draw();
  }

  // The whole figure as it stands, from the front.
  frame() {
    this.resize();
    this.camera.frame(...bounds(this.skin.vertices), this.canvas.width / this.canvas.height);
  }
}

function bounds(vertices) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  vertices.forEach((x, i) => {
    low[i % 3] = Math.min(low[i % 3], x);
    high[i % 3] = Math.max(high[i % 3], x);
  });
  return [low, high];
}

function colour(hex) {
  return [1, 3, 5].map((i) => Number.parseInt(hex.slice(i, i + 2), 16) / 255);
}

function markPressed(playing) {
  for (const button of document.querySelectorAll("#poses button")) {
    button.setAttribute("aria-pressed", String(button.dataset.pose === playing.pose && button.dataset.clip === playing.clip));
  }
}

// Returns what makes the controls show the viewer's state.
function addControls(viewer) {
  const find = (id) => document.getElementById(id);
  const button = (text, what) => {
    const element = document.createElement("button");
    element.textContent = text;
    Object.assign(element.dataset, what);
    element.addEventListener("click", () => viewer.play(what));
    find("poses").append(element);
  };
  for (const clip of Object.keys(viewer.avatar.clips)) button(clip[0].toUpperCase() + clip.slice(1), { clip });
  for (const pose of Object.keys(viewer.avatar.poses).sort()) button(`${pose}-pose`, { pose });
  const showTurntable = () => find("turntable").setAttribute("aria-pressed", String(viewer.turntable));
  find("turntable").addEventListener("click", () => {
    viewer.turntable = !viewer.turntable;
    showTurntable();
  });
  find("reset").addEventListener("click", () => viewer.frame());
  find("background").addEventListener("input", (e) => { viewer.background = e.target.value; });
  for (const name of viewer.avatar.expressions) find("expression").append(new Option(name));
  find("faces").hidden = viewer.avatar.expressions.length === 0;
  const express = () => { viewer.expression = { [find("expression").value]: Number(find("weight").value) }; };
  find("weight").addEventListener("input", express);
  find("expression").addEventListener("change", express);
  viewer.camera.listen(viewer.canvas, () => {
    viewer.turntable = false;
    showTurntable();
  });
  return () => {
    showTurntable();
    markPressed(viewer.playing);
    find("background").value = viewer.background;
  };
}

function tell(error) {
  const box = document.getElementById("message");
  box.textContent = `The avatar cannot be shown: ${error.message}`;
  box.hidden = false;
  console.error(error);
}

async function main() {
  const viewer = new Viewer(readAvatar(await inlinedAvatar()));
  window.gsac = viewer;
  const showState = addControls(viewer);
  const follow = () => {
    viewer.follow(location.hash.slice(1));
    showState();
  };
  follow();
  window.addEventListener("hashchange", follow);
  viewer.canvas.addEventListener("webglcontextlost", () => {
    tell(new Error("the graphics driver stopped; please reload the page"));
  });
  viewer.run();
  document.documentElement.dataset.ready = "yes";
}

main().catch(tell);

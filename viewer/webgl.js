// Draws the gaussians with WebGL2: four corners each in one indexed draw, blended from the farthest to the nearest.
// The trainer's rule: covariance + lowPass (the opacity falls as much as the area grows by it, if it keeps energy),
// alpha = min(alphaMax, opacity exp(-s)), nothing below alphaMin.

import { Binding } from "./binding.js";
import { indexQuads } from "./pack.js";
import { NEAR, WIDE } from "./projection.js";
import { DepthSort } from "./sort.js";

const SPLAT_VERTEX = `precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
uniform sampler2D gaussians;
uniform sampler2D colours;
uniform usampler2D order;
uniform vec4 view[3];
uniform vec2 size;
uniform vec2 focal;
uniform vec2 centre;
uniform vec4 blend; // lowPass, alphaMax, alphaMin, 1 if the low-pass keeps energy
uniform vec2 depth;
out vec4 colour;
out vec2 sigmas;

void main() {
  int rank = gl_VertexID >> 2;
  int id = int(texelFetch(order, ivec2(rank % ORDER_ROW, rank / ORDER_ROW), 0).r);
  ivec2 at = ivec2(id % DATA_ROW, id / DATA_ROW);
  vec4 d0 = texelFetch(gaussians, ivec2(at.x * 3, at.y), 0);
  vec4 d1 = texelFetch(gaussians, ivec2(at.x * 3 + 1, at.y), 0);
  vec4 d2 = texelFetch(gaussians, ivec2(at.x * 3 + 2, at.y), 0);
  colour = texelFetch(colours, at, 0);
  colour.rgb *= d2.yzw;
  sigmas = vec2(0);
  gl_Position = vec4(0, 0, 2, 1);
  vec4 p = vec4(d0.xyz, 1);
  vec3 c = vec3(dot(view[0], p), dot(view[1], p), dot(view[2], p));
  if (c.z < NEAR) return;

  mat3 world = mat3(d0.w, d1.x, d1.y, d1.x, d1.z, d1.w, d1.y, d1.w, d2.x);
  vec2 tangent = clamp(c.xy / c.z, -WIDE * size / (2.0 * focal), WIDE * size / (2.0 * focal));
  vec3 row0 = (view[0].xyz - tangent.x * view[2].xyz) * (focal.x / c.z);
  vec3 row1 = (view[1].xyz - tangent.y * view[2].xyz) * (focal.y / c.z);
  vec3 side0 = world * row0;
  float xx = dot(row0, side0), xy = dot(row1, side0), yy = dot(row1, world * row1), bare = max(xx * yy - xy * xy, 0.0);
  if (blend.w > 0.5) colour.a *= sqrt(bare / max(bare + blend.x * (xx + yy + blend.x), 1e-12));
  if (colour.a < blend.z) return;
  xx += blend.x;
  yy += blend.x;

  float middle = 0.5 * (xx + yy), spread = length(vec2(0.5 * (xx - yy), xy));
  float large = middle + spread, small = max(middle - spread, 1e-6);
  vec2 axis = spread < 1e-6 * middle ? vec2(1, 0) : normalize(xx > yy ? vec2(large - yy, xy) : vec2(xy, large - xx));
  float reach = sqrt(2.0 * log(colour.a / blend.z)) + 1e-3;
  sigmas = reach * vec2((gl_VertexID & 1) * 2 - 1, (gl_VertexID & 2) - 1);
  vec2 offset = sigmas.x * sqrt(large) * axis + sigmas.y * sqrt(small) * vec2(-axis.y, axis.x);
  vec2 pixel = focal * c.xy / c.z + offset + centre;
  gl_Position = vec4(2.0 * pixel / size * vec2(1, -1), DEPTH, 1);
}`;

const SPLAT_FRAGMENT = `precision highp float;
uniform vec4 blend;
in vec4 colour;
in vec2 sigmas;
out vec4 pixel;

void main() {
  float alpha = min(blend.y, colour.a * exp(-0.5 * dot(sigmas, sigmas)));
  if (alpha < blend.z) discard;
  pixel = vec4(colour.rgb * alpha, alpha);
}`;

const FLOOR_VERTEX = `#version 300 es
precision highp float;
uniform vec4 view[3];
uniform vec2 size;
uniform vec2 focal;
uniform vec2 centre;
uniform vec4 disc;
out vec2 place;

void main() {
  place = vec2((gl_VertexID & 1) * 2 - 1, (gl_VertexID & 2) - 1);
  vec4 p = vec4(disc.x + place.x * disc.w, disc.y, disc.z + place.y * disc.w, 1);
  vec3 c = vec3(dot(view[0], p), dot(view[1], p), dot(view[2], p));
  gl_Position = vec4(2.0 * (focal * c.xy + centre * c.z) / size * vec2(1, -1), 0, c.z);
}`;

const FLOOR_FRAGMENT = `#version 300 es
precision highp float;
uniform float strength;
in vec2 place;
out vec4 pixel;

void main() {
  float r = length(place);
  pixel = vec4(0, 0, 0, strength * smoothstep(1.0, 0.0, r) * smoothstep(1.0, 0.0, r));
}`;

/**
 * The gaussians' shaders, without the line of their version.
 * @param {string} depth in words of the shader: where a gaussian lies between near and far
 */
export function splatShaders(depth) {
  const constants = { ORDER_ROW: DepthSort.PER_ROW, DATA_ROW: Binding.PER_ROW, NEAR: NEAR.toFixed(3), WIDE: WIDE.toFixed(3),
    DEPTH: depth };
  const vertex = Object.entries(constants).reduce((text, [name, value]) => text.replaceAll(name, String(value)), SPLAT_VERTEX);
  return { vertex, fragment: SPLAT_FRAGMENT };
}

/**
 * Colours and opacities of a level, as the shaders read them.
 * @param {Binding} binding
 */
export function fillColours({ count, rows, level: { rgb, opacity } }) {
  const colours = new Float32Array(rows * Binding.PER_ROW * 4);
  for (let i = 0; i < count; i++) {
    colours.set(rgb.subarray(i * 3, i * 3 + 3), i * 4);
    colours[i * 4 + 3] = opacity[i];
  }
  return colours;
}

export class WebglRenderer {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {import("./reader.js").Avatar} avatar
   * @param {import("./levels.js").Levels} levels
   */
  constructor(canvas, avatar, levels) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: false,
      powerPreference: "high-performance" });
    if (!gl) throw new Error("this browser offers no WebGL2, which the viewer draws with");
    this.kind = "webgl";
    this.gl = gl;
    this.levels = levels;
    // Whose colours the card has.
    /** @type {Binding | null} */
    this.coloured = null;
    /** @type {(why: string) => void} */
    this.onLost = () => {};
    canvas.addEventListener("webglcontextlost", () => this.onLost("the graphics driver stopped"));
    const { lowPass, alphaMax, alphaMin, keepsEnergy } = avatar.blend;
    this.blend = [lowPass, alphaMax, alphaMin, Number(keepsEnergy)];
    const { vertex, fragment } = splatShaders("0.0");
    this.splats = this.program(`#version 300 es\n${vertex}`, `#version 300 es\n${fragment}`);
    this.floor = this.program(FLOOR_VERTEX, FLOOR_FRAGMENT);
    const rows = Math.max(...levels.bindings.map((binding) => binding.rows));
    this.gaussians = this.texture(gl.RGBA32F, Binding.PER_ROW * 3, rows);
    this.order = this.texture(gl.R32UI, DepthSort.PER_ROW, Math.max(...levels.sorts.map((sort) => sort.rows)));
    this.colours = this.texture(gl.RGBA32F, Binding.PER_ROW, rows);
    gl.bindVertexArray(gl.createVertexArray());
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indexQuads(Math.max(...levels.bindings.map((binding) => binding.count))), gl.STATIC_DRAW);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  // Compiles a vertex and a fragment shader. Returns the program and the places of its uniforms by name.
  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    /** @type {Object<string, WebGLUniformLocation>} */
    const places = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const name = gl.getActiveUniform(program, i).name.replace("[0]", "");
      places[name] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  // An empty texture, read texel by texel.
  texture(format, width, height) {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return texture;
  }

  // Fills a texture from its first row.
  fill(texture, width, height, format, type, data) {
    const gl = this.gl;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, format, type, data);
  }

  // Sorts and uploads the gaussians; view: as Eye's.
  prepare(view) {
    const { gl, levels: { binding, sort } } = this;
    sort.update(binding.data, view);
    if (this.coloured !== binding) this.upload(binding);
    this.fill(this.gaussians, Binding.PER_ROW * 3, binding.rows, gl.RGBA, gl.FLOAT, binding.data);
    this.fill(this.order, DepthSort.PER_ROW, sort.rows, gl.RED_INTEGER, gl.UNSIGNED_INT, sort.order);
  }

  // Uploads the colours and opacities of a level.
  upload(binding) {
    const { gl } = this;
    this.fill(this.colours, Binding.PER_ROW, binding.rows, gl.RGBA, gl.FLOAT, fillColours(binding));
    this.coloured = binding;
  }

  clear(background) {
    const { gl } = this, [red, green, blue, alpha] = background;
    gl.clearColor(red, green, blue, alpha);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  /**
   * @param {import("./camera.js").Eye} eye
   * @param {import("./viewer.js").Shadow | null} shadow
   */
  paint(eye, shadow) {
    const { gl } = this;
    gl.viewport(...eye.box);
    if (shadow) {
      this.use(this.floor, eye);
      gl.uniform4f(this.floor.places.disc, shadow.x, shadow.y, shadow.z, shadow.radius);
      gl.uniform1f(this.floor.places.strength, shadow.strength);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
    this.use(this.splats, eye);
    const places = this.splats.places;
    gl.uniform4fv(places.blend, this.blend);
    [this.gaussians, this.colours, this.order].forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i([places.gaussians, places.colours, places.order][unit], unit);
    });
    gl.activeTexture(gl.TEXTURE0);
    gl.drawElements(gl.TRIANGLES, this.levels.binding.count * 6, gl.UNSIGNED_INT, 0);
  }

  use(program, eye) {
    const { gl } = this, { places } = program;
    gl.useProgram(program.program);
    gl.uniform4fv(places.view, eye.view);
    gl.uniform2f(places.size, eye.box[2], eye.box[3]);
    gl.uniform2fv(places.focal, eye.focal);
    gl.uniform2fv(places.centre, eye.centre);
  }
}

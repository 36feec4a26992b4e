// The avatar as an object of three.js: its gaussians in one draw among the other objects, hidden by what is nearer.

import { AddEquation, BufferAttribute, BufferGeometry, CustomBlending, DataTexture, DoubleSide, FloatType, GLSL3, Mesh,
  NearestFilter, OneFactor, OneMinusSrcAlphaFactor, RawShaderMaterial, RedIntegerFormat, RGBAFormat, Sphere, UnsignedIntType,
  Vector2, Vector3, Vector4 } from "three";

import { Binding } from "./binding.js";
import { Levels } from "./levels.js";
import { indexQuads } from "./pack.js";
import { readAvatar } from "./reader.js";
import { Pose, Skin } from "./skin.js";
import { DepthSort } from "./sort.js";
import { fillColours, splatShaders } from "./webgl.js";

/** @param {ArrayBufferView} data */
function texture(data, width, height, format, type, internal) {
  const made = new DataTexture(/** @type {any} */ (data), width, height, format, type);
  made.internalFormat = internal;
  made.minFilter = made.magFilter = NearestFilter;
  made.needsUpdate = true;
  return made;
}

export class GsacObject extends Mesh {
  /** @param {ArrayBuffer} bytes of avatar.gsac */
  constructor(bytes) {
    const avatar = readAvatar(bytes), { lowPass, alphaMax, alphaMin, keepsEnergy } = avatar.blend;
    const ys = avatar.vertices.filter((_, i) => i % 3 === 1), ground = ys.reduce((a, b) => Math.min(a, b), Infinity);
    const stature = ys.reduce((a, b) => Math.max(a, b), -Infinity) - ground, levels = new Levels(avatar, stature);
    const geometry = new BufferGeometry(), { vertex, fragment } = splatShaders(DEPTH);
    geometry.setIndex(new BufferAttribute(indexQuads(Math.max(...levels.bindings.map((binding) => binding.count))), 1));
    geometry.boundingSphere = new Sphere(new Vector3(0, stature / 2, 0), stature);
    const uniforms = { gaussians: { value: null }, colours: { value: null }, order: { value: null },
      view: { value: [new Vector4(), new Vector4(), new Vector4()] }, size: { value: new Vector2() },
      focal: { value: new Vector2() }, centre: { value: new Vector2() },
      blend: { value: new Vector4(lowPass, alphaMax, alphaMin, Number(keepsEnergy)) }, depth: { value: new Vector2() } };
    super(geometry, new RawShaderMaterial({ uniforms, vertexShader: vertex, fragmentShader: fragment, glslVersion: GLSL3,
      transparent: true, side: DoubleSide, depthWrite: false, premultipliedAlpha: true, blending: CustomBlending,
      blendEquation: AddEquation,
      blendSrc: OneFactor, blendDst: OneMinusSrcAlphaFactor }));
    this.avatar = avatar;
    this.ground = ground;
    this.levels = levels;
    this.pose = new Pose(avatar);
    this.skin = new Skin(avatar);
    this.uniforms = uniforms;
    this.looks = levels.bindings.map((binding, n) => ({
      gaussians: texture(binding.data, Binding.PER_ROW * 3, binding.rows, RGBAFormat, FloatType, "RGBA32F"),
      colours: texture(fillColours(binding), Binding.PER_ROW, binding.rows, RGBAFormat, FloatType, "RGBA32F"),
      order: texture(levels.sorts[n].order, DepthSort.PER_ROW, levels.sorts[n].rows, RedIntegerFormat, UnsignedIntType, "R32UI"),
    }));
    this.expression = {};
    this.turned = {};
    this.clock = 0;
    this.playing = this.poses.includes("A") ? "A" : "T";
    this.viewport = new Vector4();
    this.update(0);
  }

  get clips() {
    return Object.keys(this.avatar.clips);
  }

  get poses() {
    return Object.keys(this.avatar.poses).sort();
  }

  get expressions() {
    return this.avatar.expressions;
  }

  get joints() {
    return this.avatar.names;
  }

  // Plays a motion or a pose by its name.
  play(name) {
    const known = [...this.poses, ...this.clips];
    if (!known.includes(name)) throw new Error(`${name}: this avatar has ${known.join(", ")}`);
    this.playing = name;
    this.clock = 0;
  }

  // Goes on by some seconds.
  update(seconds) {
    const { avatar, pose, skin, levels } = this;
    this.clock += seconds;
    if (this.clips.includes(this.playing)) pose.clip(this.playing, this.clock);
    else pose.still(this.playing);
    for (const [joint, degrees] of Object.entries(this.turned)) {
      const [x, y, z] = degrees.map((d) => d * Math.PI / 180);
      pose.turn(avatar.names.indexOf(joint), x, y, z);
    }
    skin.update(pose, this.expression);
    this.place();
    this.geometry.boundingSphere.center.set(pose.transl[0], pose.transl[1] + levels.stature / 2, pose.transl[2]);
  }

  // Places the gaussians of the level that is drawn.
  place() {
    const { levels } = this, look = this.looks[levels.drawn];
    levels.update(this.skin.vertices);
    look.gaussians.needsUpdate = true;
    for (const name of Object.keys(look)) this.uniforms[name].value = look[name];
    this.geometry.setDrawRange(0, levels.binding.count * 6);
  }

  // Sorts for the camera that three draws next.
  onBeforeRender(renderer, scene, camera) {
    const { uniforms, levels, skin, ground } = this;
    const e = this.modelViewMatrix.multiplyMatrices(camera.matrixWorldInverse, this.matrixWorld).elements;
    const p = camera.projectionMatrix.elements, view = new Float32Array(12);
    [1, -1, -1].forEach((sign, r) => {
      const [x, y, z, t] = [0, 4, 8, 12].map((c) => sign * e[c + r]);
      view.set([x, y, z, t - y * ground], r * 4);
      uniforms.view.value[r].fromArray(view, r * 4);
    });
    const { z: width, w: height } = renderer.getCurrentViewport(this.viewport);
    uniforms.size.value.set(width, height);
    uniforms.focal.value.set(p[0] * width / 2, p[5] * height / 2);
    uniforms.centre.value.set(-p[8] * width / 2, p[9] * height / 2);
    uniforms.depth.value.set(p[10], p[14]);
    const focal = /** @type {[number, number]} */ (uniforms.focal.value.toArray());
    if (levels.choose(levels.height({ view, focal, centre: [0, 0], box: [0, 0, width, height] }, skin))) this.place();
    levels.sort.update(levels.binding.data, view);
    this.looks[levels.drawn].order.needsUpdate = true;
    /** @type {RawShaderMaterial} */ (this.material).uniformsNeedUpdate = true;
  }

  dispose() {
    this.geometry.dispose();
    /** @type {RawShaderMaterial} */ (this.material).dispose();
    for (const look of this.looks) for (const each of Object.values(look)) each.dispose();
  }
}

// Depth of a gaussian's middle as three writes it; uniform depth: of the camera's projection, row 2, columns 2 and 3.
const DEPTH = "(depth.y - depth.x * c.z) / c.z";

// Skins, binds, sorts and draws on the graphics card through WebGPU, by the shaders that Unity runs (shaders.js).
// Nothing is read back: a frame sends the bones, the expression's weights and the eye.

import { EVEN_LIGHT } from "./binding.js";
import { reachDevice } from "./device.js";
import { indexQuads, packBody, packCorrectives, packLevel } from "./pack.js";
import { transformPoint } from "./projection.js";
import { SHADERS } from "./shaders.js";

// As in Gsac.compute: a group sorts 2^SORT_BLOCK_BITS keys at once, a thread of SortAcross SORT_HAND.
const SORT_BLOCK_BITS = 12;
const SORT_HAND = 16;
const SKIN_THREADS = 64;
const ACROSS_THREADS = 64;
// WebGPU wants the parameters of two dispatches this far apart.
const PARAMETER_BYTES = 256;
// A driver that does not answer within this time is not used.
const ANSWER_MS = 10000;
const PREMULTIPLIED = /** @type {const} */ ({ srcFactor: "one", dstFactor: "one-minus-src-alpha", operation: "add" });

/**
 * One dispatch of a compute shader; stage, shift and strides: of a step of the sort.
 * @typedef {{entry: string, groups: number, stage?: number, shift?: number, strides?: number}} Dispatch
 */

export class WebgpuRenderer {
  /**
   * Returns null where there is no graphics card to reach; asked: a software one will do.
   * @param {HTMLCanvasElement} canvas
   * @param {import("./reader.js").Avatar} avatar
   * @param {import("./skin.js").Skin} skin
   * @param {import("./levels.js").Levels} levels
   * @param {boolean} asked
   */
  static async open(canvas, avatar, skin, levels, asked) {
    const late = /** @type {Promise<null>} */ (new Promise((done) => setTimeout(done, ANSWER_MS, null)));
    const device = await Promise.race([reachDevice(asked), late]);
    if (!device) return null;
    device.pushErrorScope("validation");
    let renderer;
    try {
      renderer = new WebgpuRenderer(device, canvas, avatar, skin, levels);
      await renderer.build();
      const wrong = await device.popErrorScope();
      if (wrong) throw new Error(wrong.message);
    } catch (error) {
      device.destroy();
      throw error;
    }
    device.lost.then(({ message }) => renderer.onLost(message));
    device.addEventListener("uncapturederror", ({ error }) => renderer.onLost(error.message));
    return renderer;
  }

  // Use `open`.
  constructor(device, canvas, avatar, skin, levels) {
    this.kind = "webgpu";
    /** @type {GPUDevice} */
    this.device = device;
    /** @type {import("./reader.js").Avatar} */
    this.avatar = avatar;
    this.skin = skin;
    /** @type {import("./levels.js").Levels} */
    this.levels = levels;
    /** @type {(why: string) => void} */
    this.onLost = () => {};
    this.reach = jointReach(avatar, levels.bindings);
    this.background = [0, 0, 0, 1];
    this.context = canvas.getContext("webgpu");
    this.format = navigator.gpu.getPreferredCanvasFormat();
    this.context.configure({ device, format: this.format, alphaMode: "opaque" });
    const { names, vertices, expressions } = avatar, size = (bytes) => new Uint8Array(Math.max(bytes, 16));
    this.weights = new Float32Array(Math.max(expressions.length, 4));
    const counts = avatar.levels.map((level) => level.face.length), sorts = counts.map(planSort), most = Math.max(...counts);
    this.buffers = this.upload({ ...packBody(avatar), GsacWeights: this.weights, GsacBones: size(names.length * 48),
      GsacPosed: size(vertices.length / 3 * 16), GsacSplats: size(most * 48),
      GsacKeys: size(Math.max(...sorts.map((sort) => sort.keys)) * 4) });
    // Where there are pose correctives, Correct makes of the rest places those that Skin takes.
    if (avatar.correctives) {
      Object.assign(this.buffers, this.upload({ ...packCorrectives(avatar), GsacTurns: skin.turns,
        GsacBent: size(vertices.length / 3 * 16) }));
    }
    this.corners = this.buffer(indexQuads(most), GPUBufferUsage.INDEX);
    // What draws each level of detail.
    this.plans = avatar.levels.map((level, i) => {
      const skinGroups = Math.ceil(vertices.length / 3 / SKIN_THREADS);
      /** @type {Dispatch[]} */
      const dispatches = [...(avatar.correctives ? [{ entry: "Correct", groups: skinGroups }] : []),
        { entry: "Skin", groups: skinGroups },
        { entry: "Bind", groups: Math.ceil(counts[i] / SKIN_THREADS) }, ...sorts[i].steps];
      return { count: counts[i], indexBits: sorts[i].indexBits, dispatches,
        buffers: { ...this.buffers, ...this.upload(packLevel(avatar, level)) } };
    });
    this.dispatchParameters = new ArrayBuffer(Math.max(...this.plans.map((plan) => plan.dispatches.length)) * PARAMETER_BYTES);
    this.dispatchBuffer = this.buffer(new Uint8Array(this.dispatchParameters), GPUBufferUsage.UNIFORM);
    this.eyeParameters = new ArrayBuffer(PARAMETER_BYTES);
    this.eyeBuffer = this.buffer(new Uint8Array(this.eyeParameters), GPUBufferUsage.UNIFORM);
  }

  // Buffers by name, from arrays by name.
  upload(arrays) {
    return Object.fromEntries(Object.entries(arrays).map(([name, data]) => [name, this.buffer(data)]));
  }

  // A buffer on the graphics card that begins as `data`.
  buffer(data, usage = GPUBufferUsage.STORAGE) {
    const size = Math.max(16, Math.ceil(data.byteLength / 4) * 4);
    const made = this.device.createBuffer({ size, usage: usage | GPUBufferUsage.COPY_DST });
    this.device.queue.writeBuffer(made, 0, data);
    return made;
  }

  // Compiles the shaders and joins them with their buffers.
  async build() {
    const { device } = this, module = (entry) => device.createShaderModule({ code: SHADERS[entry].code });
    const kernel = (entry) => device.createComputePipelineAsync({ layout: "auto",
      compute: { module: module(entry), entryPoint: entry } });
    const entries = [...new Set(this.plans.flatMap((plan) => plan.dispatches.map(({ entry }) => entry)))];
    const draw = (name, topology) => device.createRenderPipelineAsync({ layout: "auto",
      vertex: { module: module(`${name}Vertex`), entryPoint: `${name}Vertex` },
      fragment: { module: module(`${name}Fragment`), entryPoint: `${name}Fragment`,
        targets: [{ format: this.format, blend: { color: PREMULTIPLIED, alpha: PREMULTIPLIED } }] },
      primitive: { topology } });
    const [splats, floor, kernels] = await Promise.all(
      [draw("Splat", "triangle-list"), draw("Floor", "triangle-strip"), Promise.all(entries.map(kernel))]);
    // Each dispatch of each level, and what draws the level.
    this.kernels = this.plans.map(({ dispatches, buffers }) => dispatches.map(({ entry }, i) => {
      const pipeline = kernels[entries.indexOf(entry)], parameters = { buffer: this.dispatchBuffer, offset: i * PARAMETER_BYTES,
        size: PARAMETER_BYTES };
      const bent = entry === "Skin" && buffers.GsacBent ? { GsacRest: buffers.GsacBent } : {};
      return { pipeline, group: this.group(pipeline, entry, { ...buffers, ...bent, parameters }) };
    }));
    const parameters = { buffer: this.eyeBuffer };
    this.splats = this.plans.map(({ buffers }) => ({ pipeline: splats,
      group: this.group(splats, "SplatVertex", { ...buffers, parameters }) }));
    this.floor = { pipeline: floor, group: this.group(floor, "FloorVertex", { parameters }) };
  }

  // Binds what a shader's entry point reads. resources: buffers by name; parameters: what its uniform block is bound to.
  group(pipeline, entry, resources) {
    const entries = Object.entries(SHADERS[entry].bindings).map(([name, binding]) =>
      ({ binding, resource: name === "parameters" ? resources.parameters : { buffer: resources[name] } }));
    return this.device.createBindGroup({ layout: pipeline.getBindGroupLayout(0), entries });
  }

  // Sends the skin's bones, what the pose's correctives move, and the expression's weights, by name.
  move(expression) {
    this.avatar.expressions.forEach((name, e) => { this.weights[e] = expression[name] || 0; });
    this.device.queue.writeBuffer(this.buffers.GsacBones, 0, this.skin.bones);
    if (this.avatar.correctives) this.device.queue.writeBuffer(this.buffers.GsacTurns, 0, this.skin.turns);
    this.device.queue.writeBuffer(this.buffers.GsacWeights, 0, this.weights);
  }

  // Poses and sorts the gaussians; view: as Eye's.
  prepare(view) {
    const { avatar, levels, device } = this, [near, far] = this.depths(view), plan = this.plans[levels.drawn];
    const light = (levels.lit && avatar.light) || EVEN_LIGHT;
    const { rows } = levels.scene, row = (n) => rows.subarray(4 * n, 4 * n + 4);
    const along = (c) => [light[3 + c], light[6 + c], light[9 + c], light[c]];
    plan.dispatches.forEach(({ entry, stage = 0, shift = 0, strides = 0 }, i) => {
      setParameters(this.dispatchParameters, i * PARAMETER_BYTES, SHADERS[entry].parameters, {
        GsacVertexCount: avatar.vertices.length / 3, GsacSplatCount: plan.count, GsacIndexBits: plan.indexBits,
        GsacSortStage: stage, GsacSortShift: shift, GsacSortStrides: strides, GsacDepthRange: [near, 1 / (far - near)],
        GsacDepthRow: view.subarray(8, 12), GsacLightRed: along(0), GsacLightGreen: along(1), GsacLightBlue: along(2),
        GsacSceneRed: row(0), GsacSceneGreen: row(1), GsacSceneBlue: row(2), GsacSceneRed2: row(3), GsacSceneGreen2: row(4),
        GsacSceneBlue2: row(5), GsacSceneLast: row(6) });
    });
    device.queue.writeBuffer(this.dispatchBuffer, 0, this.dispatchParameters);
    this.encoder = device.createCommandEncoder();
    const pass = this.encoder.beginComputePass();
    plan.dispatches.forEach(({ groups }, i) => {
      const { pipeline, group } = this.kernels[levels.drawn][i];
      pass.setPipeline(pipeline);
      pass.setBindGroup(0, group);
      pass.dispatchWorkgroups(groups);
    });
    pass.end();
  }

  // The least and greatest depth that the gaussians can have.
  depths(view) {
    const range = [Infinity, -Infinity];
    this.reach.forEach((reach, j) => {
      if (reach === 0) return;
      const [, , depth] = transformPoint(view, this.skin.place(j));
      range[0] = Math.min(range[0], depth - reach);
      range[1] = Math.max(range[1], depth + reach);
    });
    return range;
  }

  clear(background) {
    this.background = background;
  }

  /**
   * Once after `prepare`.
   * @param {import("./camera.js").Eye} eye
   * @param {import("./viewer.js").Shadow | null} shadow
   */
  paint({ view, focal, centre, box: [, , width, height] }, shadow) {
    const { device, avatar: { blend: { lowPass, alphaMax, alphaMin, keepsEnergy } } } = this;
    const { count, indexBits } = this.plans[this.levels.drawn], splats = this.splats[this.levels.drawn];
    setParameters(this.eyeParameters, 0, SHADERS.SplatVertex.parameters, {
      GsacModel0: [1, 0, 0, 0], GsacModel1: [0, 1, 0, 0], GsacModel2: [0, 0, 1, 0], GsacBlend: [lowPass, alphaMax, alphaMin, 0],
      GsacKeepsEnergy: Number(keepsEnergy), GsacIndexBits: indexBits,
      PageView0: view.subarray(0, 4), PageView1: view.subarray(4, 8).map((x) => -x), PageView2: view.subarray(8, 12).map((x) => -x),
      PageLens: [2 * focal[0] / width, 2 * focal[1] / height, -2 * centre[0] / width, 2 * centre[1] / height],
      PageDisc: shadow ? [shadow.x, shadow.y, shadow.z, shadow.radius] : [0, 0, 0, 0],
      PageInk: [width, height, shadow ? shadow.strength : 0, 0] });
    device.queue.writeBuffer(this.eyeBuffer, 0, this.eyeParameters);
    const pass = this.encoder.beginRenderPass({ colorAttachments: [{ view: this.context.getCurrentTexture().createView(),
      clearValue: this.background, loadOp: "clear", storeOp: "store" }] });
    if (shadow) {
      pass.setPipeline(this.floor.pipeline);
      pass.setBindGroup(0, this.floor.group);
      pass.draw(4);
    }
    pass.setPipeline(splats.pipeline);
    pass.setBindGroup(0, splats.group);
    pass.setIndexBuffer(this.corners, "uint32");
    pass.drawIndexed(count * 6);
    pass.end();
    device.queue.submit([this.encoder.finish()]);
  }
}

// Writes a uniform block. places: parameter -> byte after `start`; values: an integer or a list of floats for each.
function setParameters(block, start, places, values) {
  for (const [name, at] of Object.entries(places)) {
    if (typeof values[name] === "number") new Uint32Array(block, start + at, 1)[0] = values[name];
    else new Float32Array(block, start + at, values[name].length).set(values[name]);
  }
}

// The bitonic sorting network of Gsac.compute over at least `count` keys, as Unity's GsacSort.cs runs it.
function planSort(count) {
  const block = 1 << SORT_BLOCK_BITS;
  let keys = block, merges = 0, indexBits = 1;
  for (; keys < count; merges++) keys *= 2;
  while (indexBits < 31 && 2 ** indexBits < count) indexBits++;
  /** @type {Dispatch[]} */
  const steps = [{ entry: "SortBlocks", groups: keys / block }];
  for (let m = 1; m <= merges; m++) {
    const stage = block * 2 ** m;
    for (let left = m; left > 0; left -= 4) {
      steps.push({ entry: "SortAcross", stage, shift: SORT_BLOCK_BITS + left - 4,
        strides: (SORT_HAND - 1) ^ ((SORT_HAND - 1) >> Math.min(left, 4)), groups: keys / SORT_HAND / ACROSS_THREADS });
    }
    steps.push({ entry: "SortMerge", stage, groups: keys / block });
  }
  return { keys, indexBits, steps };
}

// The greatest distance of gaussians from a joint that moves them, m, by joint: however the joints turn, a skinned vertex stays
// in the hull of balls around its joints; gaussians are let stand half as far again off the mesh as at rest.
function jointReach(avatar, bindings) {
  const { vertices, faces, joints, names, skinIndex, skinWeight, moved, delta, correctives } = avatar;
  const reach = new Float64Array(names.length), far = new Float64Array(vertices.length / 3);
  const length = (x, y, z) => Math.hypot(x, y, z);
  for (let i = 0; i < moved.length; i++) far[moved[i]] += length(...delta.subarray(i * 3, i * 3 + 3));
  if (correctives) {
    const { start, delta } = correctives;
    // A rotation less the identity has at most the norm of half a turn, the root of 8.
    for (let v = 0; v < far.length; v++) {
      for (let i = start[v]; i < start[v + 1]; i++) far[v] += Math.sqrt(8) * Math.hypot(...delta.subarray(i * 27, i * 27 + 27));
    }
  }
  for (let k = 0; k < skinIndex.length; k++) {
    if (skinWeight[k] === 0) continue;
    const v = k >> 2, j = skinIndex[k];
    reach[j] = Math.max(reach[j], far[v] + length(...[0, 1, 2].map((c) => vertices[v * 3 + c] - joints[j * 3 + c])));
  }
  let beyond = 0;
  for (const binding of bindings) {
    binding.update(vertices, false);
    const { data, level: { face } } = binding;
    for (let i = 0; i < face.length; i++) {
      const corner = faces[face[i] * 3] * 3;
      beyond = Math.max(beyond, length(...[0, 1, 2].map((c) => data[i * 12 + c] - vertices[corner + c])));
    }
  }
  return reach.map((r) => (r > 0 ? r + 1.5 * beyond : 0));
}

// Skins, binds, sorts and draws on the graphics card through WebGPU, by the shaders that Unity runs (shaders.js).
// Nothing is read back: a frame sends the bones, the expression's weights and the eye.

import { EVEN_LIGHT } from "./binding.js";
import { reachDevice } from "./device.js";
import { packForGpu } from "./pack.js";
import { SHADOW } from "./projection.js";
import { SHADERS } from "./shaders.js";

const SORT_BLOCK_BITS = 12;
const SORT_HAND = 16;
const SKIN_THREADS = 64;
const ACROSS_THREADS = 64;
// Parameters of one dispatch; WebGPU wants them this far apart.
const PARAMETER_BYTES = 256;
// A driver that takes longer to answer is left alone.
const ANSWER_MS = 10000;
const PREMULTIPLIED = { srcFactor: "one", dstFactor: "one-minus-src-alpha", operation: "add" };

export class WebgpuRenderer {
  // Returns null where there is no graphics card to reach; asked: a software one will do.
  static async open(canvas, avatar, skin, binding, asked) {
    const late = new Promise((done) => setTimeout(done, ANSWER_MS, null)), device = await Promise.race([reachDevice(asked), late]);
    if (!device) return null;
    device.pushErrorScope("validation");
    const renderer = new WebgpuRenderer(device, canvas, avatar, skin, binding);
    await renderer.build();
    const wrong = await device.popErrorScope();
    if (wrong) throw new Error(wrong.message);
    device.lost.then(({ message }) => renderer.onLost(message));
    device.addEventListener("uncapturederror", ({ error }) => renderer.onLost(error.message));
    return renderer;
  }

  constructor(device, canvas, avatar, skin, binding) {
    Object.assign(this, { kind: "webgpu", device, canvas, avatar, skin, binding, sort: sortSteps(binding.count), onLost: () => {} });
    this.reach = reachOf(avatar, binding);
    this.background = [0, 0, 0, 1];
    this.context = canvas.getContext("webgpu");
    this.format = navigator.gpu.getPreferredCanvasFormat();
    this.context.configure({ device, format: this.format, alphaMode: "opaque" });
    this.buffers = Object.fromEntries(Object.entries(packForGpu(avatar)).map(([name, data]) => [name, this.buffer(data)]));
    const { names, vertices, expressions } = avatar, size = (bytes) => new Uint8Array(Math.max(bytes, 16));
    this.weights = new Float32Array(Math.max(expressions.length, 4));
    Object.assign(this.buffers, { GsacWeights: this.buffer(this.weights), GsacBones: this.buffer(size(names.length * 48)),
      GsacPosed: this.buffer(size(vertices.length / 3 * 16)), GsacSplats: this.buffer(size(binding.count * 48)),
      GsacKeys: this.buffer(size(this.sort.keys * 4)) });
    const corners = new Uint32Array(binding.count * 6);
    for (let i = 0; i < binding.count; i++) corners.set([0, 1, 2, 2, 1, 3].map((c) => i * 4 + c), i * 6);
    this.corners = this.buffer(corners, GPUBufferUsage.INDEX);
    this.jobs = [{ entry: "Skin", groups: Math.ceil(vertices.length / 3 / SKIN_THREADS) },
      { entry: "Bind", groups: Math.ceil(binding.count / SKIN_THREADS) }, ...this.sort.steps];
    this.jobParameters = new ArrayBuffer(this.jobs.length * PARAMETER_BYTES);
    this.jobBuffer = this.buffer(new Uint8Array(this.jobParameters), GPUBufferUsage.UNIFORM);
    this.eyeParameters = new ArrayBuffer(PARAMETER_BYTES);
    this.eyeBuffer = this.buffer(new Uint8Array(this.eyeParameters), GPUBufferUsage.UNIFORM);
  }

  buffer(data, usage = GPUBufferUsage.STORAGE) {
    const made = this.device.createBuffer({ size: Math.max(16, Math.ceil(data.byteLength / 4) * 4), usage: usage | GPUBufferUsage.COPY_DST });
    this.device.queue.writeBuffer(made, 0, data);
    return made;
  }

  async build() {
    const { device } = this, module = (entry) => device.createShaderModule({ code: SHADERS[entry].code });
    const kernel = (entry) => device.createComputePipelineAsync({ layout: "auto", compute: { module: module(entry), entryPoint: entry } });
    const entries = [...new Set(this.jobs.map(({ entry }) => entry))];
    const draw = (name, topology) => device.createRenderPipelineAsync({ layout: "auto",
      vertex: { module: module(`${name}Vertex`), entryPoint: `${name}Vertex` },
      fragment: { module: module(`${name}Fragment`), entryPoint: `${name}Fragment`,
        targets: [{ format: this.format, blend: { color: PREMULTIPLIED, alpha: PREMULTIPLIED } }] },
      primitive: { topology } });
    const drawers = [draw("Splat", "triangle-list"), draw("Floor", "triangle-strip")];
    const [splats, floor, ...kernels] = await Promise.all([...drawers, ...entries.map(kernel)]);
    for (const [i, job] of this.jobs.entries()) {
      job.pipeline = kernels[entries.indexOf(job.entry)];
      job.group = this.group(job.pipeline, job.entry, { buffer: this.jobBuffer, offset: i * PARAMETER_BYTES, size: PARAMETER_BYTES });
    }
    this.splats = { pipeline: splats, group: this.group(splats, "SplatVertex", { buffer: this.eyeBuffer }) };
    this.floor = { pipeline: floor, group: this.group(floor, "FloorVertex", { buffer: this.eyeBuffer }) };
  }

  group(pipeline, entry, parameters) {
    const entries = Object.entries(SHADERS[entry].bindings).map(([name, binding]) =>
      ({ binding, resource: name === "parameters" ? parameters : { buffer: this.buffers[name] } }));
    return this.device.createBindGroup({ layout: pipeline.getBindGroupLayout(0), entries });
  }

  // Takes over the skin's bones and the expression's weights by name.
  move(expression) {
    this.avatar.expressions.forEach((name, e) => { this.weights[e] = expression[name] || 0; });
    this.device.queue.writeBuffer(this.buffers.GsacBones, 0, this.skin.bones);
    this.device.queue.writeBuffer(this.buffers.GsacWeights, 0, this.weights);
  }

  // view: 3x4 row by row, of the eye.
  prepare(view) {
    const { avatar, binding, device } = this, [near, far] = this.depths(view);
    const light = (binding.lit && avatar.light) || EVEN_LIGHT, along = (c) => [light[3 + c], light[6 + c], light[9 + c], light[c]];
    this.jobs.forEach(({ entry, stage = 0, shift = 0, strides = 0 }, i) => {
      setParameters(this.jobParameters, i * PARAMETER_BYTES, SHADERS[entry].parameters, {
        GsacVertexCount: avatar.vertices.length / 3, GsacSplatCount: binding.count, GsacIndexBits: this.sort.indexBits,
        GsacSortStage: stage, GsacSortShift: shift, GsacSortStrides: strides, GsacDepthRange: [near, 1 / (far - near)],
        GsacDepthRow: view.subarray(8, 12), GsacLightRed: along(0), GsacLightGreen: along(1), GsacLightBlue: along(2) });
    });
    device.queue.writeBuffer(this.jobBuffer, 0, this.jobParameters);
    this.encoder = device.createCommandEncoder();
    const pass = this.encoder.beginComputePass();
    for (const { pipeline, group, groups } of this.jobs) {
      pass.setPipeline(pipeline);
      pass.setBindGroup(0, group);
      pass.dispatchWorkgroups(groups);
    }
    pass.end();
  }

  // The least and greatest depth that the gaussians can have.
  depths(view) {
    const { bones } = this.skin, { joints } = this.avatar, range = [Infinity, -Infinity];
    this.reach.forEach((reach, j) => {
      if (reach === 0) return;
      const at = [0, 4, 8].map((r) => bones[j * 12 + r] * joints[j * 3] + bones[j * 12 + r + 1] * joints[j * 3 + 1]
        + bones[j * 12 + r + 2] * joints[j * 3 + 2] + bones[j * 12 + r + 3]);
      const depth = view[8] * at[0] + view[9] * at[1] + view[10] * at[2] + view[11];
      range[0] = Math.min(range[0], depth - reach);
      range[1] = Math.max(range[1], depth + reach);
    });
    return range;
  }

  // background: rgba in 0..1.
  clear(background) {
    this.background = background;
  }

  // eye, shadow: as for WebglRenderer. After prepare, once.
  paint({ view, focal, centre, box: [, , width, height] }, shadow) {
    const { device } = this, { low_pass_px2: lowPass = 0.3, alpha_max: most = 0.999, alpha_min: least = 1 / 255 } = this.avatar.head.blend || {};
    setParameters(this.eyeParameters, 0, SHADERS.SplatVertex.parameters, {
      GsacModel0: [1, 0, 0, 0], GsacModel1: [0, 1, 0, 0], GsacModel2: [0, 0, 1, 0], GsacBlend: [lowPass, most, least, 0],
      GsacIndexBits: this.sort.indexBits, PageView0: view.subarray(0, 4), PageView1: view.subarray(4, 8).map((x) => -x),
      PageView2: view.subarray(8, 12).map((x) => -x),
      PageLens: [2 * focal[0] / width, 2 * focal[1] / height, -2 * centre[0] / width, 2 * centre[1] / height],
      PageDisc: shadow ? [shadow.x, shadow.y, shadow.z, shadow.radius] : [0, 0, 0, 0], PageInk: [width, height, SHADOW, 0] });
    device.queue.writeBuffer(this.eyeBuffer, 0, this.eyeParameters);
    const pass = this.encoder.beginRenderPass({ colorAttachments: [{ view: this.context.getCurrentTexture().createView(),
      clearValue: this.background, loadOp: "clear", storeOp: "store" }] });
    if (shadow) {
      pass.setPipeline(this.floor.pipeline);
      pass.setBindGroup(0, this.floor.group);
      pass.draw(4);
    }
    pass.setPipeline(this.splats.pipeline);
    pass.setBindGroup(0, this.splats.group);
    pass.setIndexBuffer(this.corners, "uint32");
    pass.drawIndexed(this.binding.count * 6);
    pass.end();
    device.queue.submit([this.encoder.finish()]);
  }
}

// places: parameter -> byte after `start`; values: a whole number or a list of floats for each.
function setParameters(block, start, places, values) {
  for (const [name, at] of Object.entries(places)) {
    if (typeof values[name] === "number") new Uint32Array(block, start + at, 1)[0] = values[name];
    else new Float32Array(block, start + at, values[name].length).set(values[name]);
  }
}

// The bitonic network of Gsac.compute over at least `count` keys: {keys, indexBits, steps}, as GsacSort.cs runs it.
function sortSteps(count) {
  const block = 1 << SORT_BLOCK_BITS;
  let keys = block, merges = 0, indexBits = 1;
  for (; keys < count; merges++) keys *= 2;
  while (indexBits < 31 && 2 ** indexBits < count) indexBits++;
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

// How far from each joint gaussians that hang on it can lie, m: however the joints turn, a skinned vertex stays in the
// hull of balls around its joints; gaussians reach half as far again beyond the mesh as at rest.
function reachOf(avatar, binding) {
  const { vertices, faces, face, joints, names, skinIndex, skinWeight, moved, delta } = avatar, reach = new Float64Array(names.length);
  const far = new Float64Array(vertices.length / 3), length = (x, y, z) => Math.hypot(x, y, z);
  for (let i = 0; i < moved.length; i++) far[moved[i]] += length(...delta.subarray(i * 3, i * 3 + 3));
  for (let k = 0; k < skinIndex.length; k++) {
    if (skinWeight[k] === 0) continue;
    const v = k >> 2, j = skinIndex[k];
    reach[j] = Math.max(reach[j], far[v] + length(...[0, 1, 2].map((c) => vertices[v * 3 + c] - joints[j * 3 + c])));
  }
  binding.update(vertices);
  let beyond = 0;
  for (let i = 0; i < face.length; i++) {
    const corner = faces[face[i] * 3] * 3, { data } = binding;
    beyond = Math.max(beyond, length(...[0, 1, 2].map((c) => data[i * 12 + c] - vertices[corner + c])));
  }
  return reach.map((r) => (r > 0 ? r + 1.5 * beyond : 0));
}

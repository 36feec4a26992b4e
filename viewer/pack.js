// Packs an avatar into the arrays that Gsac.compute and the splats' shader read; Unity's GsacPacking.cs makes the same.

/**
 * The body.
 * @param {import("./reader.js").Avatar} avatar
 * @returns {Object<string, Float32Array | Uint32Array>} by the buffer's name in the shader
 */
export function packBody(avatar) {
  const { vertices, expressions, start, moved, delta, skinIndex, skinWeight } = avatar, V = vertices.length / 3;
  // The expressions' moves sorted by vertex: a counting sort.
  const first = new Uint32Array(V + 1), moves = new Float32Array(Math.max(moved.length, 1) * 4);
  for (const v of moved) first[v + 1]++;
  for (let v = 0; v < V; v++) first[v + 1] += first[v];
  const next = first.slice();
  for (let e = 0; e < expressions.length; e++) {
    for (let i = start[e]; i < start[e + 1]; i++) moves.set([...delta.subarray(i * 3, i * 3 + 3), e], next[moved[i]]++ * 4);
  }
  const rest = new Float32Array(V * 4).fill(1), skin = new Uint32Array((V + 1) * 4);
  for (let v = 0; v < V; v++) {
    rest.set(vertices.subarray(v * 3, v * 3 + 3), v * 4);
    const j = skinIndex.subarray(v * 4, v * 4 + 4);
    const w = Array.from(skinWeight.subarray(v * 4, v * 4 + 4), (x) => Math.round(x * 65535));
    skin.set([j[0] | j[1] << 8 | j[2] << 16 | j[3] << 24, w[0] | w[1] << 16, w[2] | w[3] << 16], v * 4);
  }
  for (let v = 0; v <= V; v++) skin[v * 4 + 3] = first[v];
  return { GsacRest: rest, GsacSkin: skin, GsacMoves: moves };
}

/**
 * The pose correctives, none where the body has none.
 * @param {import("./reader.js").Avatar} avatar
 * @returns {Object<string, Float32Array | Uint32Array>} by the buffer's name in the shader
 */
export function packCorrectives({ correctives }) {
  if (!correctives) return {};
  const { start, joint, delta } = correctives, pairs = new Float32Array(joint.length * 28);
  for (let i = 0; i < joint.length; i++) {
    pairs.set(delta.subarray(i * 27, i * 27 + 27), i * 28);
    pairs[i * 28 + 27] = joint[i];
  }
  return { GsacPairs: pairs, GsacFirst: Uint32Array.from(start) };
}

/**
 * A level's gaussians.
 * @param {import("./reader.js").Avatar} avatar
 * @param {import("./reader.js").Level} level
 * @returns {Object<string, Float32Array | Uint32Array>} by the buffer's name in the shader
 */
export function packLevel({ faces }, { face, mu, quat, logScale, rgb, opacity }) {
  const N = face.length, corners = new Uint32Array(N * 4), local = new Float32Array(N * 12), colours = new Float32Array(N * 4);
  for (let i = 0; i < N; i++) {
    const q = quat.subarray(i * 4, i * 4 + 4), n = 1 / Math.hypot(...q);
    corners.set(faces.subarray(face[i] * 3, face[i] * 3 + 3), i * 4);
    local.set(mu.subarray(i * 3, i * 3 + 3), i * 12);
    local.set([q[1] * n, q[2] * n, q[3] * n, q[0] * n], i * 12 + 4);
    local.set(logScale.subarray(i * 3, i * 3 + 3).map(Math.exp), i * 12 + 8);
    colours.set(rgb.subarray(i * 3, i * 3 + 3), i * 4);
    colours[i * 4 + 3] = opacity[i];
  }
  return { GsacCorners: corners, GsacLocal: local, GsacColours: colours };
}

/**
 * The two triangles between the four corners of each gaussian.
 * @param {number} count of gaussians
 */
export function indexQuads(count) {
  const indices = new Uint32Array(count * 6);
  for (let i = 0; i < count; i++) indices.set([0, 1, 2, 2, 1, 3].map((c) => i * 4 + c), i * 6);
  return indices;
}

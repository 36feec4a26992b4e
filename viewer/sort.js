// Sorts the gaussians from the farthest to the nearest: a stable counting sort on 16 bits of depth.

export class DepthSort {
  // The order's rows are this long, as WebGL has it in a texture.
  static PER_ROW = 1024;

  // count: of gaussians.
  constructor(count) {
    this.rows = Math.max(1, Math.ceil(count / DepthSort.PER_ROW));
    // Indices of gaussians, the farthest first.
    this.order = new Uint32Array(this.rows * DepthSort.PER_ROW);
    this.count = count;
    this.depth = new Float32Array(count);
    this.key = new Uint16Array(count);
    this.bins = new Uint32Array(65537);
  }

  // Fills this.order; data: Binding's, view: Eye's, whose third row gives the depth.
  update(data, view) {
    const { count, depth, key, bins, order } = this;
    let low = Infinity, high = -Infinity;
    for (let i = 0; i < count; i++) {
      const d = view[8] * data[i * 12] + view[9] * data[i * 12 + 1] + view[10] * data[i * 12 + 2] + view[11];
      depth[i] = d;
      if (d < low) low = d;
      if (d > high) high = d;
    }
    const factor = 65535 / Math.max(high - low, 1e-9);
    bins.fill(0);
    for (let i = 0; i < count; i++) {
      key[i] = Math.min(65535, Math.max(0, (high - depth[i]) * factor));
      bins[key[i] + 1]++;
    }
    for (let b = 1; b < 65537; b++) bins[b] += bins[b - 1];
    for (let i = 0; i < count; i++) order[bins[key[i]]++] = i;
  }
}

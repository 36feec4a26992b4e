// What projects places and gaussians, as all renderers and the trainer do.

// Nothing nearer to the camera than this is drawn, m.
export const NEAR = 0.05;
// A gaussian's slopes x/z and y/z are clamped to this many times the picture's half width and height: beyond that the linear
// projection of its covariance does not hold.
export const WIDE = 1.3;

/**
 * A place by a 3x4 matrix, row by row.
 * @param {ArrayLike<number>} m
 * @param {ArrayLike<number>} p
 */
export function transformPoint(m, p) {
  return [0, 4, 8].map((r) => m[r] * p[0] + m[r + 1] * p[1] + m[r + 2] * p[2] + m[r + 3]);
}

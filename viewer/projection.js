// The projection of gaussians that all renderers share with the trainer.

// Nothing nearer to the camera than this is drawn, m.
export const NEAR = 0.05;
// A gaussian's slopes x/z and y/z are clamped to this many times the picture's half width and height: beyond that the linear
// projection of its covariance does not hold.
export const WIDE = 1.3;

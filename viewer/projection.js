// What all ways of drawing share with the trainer when they project a gaussian.

// Nothing nearer to the camera is drawn, m.
export const NEAR = 0.05;
// A gaussian's slope (x/z, y/z) is kept within this many times the picture's half width and height, where the linear projection
// of its covariance still holds.
export const WIDE = 1.3;
// How dark the shadow on the floor is in its middle, 0..1.
export const SHADOW = 0.4;

"""EWA projection of 3-D gaussians to image splats, and its gradient.

A splat is a row of 16 numbers; s = ha dx^2 + b dx dy + hc dy^2 is the exponent at (dx, dy) pixels from its centre, and the pixel's
alpha is min(`MAX_ALPHA`, opacity exp(-s)) where s <= `S_MAX` (that is, alpha >= `MIN_ALPHA`).
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.draw_rule import ALPHA_LEVELS, FRUSTUM, MIN_ALPHA, NEAR
from gsac.avatar.numba_kernel import kernel

X, Y, HA, B, HC, S_MAX, OPACITY, RED, GREEN, BLUE, HALF_WIDTH, HALF_HEIGHT, RIGHTMOST, CHORD, SLOPE, RIM = range(16)
"""Columns of a splat. HALF_*: px from the centre to the rim; RIGHTMOST: dy of the rim's rightmost point;
CHORD: half the chord through the centre; SLOPE: dx/dy of the chords' middles; RIM: 1 / HALF_HEIGHT^2."""

SPLAT = 16
MOMENTS = 9
"""Sums over pixels that the raster's backward pass leaves for each (tile, gaussian): g, g dx, g dy, g dx^2, g dx dy,
g dy^2, with g = dL/d(-s), and w times the image gradient of red, green, blue."""

TILE = 32


@kernel
def _jacobian(lens, width, height, x, y, z):
    """fx/z, fy/z, clamped x/z and y/z, and whether each was inside."""
    real = lens.dtype.type
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    u, v = x / z, y / z
    margin_x, margin_y = real(0.5 * FRUSTUM) * width / fx, real(0.5 * FRUSTUM) * height / fy
    low_u, high_u = -cx / fx - margin_x, (width - cx) / fx + margin_x
    low_v, high_v = -cy / fy - margin_y, (height - cy) / fy + margin_y
    inside_u, inside_v = low_u <= u <= high_u, low_v <= v <= high_v
    return fx / z, fy / z, min(max(u, low_u), high_u), min(max(v, low_v), high_v), inside_u, inside_v


@kernel
def _rows(rotations, scales, i, jx, jy, u, v):
    """The 2x3 matrix A = J R diag(s): the splat's covariance is A A^T plus the low-pass."""
    s0, s1, s2 = scales[i, 0], scales[i, 1], scales[i, 2]
    a0 = jx * (rotations[i, 0, 0] - u * rotations[i, 2, 0]) * s0
    a1 = jx * (rotations[i, 0, 1] - u * rotations[i, 2, 1]) * s1
    a2 = jx * (rotations[i, 0, 2] - u * rotations[i, 2, 2]) * s2
    b0 = jy * (rotations[i, 1, 0] - v * rotations[i, 2, 0]) * s0
    b1 = jy * (rotations[i, 1, 1] - v * rotations[i, 2, 1]) * s1
    b2 = jy * (rotations[i, 1, 2] - v * rotations[i, 2, 2]) * s2
    return a0, a1, a2, b0, b1, b2


@kernel
def _covariance(a0, a1, a2, b0, b1, b2, px2):
    """xx, xy, yy with the low-pass, the determinants without and with it, as sums of squares so that thin splats lose no digits."""
    aa, bb = a0 * a0 + a1 * a1 + a2 * a2, b0 * b0 + b1 * b1 + b2 * b2
    m0, m1, m2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    bare = m0 * m0 + m1 * m1 + m2 * m2
    return aa + px2, a0 * b0 + a1 * b1 + a2 * b2, bb + px2, bare, bare + px2 * (aa + bb) + px2 * px2


@kernel
def project(worker, workers, means, rotations, scales, rgb, opacity, lens, width, height, px2, keeps_energy, splats, depths, boxes):
    """Fills splats (N, 16), depths (N,) and boxes (N, 4): first and end tile column, first and end tile row.

    px2, keeps_energy: of the low-pass. A box is empty where the gaussian is not seen; its splat is then left as it was.
    """
    count = len(means)
    real = lens.dtype.type
    half, two = real(0.5), real(2)
    for i in range(count * worker // workers, count * (worker + 1) // workers):
        boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3] = 0, 0, 0, 0
        x, y, z, o = means[i, 0], means[i, 1], means[i, 2], opacity[i]
        if not (z > real(NEAR) and z < real(1e6) and o > real(MIN_ALPHA) and o < real(1e6)):
            continue
        jx, jy, u, v, _, _ = _jacobian(lens, real(width), real(height), x, y, z)
        a0, a1, a2, b0, b1, b2 = _rows(rotations, scales, i, jx, jy, u, v)
        xx, xy, yy, bare, determinant = _covariance(a0, a1, a2, b0, b1, b2, px2)
        if keeps_energy:
            o *= np.sqrt(bare / determinant)
            if not o > real(MIN_ALPHA):
                continue
        px, py = x / z * lens[0] + lens[2], y / z * lens[1] + lens[3]
        if not (determinant < real(1e30) and xx < real(1e15) and yy < real(1e15) and abs(px) < real(1e7) and abs(py) < real(1e7)):
            continue
        s_max = np.log(real(ALPHA_LEVELS) * o)
        wide, high = np.sqrt(two * s_max * xx), np.sqrt(two * s_max * yy)
        first_x, last_x = max(np.ceil(px - wide - half), real(0)), min(np.floor(px + wide - half), real(width - 1))
        first_y, last_y = max(np.ceil(py - high - half), real(0)), min(np.floor(py + high - half), real(height - 1))
        if first_x > last_x or first_y > last_y:
            continue
        boxes[i, 0], boxes[i, 1] = np.int32(first_x) // TILE, np.int32(last_x) // TILE + 1
        boxes[i, 2], boxes[i, 3] = np.int32(first_y) // TILE, np.int32(last_y) // TILE + 1
        splats[i, X], splats[i, Y], depths[i] = px, py, z
        splats[i, HA], splats[i, B], splats[i, HC] = half * yy / determinant, -xy / determinant, half * xx / determinant
        splats[i, S_MAX], splats[i, OPACITY] = s_max, o
        splats[i, RED], splats[i, GREEN], splats[i, BLUE] = rgb[i, 0], rgb[i, 1], rgb[i, 2]
        splats[i, HALF_WIDTH], splats[i, HALF_HEIGHT] = wide, high
        splats[i, RIGHTMOST] = xy / xx * wide
        splats[i, CHORD] = np.sqrt(two * s_max * determinant / yy)
        splats[i, SLOPE] = xy / yy
        splats[i, RIM] = real(1) / (high * high)


@kernel
def project_backward(worker, workers, means, rotations, scales, opacity, lens, width, height, px2, keeps_energy, splats, slot_start,
                     moments, grad_means, grad_rotations, grad_scales, grad_rgb, grad_opacity):
    """Sums a gaussian's moments over its tiles and takes them through the projection; zero for gaussians not seen."""
    count = len(means)
    real = lens.dtype.type
    two = real(2)
    for i in range(count * worker // workers, count * (worker + 1) // workers):
        first, end = slot_start[i], slot_start[i + 1]
        g, gx, gy, gxx, gxy, gyy, red, green, blue = (real(0), real(0), real(0), real(0), real(0), real(0), real(0), real(0),
                                                      real(0))
        for p in range(first, end):
            g, gx, gy = g + moments[p, 0], gx + moments[p, 1], gy + moments[p, 2]
            gxx, gxy, gyy = gxx + moments[p, 3], gxy + moments[p, 4], gyy + moments[p, 5]
            red, green, blue = red + moments[p, 6], green + moments[p, 7], blue + moments[p, 8]
        grad_rgb[i, 0], grad_rgb[i, 1], grad_rgb[i, 2] = red, green, blue
        if first == end:
            grad_opacity[i] = real(0)
            for axis in range(3):
                grad_means[i, axis] = real(0)
                grad_scales[i, axis] = real(0)
                for j in range(3):
                    grad_rotations[i, axis, j] = real(0)
            continue
        grad_opacity[i] = g / opacity[i]
        a, b, c = two * splats[i, HA], splats[i, B], two * splats[i, HC]
        # dL/ds = -g: pixel centre, then the covariance H = -Q G Q of the inverse covariance Q
        ux, uy = a * gx + b * gy, b * gx + c * gy
        k00, k01, k11 = real(0.5) * gxx, real(0.5) * gxy, real(0.5) * gyy
        m00, m01, m10, m11 = a * k00 + b * k01, a * k01 + b * k11, b * k00 + c * k01, b * k01 + c * k11
        h00, h01, h11 = m00 * a + m01 * b, m00 * b + m01 * c, m10 * b + m11 * c

        x, y, z = means[i, 0], means[i, 1], means[i, 2]
        jx, jy, u, v, inside_u, inside_v = _jacobian(lens, real(width), real(height), x, y, z)
        a0, a1, a2, b0, b1, b2 = _rows(rotations, scales, i, jx, jy, u, v)
        if keeps_energy:
            # the opacity's factor sqrt(bare / determinant) has the slope (C^-1 - Q) / 2 in its logarithm, C without the low-pass
            xx, xy, yy, bare, _ = _covariance(a0, a1, a2, b0, b1, b2, px2)
            half_g = real(0.5) * g
            h00 += half_g * ((yy - px2) / bare - a)
            h01 -= half_g * (xy / bare + b)
            h11 += half_g * ((xx - px2) / bare - c)
        s0, s1, s2 = scales[i, 0], scales[i, 1], scales[i, 2]
        A0, A1, A2 = two * (h00 * a0 + h01 * b0), two * (h00 * a1 + h01 * b1), two * (h00 * a2 + h01 * b2)
        B0, B1, B2 = two * (h01 * a0 + h11 * b0), two * (h01 * a1 + h11 * b1), two * (h01 * a2 + h11 * b2)
        # A = J W, W = R diag(s)
        w00, w01, w02 = rotations[i, 0, 0] * s0, rotations[i, 0, 1] * s1, rotations[i, 0, 2] * s2
        w10, w11, w12 = rotations[i, 1, 0] * s0, rotations[i, 1, 1] * s1, rotations[i, 1, 2] * s2
        w20, w21, w22 = rotations[i, 2, 0] * s0, rotations[i, 2, 1] * s1, rotations[i, 2, 2] * s2
        W00, W01, W02 = jx * A0, jx * A1, jx * A2
        W10, W11, W12 = jy * B0, jy * B1, jy * B2
        W20, W21, W22 = -u * W00 - v * W10, -u * W01 - v * W11, -u * W02 - v * W12
        grad_rotations[i, 0, 0], grad_rotations[i, 0, 1], grad_rotations[i, 0, 2] = W00 * s0, W01 * s1, W02 * s2
        grad_rotations[i, 1, 0], grad_rotations[i, 1, 1], grad_rotations[i, 1, 2] = W10 * s0, W11 * s1, W12 * s2
        grad_rotations[i, 2, 0], grad_rotations[i, 2, 1], grad_rotations[i, 2, 2] = W20 * s0, W21 * s1, W22 * s2
        grad_scales[i, 0] = W00 * rotations[i, 0, 0] + W10 * rotations[i, 1, 0] + W20 * rotations[i, 2, 0]
        grad_scales[i, 1] = W01 * rotations[i, 0, 1] + W11 * rotations[i, 1, 1] + W21 * rotations[i, 2, 1]
        grad_scales[i, 2] = W02 * rotations[i, 0, 2] + W12 * rotations[i, 1, 2] + W22 * rotations[i, 2, 2]
        # J = [jx 0 -jx u; 0 jy -jy v]
        t2x, t2y = A0 * w20 + A1 * w21 + A2 * w22, B0 * w20 + B1 * w21 + B2 * w22
        gjx = A0 * w00 + A1 * w01 + A2 * w02 - u * t2x
        gjy = B0 * w10 + B1 * w11 + B2 * w12 - v * t2y
        gu = -jx * t2x if inside_u else real(0)
        gv = -jy * t2y if inside_v else real(0)
        # u = x / z, jx = fx / z; the centre's own x / z is not clamped
        gu += lens[0] * ux
        gv += lens[1] * uy
        grad_means[i, 0], grad_means[i, 1] = gu / z, gv / z
        gz = -(gu * x / z + gv * y / z + gjx * jx + gjy * jy) / z
        grad_means[i, 2] = gz

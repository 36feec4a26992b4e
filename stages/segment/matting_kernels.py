"""Loops of the matting Laplacian (Levin et al. 2008, 'A Closed-Form Solution to Natural Image Matting', equation 12): one list of
rows for a band of pixels, where a sparse matrix of the whole image takes twenty times as long."""

from __future__ import annotations

import numpy as np

from gsac.avatar.numba_kernel import own_kernel


@own_kernel(nogil=True, error_model="numpy")
def matting_rows(pixels, order, known, centres, noise):
    """The Laplacian's rows (N, 5, 5) float32 of the N unknown pixels, by the offset of the other unknown one, and the pull (N,)
    of the known ones on each.

    pixels: (h, w, 3) uint8; order: (h, w) int32, an unknown pixel's row, else -1; known: (h, w) float32 alpha, read where order
    is -1; centres: (M, 2) rows and columns of windows of 3 x 3 px; noise: variance of a colour (0..1) within one surface.
    """
    count = order.max() + 1
    rows, pulls = np.zeros((count, 5, 5), np.float32), np.zeros(count, np.float32)
    rgb = np.empty((9, 3))
    for k in range(len(centres)):
        top, left = centres[k, 0] - 1, centres[k, 1] - 1
        for c in range(3):
            mean = 0.0
            for i in range(9):
                rgb[i, c] = pixels[top + i // 3, left + i % 3, c] / 255
                mean += rgb[i, c] / 9
            for i in range(9):
                rgb[i, c] -= mean
        rr, rg, rb, gg, gb, bb = noise, 0.0, 0.0, noise, 0.0, noise  # the covariance of the window's colours
        for i in range(9):
            r, g, b = rgb[i, 0], rgb[i, 1], rgb[i, 2]
            rr, rg, rb, gg, gb, bb = rr + r * r / 9, rg + r * g / 9, rb + r * b / 9, gg + g * g / 9, gb + g * b / 9, bb + b * b / 9
        RR, RG, RB = gg * bb - gb * gb, rb * gb - rg * bb, rg * gb - rb * gg  # its adjugate
        GG, GB, BB = rr * bb - rb * rb, rg * rb - rr * gb, rr * gg - rg * rg
        det = rr * RR + rg * RG + rb * RB
        for i in range(9):
            row = order[top + i // 3, left + i % 3]
            if row < 0:
                continue
            r, g, b = rgb[i, 0], rgb[i, 1], rgb[i, 2]
            r, g, b = (RR * r + RG * g + RB * b) / det, (RG * r + GG * g + GB * b) / det, (RB * r + GB * g + BB * b) / det
            for dy in range(3):
                for dx in range(3):
                    j, y, x = 3 * dy + dx, top + dy, left + dx
                    value = (i == j) - (1 + r * rgb[j, 0] + g * rgb[j, 1] + b * rgb[j, 2]) / 9
                    if order[y, x] >= 0:
                        rows[row, dy - i // 3 + 2, dx - i % 3 + 2] += value
                    else:
                        pulls[row] -= value * known[y, x]
    return rows, pulls


@own_kernel(nogil=True, error_model="numpy")
def solve_rows(rows, at, width, pulls, start, steps):
    """Alpha (N,) float32 of conjugate gradients, preconditioned by the diagonal.

    rows: (N, 5, 5) float32, symmetric, by the other pixel's offset; at: (N,) int64, places of the pixels in a flat image of
    `width` columns with a margin of 2 px; pulls: (N,) the right side; start: (N,) alpha to begin with; steps: how many.
    """
    alpha, residual, product = start.copy(), pulls.copy(), np.empty_like(start)
    way = np.zeros(at.max() + 2 * width + 3, np.float32)  # at first alpha itself, then each step's direction
    way[at] = start
    before = np.float32(1)
    for step in range(steps + 1):
        along = np.float32(0)
        for n in range(len(at)):
            total = np.float32(0)
            for dy in range(5):
                first = at[n] + (dy - 2) * width - 2
                for dx in range(5):
                    total += rows[n, dy, dx] * way[first + dx]
            product[n] = total
            along += total * way[at[n]]
        share = before / along if step and along > 0 else np.float32(step == 0)
        after = np.float32(0)
        for n in range(len(at)):
            if step:
                alpha[n] += share * way[at[n]]
            residual[n] -= share * product[n]
            after += residual[n] * residual[n] / rows[n, 2, 2]
        keep = after / before if step and before > 0 else np.float32(0)
        for n in range(len(at)):
            way[at[n]] = residual[n] / rows[n, 2, 2] + keep * way[at[n]]
        before = after
    return alpha

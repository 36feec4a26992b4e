"""Gradient of the compositing, front to back again.

Let v be the image's gradient, c a gaussian's colour with alpha as a fourth channel of value 1, T the transmittance before it, and V
the sum of weight v . c over all gaussians behind it. Then dL/d(alpha) at a pixel is T (v . c) - V / (1 - alpha): the colours behind
need not be kept, only V.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.draw_rule import MAX_ALPHA, STOP
from gsac.avatar.numba_kernel import kernel
from gsac.avatar.raster.forward import BLOCK, BLOCKS, LANES
from gsac.avatar.raster.project import BLUE, GREEN, HA, HC, OPACITY, RED, S_MAX, TILE, B, X, Y
from gsac.avatar.simd import below_or_equal, falloff, load, lowest_bit, spread, store, store_totals, total

PLANES = 6
"""Transmittance, V of what is still to come, and the image gradient of red, green, blue, alpha of a block, 16 numbers each."""


@kernel
def composite_backward(worker, workers, tile_order, tile_start, pair_gaussian, pair_slot, pair_mask, splats, lattice, columns,
                       scratch, rgb, alpha, grad_rgb, grad_alpha, moments):
    """Fills moments (pairs, 9), one row for each (tile, gaussian); rgb (H, W, 3) and alpha (H, W) as `composite` left them."""
    height, width = alpha.shape
    real = splats.dtype.type
    zero, one = spread(real(0)), spread(real(1))
    lane_x, lane_y = load(lattice, 0), load(lattice, LANES)
    state = scratch[worker]
    for turn in range(worker, len(tile_order), workers):
        tile = tile_order[turn]
        if tile_start[tile] == tile_start[tile + 1]:
            continue
        top, left = tile // columns * TILE, tile % columns * TILE
        rows, cols = min(TILE, height - top), min(TILE, width - left)
        if rows < TILE or cols < TILE:
            state[:] = real(0)
        for r in range(rows):
            for c in range(cols):
                at = (r // BLOCK * BLOCKS + c // BLOCK) * (PLANES * LANES) + r % BLOCK * BLOCK + c % BLOCK
                v0, v1, v2 = grad_rgb[top + r, left + c, 0], grad_rgb[top + r, left + c, 1], grad_rgb[top + r, left + c, 2]
                v3 = grad_alpha[top + r, left + c]
                state[at] = real(1)
                state[at + LANES] = (v0 * rgb[top + r, left + c, 0] + v1 * rgb[top + r, left + c, 1]
                                     + v2 * rgb[top + r, left + c, 2] + v3 * alpha[top + r, left + c])
                state[at + 2 * LANES], state[at + 3 * LANES], state[at + 4 * LANES] = v0, v1, v2
                state[at + 5 * LANES] = v3
        for pair in range(tile_start[tile], tile_start[tile + 1]):
            splat = splats[pair_gaussian[pair]]
            x, y = splat[X] - real(left), splat[Y] - real(top)
            ha, b, hc, s_max, opacity = splat[HA], splat[B], splat[HC], splat[S_MAX], splat[OPACITY]
            red, green, blue = splat[RED], splat[GREEN], splat[BLUE]
            m, mx, my, mxx, mxy, myy, mr, mg, mb = zero, zero, zero, zero, zero, zero, zero, zero, zero
            mask = pair_mask[pair]
            while mask != np.uint64(0):
                block = lowest_bit(mask)
                mask &= mask - np.uint64(1)
                at = block * (PLANES * LANES)
                dx = lane_x + (real(block % BLOCKS * BLOCK) - x)
                dy = lane_y + (real(block // BLOCKS * BLOCK) - y)
                s = dx * (dx * ha + dy * b) + dy * dy * hc
                raw = falloff(s) * opacity
                a = below_or_equal(raw, real(MAX_ALPHA), raw, real(MAX_ALPHA))
                a = below_or_equal(s, s_max, a, real(0))
                before = load(state, at)
                weight = before * a
                after = before - weight
                weight = below_or_equal(after, real(STOP), real(0), weight)
                store(state, at, below_or_equal(after, real(STOP), real(0), after))
                v0, v1, v2 = load(state, at + 2 * LANES), load(state, at + 3 * LANES), load(state, at + 4 * LANES)
                own = weight * (v0 * red + (v1 * green + (v2 * blue + load(state, at + 5 * LANES))))
                behind = load(state, at + LANES) - own
                store(state, at + LANES, behind)
                g = own - a * behind / (one - a)
                g = below_or_equal(after, real(STOP), real(0), g)
                g = below_or_equal(raw, real(MAX_ALPHA), g, real(0))
                gx, gy = g * dx, g * dy
                m, mx, my = m + g, mx + gx, my + gy
                mxx, mxy, myy = mxx + gx * dx, mxy + gx * dy, myy + gy * dy
                mr, mg, mb = mr + weight * v0, mg + weight * v1, mb + weight * v2
            row = moments[pair_slot[pair]]
            store_totals(row, 0, m, mx, my, mxx, mxy, myy, mr, mg)
            row[8] = total(mb)

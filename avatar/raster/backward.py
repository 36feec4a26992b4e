"""Gradient of the compositing, front to back again.

With V = what is still to come of (image gradient . colour, alpha counted as a fourth colour of value 1), a gaussian's
dL/d(alpha) at a pixel is T (v . c) - V_behind / (1 - alpha): no colour of what lies behind has to be kept.
"""

from __future__ import annotations

import numba
from gsac.avatar.lanes import below_or_equal, falloff, load, spread, store, total
from gsac.avatar.raster.forward import BLOCK, BLOCKS, LANES, MAX_ALPHA, STOP, block_columns, block_rows
from gsac.avatar.raster.project import BLUE, GREEN, HA, HC, OPACITY, RED, S_MAX, TILE, B, X, Y

kernel = numba.njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")

PLANES = 6
"""Transmittance, V, and the image gradient of red, green, blue, alpha of a block, 16 numbers each."""


@kernel
def composite_backward(worker, workers, tile_order, tile_start, pair_gaussian, pair_slot, splats, lattice, columns, scratch,
                       rgb, alpha, grad_rgb, grad_alpha, moments):
    """Fills moments (pairs, 9), one row for each (tile, gaussian); rgb and alpha are what `composite` gave."""
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
            first_row, last_row = block_rows(splat, y)
            for row in range(first_row, last_row + 1):
                low = real(row * BLOCK) + real(0.5) - y
                first, last = block_columns(splat, x, low, low + real(BLOCK - 1))
                dy = lane_y + (real(row * BLOCK) - y)
                bdy, hcdy2 = dy * b, dy * dy * hc
                for column in range(first, last + 1):
                    at = (row * BLOCKS + column) * (PLANES * LANES)
                    dx = lane_x + (real(column * BLOCK) - x)
                    s = dx * (dx * ha + bdy) + hcdy2
                    raw = falloff(s) * opacity
                    a = below_or_equal(raw, real(MAX_ALPHA), raw, real(MAX_ALPHA))
                    a = below_or_equal(s, s_max, a, real(0))
                    before = load(state, at)
                    weight = before * a
                    after = before - weight
                    stopped = after
                    weight = below_or_equal(stopped, real(STOP), real(0), weight)
                    after = below_or_equal(stopped, real(STOP), real(0), after)
                    store(state, at, after)
                    v0, v1, v2 = load(state, at + 2 * LANES), load(state, at + 3 * LANES), load(state, at + 4 * LANES)
                    dot = v0 * red + (v1 * green + (v2 * blue + load(state, at + 5 * LANES)))
                    own = weight * dot
                    behind = load(state, at + LANES) - own
                    store(state, at + LANES, behind)
                    g = own - a * behind / (one - a)
                    g = below_or_equal(stopped, real(STOP), real(0), g)
                    g = below_or_equal(raw, real(MAX_ALPHA), g, real(0))
                    gx, gy = g * dx, g * dy
                    m, mx, my = m + g, mx + gx, my + gy
                    mxx, mxy, myy = mxx + gx * dx, mxy + gx * dy, myy + gy * dy
                    mr, mg, mb = mr + weight * v0, mg + weight * v1, mb + weight * v2
            slot = pair_slot[pair]
            moments[slot, 0], moments[slot, 1], moments[slot, 2] = total(m), total(mx), total(my)
            moments[slot, 3], moments[slot, 4], moments[slot, 5] = total(mxx), total(mxy), total(myy)
            moments[slot, 6], moments[slot, 7], moments[slot, 8] = total(mr), total(mg), total(mb)

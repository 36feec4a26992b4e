"""Front-to-back compositing of a tile: 8x8 blocks of 4x4 pixels, one block is one `Lanes`."""

from __future__ import annotations

import numba
import numpy as np
from gsac.avatar.lanes import below_or_equal, falloff, load, spread, store
from gsac.avatar.raster.project import (
    BLUE,
    CHORD,
    GREEN,
    HA,
    HALF_HEIGHT,
    HC,
    OPACITY,
    RED,
    RIGHTMOST,
    S_MAX,
    SLOPE,
    TILE,
    B,
    X,
    Y,
)

kernel = numba.njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")

BLOCK = 4
BLOCKS = TILE // BLOCK
LANES = BLOCK * BLOCK
MAX_ALPHA = 0.999
STOP = 1e-4
"""A gaussian that would leave this transmittance or less is not composited, nor any behind it."""
PLANES = 5
"""Transmittance, red, green, blue, alpha of a block, 16 numbers each."""


@kernel
def block_rows(splat, y):
    """First and last row of blocks whose pixels the rim reaches; y: the centre in the tile, px."""
    real = splat.dtype.type
    half, reach = real(0.5), splat[HALF_HEIGHT]
    first = max(np.ceil(y - reach - half), real(0))
    last = min(np.floor(y + reach - half), real(TILE - 1))
    return np.int64(first) // BLOCK, np.int64(last) // BLOCK if last >= first else np.int64(-1)


@kernel
def block_columns(splat, x, low, high):
    """First and last block that the ellipse reaches in rows of pixels low .. high, measured from its centre."""
    real = splat.dtype.type
    half, zero, one = real(0.5), real(0), real(1)
    at = min(max(splat[RIGHTMOST], low), high)
    t = at / splat[HALF_HEIGHT]
    right = splat[SLOPE] * at + splat[CHORD] * np.sqrt(max(zero, one - t * t))
    at = min(max(-splat[RIGHTMOST], low), high)
    t = at / splat[HALF_HEIGHT]
    left = splat[SLOPE] * at - splat[CHORD] * np.sqrt(max(zero, one - t * t))
    first = max(np.ceil(x + left - half), zero)
    last = min(np.floor(x + right - half), real(TILE - 1))
    return np.int64(first) // BLOCK, np.int64(last) // BLOCK if last >= first else np.int64(-1)


@kernel
def composite(worker, workers, tile_order, tile_start, pair_gaussian, splats, lattice, columns, scratch, rgb, alpha):
    """Fills rgb (H, W, 3) and alpha (H, W). lattice: (32,) x then y of a block's pixel centres; scratch: (workers, ...)."""
    height, width = alpha.shape
    real = splats.dtype.type
    zero, one = spread(real(0)), spread(real(1))
    lane_x, lane_y = load(lattice, 0), load(lattice, LANES)
    state = scratch[worker]
    for turn in range(worker, len(tile_order), workers):
        tile = tile_order[turn]
        top, left = tile // columns * TILE, tile % columns * TILE
        rows, cols = min(TILE, height - top), min(TILE, width - left)
        if tile_start[tile] == tile_start[tile + 1]:
            for r in range(top, top + rows):
                for c in range(left, left + cols):
                    alpha[r, c] = real(0)
                    rgb[r, c, 0], rgb[r, c, 1], rgb[r, c, 2] = real(0), real(0), real(0)
            continue
        for block in range(BLOCKS * BLOCKS):
            at = block * (PLANES * LANES)
            store(state, at, one)
            for plane in range(1, PLANES):
                store(state, at + plane * LANES, zero)
        for pair in range(tile_start[tile], tile_start[tile + 1]):
            splat = splats[pair_gaussian[pair]]
            x, y = splat[X] - real(left), splat[Y] - real(top)
            ha, b, hc, s_max, opacity = splat[HA], splat[B], splat[HC], splat[S_MAX], splat[OPACITY]
            red, green, blue = splat[RED], splat[GREEN], splat[BLUE]
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
                    a = falloff(s) * opacity
                    a = below_or_equal(a, real(MAX_ALPHA), a, real(MAX_ALPHA))
                    a = below_or_equal(s, s_max, a, real(0))
                    before = load(state, at)
                    weight = before * a
                    after = before - weight
                    weight = below_or_equal(after, real(STOP), real(0), weight)
                    after = below_or_equal(after, real(STOP), real(0), after)
                    store(state, at, after)
                    store(state, at + LANES, load(state, at + LANES) + weight * red)
                    store(state, at + 2 * LANES, load(state, at + 2 * LANES) + weight * green)
                    store(state, at + 3 * LANES, load(state, at + 3 * LANES) + weight * blue)
                    store(state, at + 4 * LANES, load(state, at + 4 * LANES) + weight)
        for r in range(rows):
            for c in range(cols):
                at = (r // BLOCK * BLOCKS + c // BLOCK) * (PLANES * LANES) + r % BLOCK * BLOCK + c % BLOCK
                rgb[top + r, left + c, 0] = state[at + LANES]
                rgb[top + r, left + c, 1] = state[at + 2 * LANES]
                rgb[top + r, left + c, 2] = state[at + 3 * LANES]
                alpha[top + r, left + c] = state[at + 4 * LANES]



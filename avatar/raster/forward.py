"""Front-to-back compositing of a tile: 8x8 blocks of 4x4 pixels, one block is one `Lanes`."""

from __future__ import annotations

import numpy as np

from gsac.avatar.draw_rule import MAX_ALPHA, STOP
from gsac.avatar.numba_kernel import kernel
from gsac.avatar.raster.project import (
    BLUE,
    CHORD,
    GREEN,
    HA,
    HALF_HEIGHT,
    HALF_WIDTH,
    HC,
    OPACITY,
    RED,
    RIGHTMOST,
    RIM,
    S_MAX,
    SLOPE,
    TILE,
    B,
    X,
    Y,
)
from gsac.avatar.simd import any_above, below_or_equal, falloff, load, lowest_bit, spread, store

BLOCK = 4
BLOCKS = TILE // BLOCK
LANES = BLOCK * BLOCK
LOOK = 64
"""Gaussians of a tile between two searches for blocks that are opaque everywhere; those are skipped from there on."""
PLANES = 5
"""Transmittance, red, green, blue, alpha of a block, 16 numbers each."""


@kernel
def _blocks(low, high):
    """First and last block with a pixel centre in low .. high px of the tile; the last before the first where there is none."""
    real = type(low)
    first, last = max(np.ceil(low - real(0.5)), real(0)), min(np.floor(high - real(0.5)), real(TILE - 1))
    if not first <= last:
        return np.int64(0), np.int64(-1)
    return np.int64(first) // BLOCK, np.int64(last) // BLOCK


@kernel
def block_mask(splat, x, y):
    """The blocks that the splat's ellipse reaches, bit 8 row + column; (x, y): its centre in the tile, px."""
    real = splat.dtype.type
    zero, one, two = real(0), real(1), np.uint64(2)
    rim, turn = splat[RIM], splat[RIGHTMOST]
    top, bottom = _blocks(y - splat[HALF_HEIGHT], y + splat[HALF_HEIGHT])
    first, last = _blocks(x - splat[HALF_WIDTH], x + splat[HALF_WIDTH])
    mask = np.uint64(0)
    if last < first:
        return mask
    wide = last - first > 1
    bits = (two << np.uint64(last)) - (np.uint64(1) << np.uint64(first))
    for row in range(top, bottom + 1):
        if wide:
            low = real(row * BLOCK) + real(0.5) - y
            high = low + real(BLOCK - 1)
            at = min(max(turn, low), high)
            right = splat[SLOPE] * at + splat[CHORD] * np.sqrt(max(zero, one - at * at * rim))
            at = min(max(-turn, low), high)
            left = splat[SLOPE] * at - splat[CHORD] * np.sqrt(max(zero, one - at * at * rim))
            first, last = _blocks(x + left, x + right)
            bits = (two << np.uint64(last)) - (np.uint64(1) << np.uint64(first)) if last >= first else np.uint64(0)
        mask |= bits << np.uint64(row * BLOCKS)
    return mask


@kernel
def composite(worker, workers, tile_order, tile_start, pair_gaussian, pair_mask, splats, lattice, columns, scratch, rgb, alpha):
    """Fills rgb (H, W, 3), alpha (H, W) and pair_mask (pairs,) uint64, the blocks that each pair was composited in.

    lattice: (32,) x then y of a block's pixel centres; scratch: (workers, PLANES * TILE^2).
    """
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
        alive = np.uint64(0) - np.uint64(1)
        for pair in range(tile_start[tile], tile_start[tile + 1]):
            if (pair - tile_start[tile]) % LOOK == LOOK - 1:
                for block in range(BLOCKS * BLOCKS):
                    if not any_above(load(state, block * (PLANES * LANES)), real(0)):
                        alive &= ~(np.uint64(1) << np.uint64(block))
                if alive == np.uint64(0):
                    pair_mask[pair:tile_start[tile + 1]] = np.uint64(0)
                    break
            splat = splats[pair_gaussian[pair]]
            x, y = splat[X] - real(left), splat[Y] - real(top)
            ha, b, hc, s_max, opacity = splat[HA], splat[B], splat[HC], splat[S_MAX], splat[OPACITY]
            red, green, blue = splat[RED], splat[GREEN], splat[BLUE]
            mask = block_mask(splat, x, y) & alive
            pair_mask[pair] = mask
            while mask != np.uint64(0):
                block = lowest_bit(mask)
                mask &= mask - np.uint64(1)
                at = block * (PLANES * LANES)
                dx = lane_x + (real(block % BLOCKS * BLOCK) - x)
                dy = lane_y + (real(block // BLOCKS * BLOCK) - y)
                s = dx * (dx * ha + dy * b) + dy * dy * hc
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



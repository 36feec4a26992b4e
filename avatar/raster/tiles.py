"""Depth order of the gaussians, and the list of gaussians of every 32x32 tile."""

from __future__ import annotations

import numpy as np

from gsac.avatar.numba_kernel import kernel

RADIX_BITS = 11


@kernel
def slots(boxes, slot_start):
    """Fills slot_start (N + 1,): where the slots of each gaussian's tiles begin. Returns the number of visible gaussians."""
    seen, at = 0, 0
    for i in range(len(boxes)):
        slot_start[i] = at
        pairs = (boxes[i, 1] - boxes[i, 0]) * (boxes[i, 3] - boxes[i, 2])
        at += pairs
        seen += pairs > 0
    slot_start[len(boxes)] = at
    return seen


@kernel
def depth_order(depths, slot_start, keys, order, spare_keys, spare):
    """The visible gaussians front to back, equal depths by index, in order[:seen]. keys: unsigned, as wide as the depths.

    Positive floats sort like their bits. The radix sort is stable, so the order does not depend on the machine.
    """
    seen = 0
    bits = depths.view(keys.dtype)
    for i in range(len(depths)):
        if slot_start[i + 1] > slot_start[i]:
            keys[seen] = bits[i]
            order[seen] = i
            seen += 1
    counts = np.empty(1 << RADIX_BITS, np.int64)
    mask = keys.dtype.type((1 << RADIX_BITS) - 1)
    passes = (keys.itemsize * 8 + RADIX_BITS - 1) // RADIX_BITS
    for level in range(passes):
        shift = keys.dtype.type(level * RADIX_BITS)
        counts[:] = 0
        for i in range(seen):
            counts[(keys[i] >> shift) & mask] += 1
        at = 0
        for digit in range(len(counts)):
            counts[digit], at = at, at + counts[digit]
        for i in range(seen):
            digit = (keys[i] >> shift) & mask
            spare_keys[counts[digit]] = keys[i]
            spare[counts[digit]] = order[i]
            counts[digit] += 1
        keys, spare_keys = spare_keys, keys
        order, spare = spare, order
    return order


@kernel
def fill(order, seen, boxes, slot_start, columns, tile_start, pair_gaussian, pair_slot):
    """Lists each tile's gaussians front to back: pairs tile_start[t] .. tile_start[t + 1] hold the gaussian and its slot."""
    tile_start[:] = 0
    for r in range(seen):
        i = order[r]
        for row in range(boxes[i, 2], boxes[i, 3]):
            for column in range(boxes[i, 0], boxes[i, 1]):
                tile_start[row * columns + column + 1] += 1
    for t in range(1, len(tile_start)):
        tile_start[t] += tile_start[t - 1]
    for r in range(seen):
        i = order[r]
        slot = slot_start[i]
        for row in range(boxes[i, 2], boxes[i, 3]):
            for column in range(boxes[i, 0], boxes[i, 1]):
                tile = row * columns + column
                pair = tile_start[tile]
                pair_gaussian[pair] = i
                pair_slot[pair] = slot
                tile_start[tile] = pair + 1
                slot += 1
    for t in range(len(tile_start) - 1, 0, -1):
        tile_start[t] = tile_start[t - 1]
    tile_start[0] = 0

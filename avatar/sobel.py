"""Squared difference of two images' Sobel responses, value and gradient at once.

The response is linear, so the filters run on the difference image. Kernels [1 2 1]/4 x [-1 0 1], both axes, zero padding:
smoothing sums to one, so a response has the scale of a central difference.
"""

from __future__ import annotations

from gsac.avatar.numba_kernel import kernel
from gsac.avatar.simd import WIDTH, load, spread, store, total
from gsac.avatar.ssim import MARGIN


@kernel
def difference(worker, workers, image, target, pitch, start, height, count, padded):
    """Fills padded (height + 2, stride): image - target of the crop with zeros around it."""
    real = image.dtype.type
    for row in range(worker, height + 2, workers):
        out = padded[row]
        if row == 0 or row == height + 1:
            out[:] = real(0)
            continue
        at = start + (row - 1) * pitch
        out[:MARGIN] = real(0)
        whole = count // WIDTH * WIDTH
        for i in range(0, whole, WIDTH):
            store(out, MARGIN + i, load(image, at + i) - load(target, at + i))
        for i in range(whole, count):
            out[MARGIN + i] = image[at + i] - target[at + i]
        out[MARGIN + count:] = real(0)


@kernel
def responses(worker, workers, padded, shares, across, down, sums):
    """Sobel responses times each number's share, padded like the difference: across, down (height + 2, stride); sums (height,)."""
    real = padded.dtype.type
    quarter, half = real(0.25), real(0.5)
    height = len(padded) - 2
    for row in range(worker, height + 2, workers):
        if row == 0 or row == height + 1:
            across[row, :] = real(0)
            down[row, :] = real(0)
            continue
        above, own, below = padded[row - 1], padded[row], padded[row + 1]
        to_across, to_down = across[row], down[row]
        share_row = shares[min(row - 1, len(shares) - 1)]
        value = spread(real(0))
        for at in range(MARGIN, len(own) - MARGIN, WIDTH):
            left = load(above, at - 3) * quarter + load(own, at - 3) * half + load(below, at - 3) * quarter
            right = load(above, at + 3) * quarter + load(own, at + 3) * half + load(below, at + 3) * quarter
            high = load(above, at - 3) * quarter + load(above, at) * half + load(above, at + 3) * quarter
            low = load(below, at - 3) * quarter + load(below, at) * half + load(below, at + 3) * quarter
            x, y, part = right - left, low - high, load(share_row, at)
            value = value + (x * x + y * y) * part
            store(to_across, at, x * part)
            store(to_down, at, y * part)
        to_across[:MARGIN] = real(0)
        to_down[:MARGIN] = real(0)
        to_across[-MARGIN:] = real(0)
        to_down[-MARGIN:] = real(0)
        sums[row - 1] = total(value)


@kernel
def responses_backward(worker, workers, across, down, factor, pitch, start, count, row_scratch, gradient):
    """Adds 2 factor (Sx' across + Sy' down) to `gradient` (flat)."""
    real = across.dtype.type
    quarter, half = real(0.25), real(0.5)
    twice = real(2) * factor
    tail = row_scratch[worker]
    for row in range(worker, len(across) - 2, workers):
        a0, a1, a2 = across[row], across[row + 1], across[row + 2]
        d0, d2 = down[row], down[row + 2]
        for i in range(0, count, WIDTH):
            at = MARGIN + i
            left = load(a0, at - 3) * quarter + load(a1, at - 3) * half + load(a2, at - 3) * quarter
            right = load(a0, at + 3) * quarter + load(a1, at + 3) * half + load(a2, at + 3) * quarter
            high = load(d0, at - 3) * quarter + load(d0, at) * half + load(d0, at + 3) * quarter
            low = load(d2, at - 3) * quarter + load(d2, at) * half + load(d2, at + 3) * quarter
            own = (left - right + high - low) * twice
            to = start + row * pitch + i
            if i + WIDTH <= count:
                store(gradient, to, load(gradient, to) + own)
            else:
                store(tail, 0, own)
                for j in range(count - i):
                    gradient[to + j] += tail[j]

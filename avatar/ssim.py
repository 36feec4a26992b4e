"""Structural similarity, value and gradient at once: 11x11 gaussian window, sigma 1.5, zero padding, data range 1.

With window means mx, my of image and target, q = mean of x^2 + y^2 and p = mean of x y:
S = (2 mx my + C1)(2 (p - mx my) + C2) / ((mx^2 + my^2 + C1)(q - mx^2 - my^2 + C2)). Only four blurs go forward (mx, my, q, p) and
three back (dS/dmx, dS/dq, dS/dp). Rows keep their three channels interleaved: a step of one pixel is three numbers.
"""

from __future__ import annotations

import math

import numpy as np
from gsac.avatar.kernel import kernel
from gsac.avatar.lanes import WIDTH, load, spread, store, total

REACH = 5
ROWS = 2 * REACH + 1
MARGIN = 16
"""Zeros before and after a row: at least 3 * REACH."""
STRIP = 128
"""Numbers of a row that are worked on at a time, so that eleven rows of four planes stay in the first cache."""
C1, C2 = 0.01**2, 0.03**2

_weights = [math.exp(-(i**2) / (2 * 1.5**2)) for i in range(REACH + 1)]
_sum = _weights[0] + 2 * sum(_weights[1:])
W0, W1, W2, W3, W4, W5 = (w / _sum for w in _weights)


SCRATCH = 4 * (STRIP + 2 * MARGIN) + 4 * ROWS * STRIP
"""Numbers of scratch that a worker needs."""


@kernel
def _across(row, at):
    """The window along a row; at: index of the first of 16 middles."""
    real = row.dtype.type
    value = load(row, at) * real(W0)
    value = value + (load(row, at - 3) + load(row, at + 3)) * real(W1)
    value = value + (load(row, at - 6) + load(row, at + 6)) * real(W2)
    value = value + (load(row, at - 9) + load(row, at + 9)) * real(W3)
    value = value + (load(row, at - 12) + load(row, at + 12)) * real(W4)
    return value + (load(row, at - 15) + load(row, at + 15)) * real(W5)


@kernel
def _down(ring, at, step, row):
    """The window down the ring of eleven rows, around `row`; at: index inside a ring row, step: its length."""
    real = ring.dtype.type
    r = np.uint64(row + ROWS)
    value = load(ring, at + (r % ROWS) * step) * real(W0)
    value = value + (load(ring, at + (r - 1) % ROWS * step) + load(ring, at + (r + 1) % ROWS * step)) * real(W1)
    value = value + (load(ring, at + (r - 2) % ROWS * step) + load(ring, at + (r + 2) % ROWS * step)) * real(W2)
    value = value + (load(ring, at + (r - 3) % ROWS * step) + load(ring, at + (r + 3) % ROWS * step)) * real(W3)
    value = value + (load(ring, at + (r - 4) % ROWS * step) + load(ring, at + (r + 4) % ROWS * step)) * real(W4)
    return value + (load(ring, at + (r - 5) % ROWS * step) + load(ring, at + (r + 5) % ROWS * step)) * real(W5)


@kernel
def padded_row(flat, start, count, first, row, at):
    """Copies numbers first - MARGIN .. first + STRIP + MARGIN of a crop's row to `row[at:]`, zeros outside 0 .. count.

    start: index of the crop row's first number in the flat image.
    """
    real = row.dtype.type
    for i in range(0, STRIP + 2 * MARGIN, WIDTH):
        begin = first - MARGIN + i
        if begin >= 0 and begin + WIDTH <= count:
            store(row, at + i, load(flat, start + begin))
        else:
            for j in range(WIDTH):
                row[at + i + j] = flat[start + begin + j] if 0 <= begin + j < count else real(0)


@kernel
def similarity(worker, workers, image, target, pitch, start, height, count, shares, scratch, slopes, sums):
    """Slopes (3, height, stride) of the mean with respect to mx, q, p, times each number's share; sums (height, strips).

    image, target: flat; pitch: numbers of a full row; start: index of the crop's first number; count: numbers of a crop row;
    shares (1 or height, stride): share of each number in the mean, zero past the row's end; scratch: (workers, SCRATCH).
    """
    real = image.dtype.type
    two, c1, c2 = real(2), spread(real(C1)), spread(real(C2))
    state = scratch[worker]
    long = STRIP + 2 * MARGIN
    rings = 4 * long
    plane = ROWS * STRIP
    begin, end = height * worker // workers, height * (worker + 1) // workers
    for first in range(0, count, STRIP):
        wide = min(STRIP, -(-(count - first) // WIDTH) * WIDTH)
        for row in range(begin - REACH, end + REACH):
            ring = rings + (row + ROWS) % ROWS * STRIP
            if 0 <= row < height:
                padded_row(image, start + row * pitch, count, first, state, 0)
                padded_row(target, start + row * pitch, count, first, state, long)
                for i in range(0, long, WIDTH):
                    x, y = load(state, i), load(state, long + i)
                    store(state, 2 * long + i, x * x + y * y)
                    store(state, 3 * long + i, x * y)
                for i in range(0, wide, WIDTH):
                    store(state, ring + i, _across(state, MARGIN + i))
                    store(state, ring + plane + i, _across(state, long + MARGIN + i))
                    store(state, ring + 2 * plane + i, _across(state, 2 * long + MARGIN + i))
                    store(state, ring + 3 * plane + i, _across(state, 3 * long + MARGIN + i))
            else:
                for i in range(4):
                    state[ring + i * plane:ring + i * plane + STRIP] = real(0)
            middle = row - REACH
            if middle < begin:
                continue
            share_row = shares[min(middle, len(shares) - 1)]
            to_mx, to_q, to_p = slopes[0, middle], slopes[1, middle], slopes[2, middle]
            value = spread(real(0))
            for i in range(0, wide, WIDTH):
                mx, my = _down(state, rings + i, STRIP, middle), _down(state, rings + plane + i, STRIP, middle)
                q, p = _down(state, rings + 2 * plane + i, STRIP, middle), _down(state, rings + 3 * plane + i, STRIP, middle)
                squares, product = mx * mx + my * my, mx * my
                a1, a2 = product * two + c1, (p - product) * two + c2
                b1, b2 = squares + c1, q - squares + c2
                part = load(share_row, MARGIN + first + i)
                scale = part / (b1 * b2)
                s = a1 * a2 * scale
                value = value + s
                over_b2 = s / b2
                store(to_mx, MARGIN + first + i, ((a2 - a1) * my * scale + (over_b2 - s / b1) * mx) * two)
                store(to_q, MARGIN + first + i, spread(real(0)) - over_b2)
                store(to_p, MARGIN + first + i, a1 * scale * two)
            sums[middle, first // STRIP] = total(value)
    for row in range(begin, end):
        for i in range(3):
            slopes[i, row, :MARGIN] = real(0)
            slopes[i, row, -MARGIN:] = real(0)


@kernel
def similarity_backward(worker, workers, image, target, pitch, start, height, count, factor, scratch, slopes, gradient):
    """Adds factor times the mean's gradient with respect to the image to `gradient` (flat)."""
    real = image.dtype.type
    two = real(2)
    state = scratch[worker]
    rings = 3 * WIDTH
    plane = ROWS * STRIP
    begin, end = height * worker // workers, height * (worker + 1) // workers
    for first in range(0, count, STRIP):
        wide = min(STRIP, -(-(count - first) // WIDTH) * WIDTH)
        for row in range(begin - REACH, end + REACH):
            ring = rings + (row + ROWS) % ROWS * STRIP
            if 0 <= row < height:
                of_mx, of_q, of_p = slopes[0, row], slopes[1, row], slopes[2, row]
                for i in range(0, wide, WIDTH):
                    at = MARGIN + first + i
                    store(state, ring + i, _across(of_mx, at))
                    store(state, ring + plane + i, _across(of_q, at))
                    store(state, ring + 2 * plane + i, _across(of_p, at))
            else:
                for i in range(3):
                    state[ring + i * plane:ring + i * plane + STRIP] = real(0)
            middle = row - REACH
            if middle < begin:
                continue
            for i in range(0, wide, WIDTH):
                mx, q = _down(state, rings + i, STRIP, middle), _down(state, rings + plane + i, STRIP, middle)
                p = _down(state, rings + 2 * plane + i, STRIP, middle)
                at = start + middle * pitch + first + i
                if first + i + WIDTH <= count:
                    own = mx + q * load(image, at) * two + p * load(target, at)
                    store(gradient, at, load(gradient, at) + own * factor)
                else:
                    store(state, 0, mx)
                    store(state, WIDTH, q)
                    store(state, 2 * WIDTH, p)
                    for j in range(count - first - i):
                        own = state[j] + two * state[WIDTH + j] * image[at + j] + state[2 * WIDTH + j] * target[at + j]
                        gradient[at + j] += own * factor

"""Structural similarity, value and gradient at once: 11x11 gaussian window, sigma 1.5, zero padding, data range 1.

With window means mx, my of image and target, q = mean of x^2 + y^2 and p = mean of x y:
S = (2 mx my + C1)(2 (p - mx my) + C2) / ((mx^2 + my^2 + C1)(q - mx^2 - my^2 + C2)). Only four blurs go forward (mx, my, q, p) and
three back (dS/dmx, dS/dq, dS/dp). Rows keep their three channels interleaved: a step of one pixel is three numbers.
"""

from __future__ import annotations

import math

from gsac.avatar.numba_kernel import kernel
from gsac.avatar.simd import WIDTH, load, spread, store, total

REACH = 5
ROWS = 2 * REACH + 1
MARGIN = 16
"""Zeros before and after a row: at least 3 * REACH."""
STRIP = 128
"""Numbers of a row that are worked on at a time."""
C1, C2 = 0.01**2, 0.03**2

_weights = [math.exp(-(i**2) / (2 * 1.5**2)) for i in range(REACH + 1)]
_sum = _weights[0] + 2 * sum(_weights[1:])
W0, W1, W2, W3, W4, W5 = (w / _sum for w in _weights)


WIDE, LONG = STRIP + 2 * MARGIN, STRIP + 4 * MARGIN
"""A strip with the margin that its gradient needs, and with the margin that this needs in turn."""
SCRATCH = 4 * LONG + (8 * ROWS + 3) * WIDE + 6 * ROWS * STRIP
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
def _down(rows, at, step):
    """The window down eleven rows; at: index in the first of them, step: their length."""
    real = rows.dtype.type
    value = load(rows, at + 5 * step) * real(W0)
    value = value + (load(rows, at + 4 * step) + load(rows, at + 6 * step)) * real(W1)
    value = value + (load(rows, at + 3 * step) + load(rows, at + 7 * step)) * real(W2)
    value = value + (load(rows, at + 2 * step) + load(rows, at + 8 * step)) * real(W3)
    value = value + (load(rows, at + step) + load(rows, at + 9 * step)) * real(W4)
    return value + (load(rows, at) + load(rows, at + 10 * step)) * real(W5)


@kernel
def _keep(rows, at, step, value):
    """Writes to a row and to its double eleven rows below, so that any eleven successive rows lie in one piece."""
    store(rows, at, value)
    store(rows, at + ROWS * step, value)


@kernel
def _padded_row(flat, start, count, first, row, at):
    """Copies `LONG` numbers from first - 2 MARGIN on of a crop's row to `row[at:]`, zeros outside 0 .. count.

    start: index of the crop row's first number in the flat image.
    """
    real = row.dtype.type
    for i in range(0, LONG, WIDTH):
        begin = first - 2 * MARGIN + i
        if begin >= 0 and begin + WIDTH <= count:
            store(row, at + i, load(flat, start + begin))
        else:
            for j in range(WIDTH):
                row[at + i + j] = flat[start + begin + j] if 0 <= begin + j < count else real(0)


@kernel
def _keep_zeros(rows, at, planes, plane, step, count):
    """`_keep` of `count` zeros in each of the planes, which are `plane` numbers apart."""
    for i in range(0, count, WIDTH):
        for j in range(planes):
            _keep(rows, at + j * plane + i, step, spread(rows.dtype.type(0)))


@kernel
def _sum_of(row, at, count):
    """Sum of `count` numbers of a row from `at` on."""
    value = spread(row.dtype.type(0))
    for i in range(0, count, WIDTH):
        value = value + load(row, at + i)
    return total(value)


@kernel
def _add_gradient(image, target, rows, window, plane, at, left, count, factor, gradient):
    """Adds factor times the gradient of `count` numbers at `at` on, of which `left` lie in the row, from the slopes around them.

    window: index of the first of eleven rows of slopes by mx in `rows`; those by q and p lie a plane and two further on.
    """
    two = rows.dtype.type(2)
    for i in range(0, count, WIDTH):
        mx, q = _down(rows, window + i, STRIP), _down(rows, window + plane + i, STRIP)
        p = _down(rows, window + 2 * plane + i, STRIP)
        if i + WIDTH <= left:
            own = mx + q * load(image, at + i) * two + p * load(target, at + i)
            store(gradient, at + i, load(gradient, at + i) + own * factor)
        else:
            store(rows, 0, mx)
            store(rows, WIDTH, q)
            store(rows, 2 * WIDTH, p)
            for j in range(left - i):
                own = rows[j] + two * rows[WIDTH + j] * image[at + i + j] + rows[2 * WIDTH + j] * target[at + i + j]
                gradient[at + i + j] += own * factor


@kernel
def _differ(spans, row, low, high):
    """Whether numbers low .. high of a row, which may lie outside the image, can differ. spans: (height, 2)."""
    return 0 <= row < len(spans) and spans[row, 0] < high and spans[row, 1] > low


@kernel
def similarity(worker, workers, image, target, pitch, start, height, count, shares, spans, factor, scratch, gradient, sums):
    """Adds factor times the mean's gradient with respect to the image to `gradient`; sums (height, strips) add up to the mean.

    image, target, gradient: flat; pitch: numbers of a full row; start: index of the crop's first number; count: numbers of a crop
    row; shares (1 or height, padded row): share of each number in the mean, zero in the margins; spans: (height, 2) first and end
    number of a row that may differ, and that a gradient is wanted of; scratch: (workers, SCRATCH). Between images and gradient only
    a few rows of a strip are kept, which never leave the cache. A window that sees no difference has the similarity 1.
    """
    real = image.dtype.type
    two, zero, c1, c2 = real(2), spread(real(0)), spread(real(C1)), spread(real(C2))
    state = scratch[worker]
    x_row, y_row, q_row, p_row = 0, LONG, 2 * LONG, 3 * LONG
    means = 4 * LONG
    plane, slope_plane = 2 * ROWS * WIDE, 2 * ROWS * STRIP
    of_mx = means + 4 * plane
    of_q, of_p, slopes = of_mx + WIDE, of_mx + 2 * WIDE, of_mx + 3 * WIDE
    begin, end = height * worker // workers, height * (worker + 1) // workers
    for first in range(0, count, STRIP):
        narrow = min(STRIP, -(-(count - first) // WIDTH) * WIDTH)
        wide = narrow + 2 * MARGIN
        low, high = first - 2 * MARGIN, first + narrow + 2 * MARGIN
        never = begin - 8 * REACH
        seen, near = never, never  # last row that differs up to this one, and up to 2 REACH further on
        for row in range(begin - 4 * REACH, begin):
            near = row if _differ(spans, row, low, high) else near
            seen = near if row < begin - 2 * REACH else seen
        for row in range(begin - 2 * REACH, end + 2 * REACH):
            near = row + 2 * REACH if _differ(spans, row + 2 * REACH, low, high) else near
            seen = row if _differ(spans, row, low, high) else seen
            ring = means + (row + 2 * ROWS) % ROWS * WIDE
            if near < row - 2 * REACH:
                pass
            elif 0 <= row < height:
                _padded_row(image, start + row * pitch, count, first, state, x_row)
                _padded_row(target, start + row * pitch, count, first, state, y_row)
                for i in range(0, LONG, WIDTH):
                    x, y = load(state, x_row + i), load(state, y_row + i)
                    store(state, q_row + i, x * x + y * y)
                    store(state, p_row + i, x * y)
                for i in range(0, wide, WIDTH):
                    _keep(state, ring + i, WIDE, _across(state, x_row + MARGIN + i))
                    _keep(state, ring + plane + i, WIDE, _across(state, y_row + MARGIN + i))
                    _keep(state, ring + 2 * plane + i, WIDE, _across(state, q_row + MARGIN + i))
                    _keep(state, ring + 3 * plane + i, WIDE, _across(state, p_row + MARGIN + i))
            else:
                _keep_zeros(state, ring, 4, plane, WIDE, wide)
            middle = row - REACH
            if middle < begin - REACH:
                continue
            ring = slopes + (middle + 2 * ROWS) % ROWS * STRIP
            share_row = shares[min(max(middle, 0), len(shares) - 1)]
            if seen < row - 2 * REACH:
                if begin <= middle < end:
                    sums[middle, first // STRIP] = _sum_of(share_row, MARGIN + first, narrow)
            elif 0 <= middle < height:
                value = zero
                window = means + (middle - REACH + 2 * ROWS) % ROWS * WIDE
                for i in range(0, wide, WIDTH):
                    mx, my = _down(state, window + i, WIDE), _down(state, window + plane + i, WIDE)
                    q, p = _down(state, window + 2 * plane + i, WIDE), _down(state, window + 3 * plane + i, WIDE)
                    squares, product = mx * mx + my * my, mx * my
                    a1, a2 = product * two + c1, (p - product) * two + c2
                    b1, b2 = squares + c1, q - squares + c2
                    scale = load(share_row, first + i) / (b1 * b2)
                    s = a1 * a2 * scale
                    over_b2 = s / b2
                    store(state, of_mx + i, ((a2 - a1) * my * scale + (over_b2 - s / b1) * mx) * two)
                    store(state, of_q + i, zero - over_b2)
                    store(state, of_p + i, a1 * scale * two)
                    if i >= MARGIN and i < MARGIN + narrow:
                        value = value + s
                if begin <= middle < end:
                    sums[middle, first // STRIP] = total(value)
                for i in range(0, narrow, WIDTH):
                    _keep(state, ring + i, STRIP, _across(state, of_mx + MARGIN + i))
                    _keep(state, ring + slope_plane + i, STRIP, _across(state, of_q + MARGIN + i))
                    _keep(state, ring + 2 * slope_plane + i, STRIP, _across(state, of_p + MARGIN + i))
            else:
                _keep_zeros(state, ring, 3, slope_plane, STRIP, narrow)
            out = middle - REACH
            if out < begin or not _differ(spans, out, low, high):
                continue
            window = slopes + (out - REACH + 2 * ROWS) % ROWS * STRIP
            _add_gradient(image, target, state, window, slope_plane, start + out * pitch + first, count - first, narrow, factor,
                          gradient)

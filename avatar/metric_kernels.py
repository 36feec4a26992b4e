"""The sums of `metrics` pixel by pixel, each in one pass: threads that judge images side by side would wait for each other between
numpy's. The order of every operation, and with it every bit, is that of the formulas there.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.numba_kernel import own_kernel


@own_kernel(nogil=True, error_model="numpy")
def lay_on_grey(premultiplied, alpha, background, image):
    """image (H, W, 3), written: in 0..1, rounded to 8 bit. premultiplied: (H, W, 3); alpha: (H, W)."""
    height, width, channels = image.shape
    for y in range(height):
        for x in range(width):
            through = (1 - np.float64(alpha[y, x])) * background
            for c in range(channels):
                value = np.float64(premultiplied[y, x, c])
                if background != 0:
                    value += through
                value = 0.0 if value < 0 else (1.0 if value > 1 else value)
                image[y, x, c] = np.rint(value * 255) / 255


@own_kernel(nogil=True, error_model="numpy")
def mean_square(image, truth, error):
    """error (H, W), written: mean over the channels of the squared difference. image, truth: (H, W, 3)."""
    height, width = error.shape
    for y in range(height):
        for x in range(width):
            d0, d1, d2 = (image[y, x, 0] - truth[y, x, 0], image[y, x, 1] - truth[y, x, 1], image[y, x, 2] - truth[y, x, 2])
            error[y, x] = (d0 * d0 + d2 * d2 + d1 * d1) / 3


@own_kernel(nogil=True, error_model="numpy")
def slopes_in(image, region, slopes):
    """slopes (2, n, 3) float32, written: differences down and across of the n pixels in a region (H, W) bool, mirrored at the
    border, as of an image (H, W, 3) in float32.
    """
    height, width, channels = image.shape
    n = 0
    for y in range(height):
        above, below = abs(y - 1), (y + 1 if y + 1 < height else max(height - 2, 0))
        for x in range(width):
            if not region[y, x]:
                continue
            left, right = abs(x - 1), (x + 1 if x + 1 < width else max(width - 2, 0))
            for c in range(channels):
                slopes[0, n, c] = np.float32(image[min(below, height - 1), x, c]) - np.float32(image[min(above, height - 1), x, c])
                slopes[1, n, c] = np.float32(image[y, min(right, width - 1), c]) - np.float32(image[y, min(left, width - 1), c])
            n += 1


@own_kernel(nogil=True, error_model="numpy")
def pair_moments(a, b, level_a, level_b, own_a, own_b, squares, products):
    """(H, W, 3) float32, written: own_a and own_b, images less their levels, the sum of their squares and their product."""
    height, width, channels = own_a.shape
    for y in range(height):
        for x in range(width):
            for c in range(channels):
                one, other = np.float32(a[y, x, c]) - level_a, np.float32(b[y, x, c]) - level_b
                own_a[y, x, c], own_b[y, x, c] = one, other
                squares[y, x, c] = one * one + other * other
                products[y, x, c] = one * other


@own_kernel(nogil=True, error_model="numpy")
def likeness_of_windows(mean_a, mean_b, squares, products, level_a, level_b, c1, c2, margin, alike):
    """alike (h, w, 3) float32, written: SSIM of each whole window. mean_a, mean_b, squares, products: (H, W, 3) windows' means of
    `pair_moments`, with a margin of windows that are not whole.
    """
    height, width, channels = alike.shape
    two = np.float32(2)
    for y in range(height):
        for x in range(width):
            for c in range(channels):
                at = y + margin, x + margin, c
                ma, mb = mean_a[at], mean_b[at]
                variances, covariance = squares[at] - (ma * ma + mb * mb), products[at] - ma * mb
                ma, mb = ma + level_a, mb + level_b
                alike[y, x, c] = ((two * ma * mb + c1) * (two * covariance + c2)
                                  / ((ma * ma + mb * mb + c1) * (variances + c2)))

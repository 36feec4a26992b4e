"""Fused kernels of a training step: composition over a background, Adam, the gaussians' limits. They release the GIL."""

from __future__ import annotations

import math

import numpy as np

from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.threads import Share

FLAT = 0.4
"""Most of a tied gaussian's thickness over its narrower width."""


def on_background(share: Share, rgb: np.ndarray, alpha: np.ndarray, pixels: np.ndarray, background: np.ndarray, gain: np.ndarray,
                  image: np.ndarray, target: np.ndarray, spans: np.ndarray) -> None:
    """Composes render and frame over one colour: image = gain * rgb + (1 - alpha) bg, target likewise from the cut-out frame.

    share: `Workspace.share`; rgb: (h, w, 3) premultiplied; alpha: (h, w); pixels: (h, w, 4) uint8 premultiplied; background, gain:
    (3,). Written: image, target (h, w, 3); spans (h, 2) int, first and end column of each row in which either shows the person.
    """
    share(_on_background, rgb, alpha, pixels, background, gain, image, target, spans)


def through_background(share: Share, grad_image: np.ndarray, rgb: np.ndarray, alpha: np.ndarray, pixels: np.ndarray,
                       background: np.ndarray, gain: np.ndarray, mask_weight: float, grad_rgb: np.ndarray, grad_alpha: np.ndarray,
                       grad_gain: np.ndarray) -> float:
    """Backward pass of `on_background` plus mask_weight * mean((alpha - mask)^2), whose value it returns.

    share: `Workspace.share`; grad_image: (h, w, 3); rgb: (h, w, 3) premultiplied; alpha: (h, w); pixels: (h, w, 4) uint8
    premultiplied; background, gain: (3,). grad_rgb (h, w, 3), grad_alpha (h, w) and grad_gain (3,) are written.
    """
    sums = np.empty((len(alpha), 4))
    share(_through_background, grad_image, rgb, alpha, pixels, background, gain, mask_weight, grad_rgb, grad_alpha, sums)
    total = sums.sum(0)
    grad_gain[:] = total[1:]
    return float(total[0])


@own_kernel(nogil=True, error_model="numpy", fastmath=True)
def _on_background(worker, workers, rgb, alpha, pixels, background, gain, image, target, spans):
    byte = rgb.dtype.type(1 / 255)
    one = rgb.dtype.type(1)
    height, width = alpha.shape
    for y in range(height * worker // workers, height * (worker + 1) // workers):
        first, end = 0, width
        while first < end and alpha[y, first] == 0 and pixels[y, first, 3] == 0:
            first += 1
        while end > first and alpha[y, end - 1] == 0 and pixels[y, end - 1, 3] == 0:
            end -= 1
        spans[y, 0], spans[y, 1] = first, end
        for x in range(width):  # all of them: a loop that begins elsewhere is not made of vectors
            clear, clear_target = one - alpha[y, x], one - pixels[y, x, 3] * byte
            for c in range(3):
                image[y, x, c] = gain[c] * rgb[y, x, c] + clear * background[c]
                target[y, x, c] = pixels[y, x, c] * byte + clear_target * background[c]


@own_kernel(nogil=True, error_model="numpy", fastmath=True)
def _through_background(worker, workers, grad_image, rgb, alpha, pixels, background, gain, mask_weight, grad_rgb, grad_alpha, sums):
    """sums: (h, 4), of each row the mask's term and the gain's gradient."""
    byte = rgb.dtype.type(1 / 255)
    share = rgb.dtype.type(mask_weight / alpha.size)
    height = rgb.shape[0]
    for y in range(height * worker // workers, height * (worker + 1) // workers):
        term, red, green, blue = 0.0, 0.0, 0.0, 0.0
        for x in range(rgb.shape[1]):
            difference = alpha[y, x] - pixels[y, x, 3] * byte
            term += share * difference * difference
            g = 2 * share * difference
            for c in range(3):
                g -= grad_image[y, x, c] * background[c]
                grad_rgb[y, x, c] = grad_image[y, x, c] * gain[c]
            red += grad_image[y, x, 0] * rgb[y, x, 0]
            green += grad_image[y, x, 1] * rgb[y, x, 1]
            blue += grad_image[y, x, 2] * rgb[y, x, 2]
            grad_alpha[y, x] = g
        sums[y, 0], sums[y, 1], sums[y, 2], sums[y, 3] = term, red, green, blue


@own_kernel(nogil=True, error_model="numpy")
def adam_rows(value, grad, first, second, bias, rate):
    """One Adam step (0.9, 0.99) of the rows of value (N, C) whose gradient is not zero; bias: (N, 2) of `count_rows`.

    A gaussian that a frame does not show keeps its value and its moments.
    """
    for i in range(value.shape[0]):
        touched = False
        for c in range(value.shape[1]):
            touched |= grad[i, c] != 0
        if not touched:
            continue
        scale, unbias = rate / bias[i, 0], bias[i, 1]
        for c in range(value.shape[1]):
            g = np.float64(grad[i, c])
            first[i, c] += 0.1 * (g - first[i, c])
            second[i, c] += 0.01 * (g * g - second[i, c])
            value[i, c] -= scale * first[i, c] / (math.sqrt(second[i, c] * unbias) + 1e-15)


@own_kernel(error_model="numpy")
def adam(value, grad, first, second, count, rate):
    """One Adam step (0.9, 0.999, 1e-8) of all of value (N, C), recipe `paper`'s; count: steps so far, this one included."""
    scale = rate / (1 - 0.9**count)
    unbias = 1 / (1 - 0.999**count)
    for i in range(value.shape[0]):
        for c in range(value.shape[1]):
            g = np.float64(grad[i, c])
            first[i, c] += 0.1 * (g - first[i, c])
            second[i, c] += 0.001 * (g * g - second[i, c])
            value[i, c] -= scale * first[i, c] / (math.sqrt(second[i, c] * unbias) + 1e-8)


@own_kernel(nogil=True, error_model="numpy")
def count_rows(grad, count, bias):
    """Adds one to count (N,) where the row of grad (N, C) is not zero.

    bias (N, 2), written: what Adam divides the first moment by and multiplies the second with after so many steps, at least one.
    """
    for i in range(grad.shape[0]):
        for c in range(grad.shape[1]):
            if grad[i, c] != 0:
                count[i] += 1
                break
        n = count[i] if count[i] > 0 else 1
        bias[i, 0], bias[i, 1] = 1 - 0.9**n, 1 / (1 - 0.99**n)


@own_kernel(nogil=True, error_model="numpy")
def limit(mu, quat, log_scale, rgb, logit, start, face_scale, largest, tied, needle, least, reach, tie, pull):
    """Limits gaussians after a step, in place.

    quat (N, 4) is normalised; the longest axis is at most `needle` times the middle one and 10 times the shortest, and
    at most largest (N,) m, the shortest at least `least` m; mu (N, 3) moves back to start (N, 3) by the share `pull` and stays
    within `reach` m of it; rgb stays in 0..1 and the opacity's logit in -9..9. face_scale: (N,) m per unit of mu at rest. One
    that is tied (N,) lies flat, its middle axis, the face's normal, at most `FLAT` times the others, within `tie` m of its start.
    """
    log_needle, log_flat = math.log(needle), math.log(10.0)
    for i in range(mu.shape[0]):
        far = reach
        if tied[i]:
            far = min(reach, tie)
            quat[i, 1], quat[i, 3] = 0, 0
            log_scale[i, 1] = min(log_scale[i, 1], min(log_scale[i, 0], log_scale[i, 2]) + math.log(FLAT))
        norm = 0.0
        for c in range(4):
            norm += quat[i, c] * quat[i, c]
        norm = 1 / math.sqrt(norm) if norm > 1e-20 else 0.0
        for c in range(4):
            quat[i, c] *= norm
        if norm == 0.0:
            quat[i, 0] = 1
        a, b, d = log_scale[i, 0], log_scale[i, 1], log_scale[i, 2]
        high, low = max(a, b, d), min(a, b, d)
        middle = a + b + d - high - low
        size = max(face_scale[i], 1e-6)
        top = min(high, middle + log_needle, math.log(largest[i] / size))
        bottom = top - log_flat
        if least > 0:
            bottom = max(bottom, math.log(least / size))
        for c in range(3):
            log_scale[i, c] = max(min(log_scale[i, c], top), bottom)
        away = 0.0
        for c in range(3):
            mu[i, c] -= pull * (mu[i, c] - start[i, c])
            away += (mu[i, c] - start[i, c]) ** 2
        away = math.sqrt(away) * face_scale[i]
        if away > far:
            for c in range(3):
                mu[i, c] = start[i, c] + (mu[i, c] - start[i, c]) * far / away
        for c in range(3):
            rgb[i, c] = min(max(rgb[i, c], 0.0), 1.0)
        logit[i, 0] = min(max(logit[i, 0], -9.0), 9.0)

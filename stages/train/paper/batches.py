"""The batches of recipe `paper`: what every step sees, drawn before the first."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Batches(NamedTuple):
    """What S steps of B frames see."""

    order: np.ndarray
    """(S, B) int32, places of the frames among those that are trained on."""
    background: np.ndarray
    """(S, B, 3) float32 in 0..1."""
    centre: np.ndarray
    """(S, B) int32, the vertices in the middle of the windows that LPIPS sees."""


def draw_batches(frames: int, batch: int, steps: int, vertices: int, seed: int) -> Batches:
    """Shuffled rounds of `frames` frames, of which the rest that fills no batch is left out.

    As in HAHA's loop, a round's last batch is trained on once more before the next round begins, on the same backgrounds.
    vertices: of the body.
    """
    rng = np.random.default_rng([seed, 2])
    order, background = np.empty((steps, batch), np.int32), np.empty((steps, batch, 3), np.float32)
    left = rng.permutation(frames)
    for step in range(steps):
        if len(left) < batch:
            left = rng.permutation(frames)
            order[step], background[step] = order[step - 1], background[step - 1]
        else:
            order[step], left = left[:batch], left[batch:]
            background[step] = rng.random((batch, 3))
    return Batches(order, background, rng.integers(vertices, size=(steps, batch)).astype(np.int32))

"""Densification of recipe `paper`: clones or splits gaussians with a large gradient of their place in the image.

3DGS (Kerbl et al. 2023) as HAHA sets it: eleven events of a 3000-step run, nothing is pruned.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.logistic import logit
from gsac.avatar.rotation import to_xyzw

FIRST, LAST, EVERY, PHASE = 100, 2500, 201, 99
"""Events are the steps strictly between FIRST and LAST that leave PHASE when divided by EVERY."""
LARGEST = 0.1
"""Scales are LARGEST * sigmoid(logit), in units of the face."""
THRESHOLD = 5e-5
"""Mean length of the batch loss's gradient with respect to a gaussian's place in the image, from -1 to 1 across the frame."""
SMALL = 0.005
"""Largest scale, in units of the face, up to which a gaussian is cloned and not split."""
SHRINK, SHIFT = 1.6, 0.2
"""Of a split: what the scales are divided by, and the share of the parent's deviation by which the halves are moved."""


class Growable(Protocol):
    """Gaussians that can grow in number."""

    values: dict[str, np.ndarray]
    """As `children` takes them, (N, C) each."""
    face: np.ndarray
    """(N,) index of each gaussian's face."""

    def append(self, parents: np.ndarray, new: dict[str, np.ndarray]) -> None:
        """Adds rows: new: name -> (n, C), bound as their parents (n,) are."""


def due(step: int) -> bool:
    """Whether gaussians are added after this step, from 0."""
    return FIRST < step < LAST and step % EVERY == PHASE


class Densifier:
    """Sums, since the last event, of the gradient lengths of N gaussians: length (N,) and hits (N,), the images they were in."""

    def __init__(self, count: int):
        self.reset(count)

    def reset(self, count: int) -> None:
        """Empties the sums, for `count` gaussians."""
        self.length, self.hits = np.zeros(count), np.zeros(count, np.int64)

    def note(self, gradient: np.ndarray, visible: np.ndarray) -> None:
        """Adds one image. gradient: (N, 2), -1..1 across the frame; visible: (N,) bool."""
        self.length += np.where(visible, np.linalg.norm(gradient, axis=1), 0)
        self.hits += visible

    def grow(self, step: int, gaussians: Growable, rng: np.random.Generator) -> None:
        """Grows the gaussians where the step is an event. New ones start with empty Adam moments."""
        if not due(step):
            return
        chosen = np.flatnonzero(self.length / np.maximum(self.hits, 1) >= THRESHOLD)
        gaussians.append(chosen, make_children(gaussians.values, chosen, rng))
        self.reset(len(gaussians.face))


def make_children(values: dict[str, np.ndarray], chosen: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Rows (n, C) to append, one for each chosen (n,); parents that split are changed in place.

    values: mu (N, 3), quat (N, 4), scale_logit (N, 3), and others (N, C) that are copied. Both halves of a split are moved by
    samples of the parent, its deviation times SHIFT, away from the body along the face's normal (y).
    """
    new = {name: value[chosen].copy() for name, value in values.items()}
    act = LARGEST / (1 + np.exp(-new["scale_logit"].astype(np.float64)))
    split = act.max(1) > SMALL
    parents, act = chosen[split], act[split]
    if len(parents):
        turn = Rotation.from_quat(to_xyzw(new["quat"][split]))
        shifts = [turn.apply(rng.normal(size=act.shape) * act * SHIFT) for _ in range(2)]
        for shift in shifts:
            shift[:, 1] = np.abs(shift[:, 1])
        share = act / SHRINK / LARGEST
        logits = logit(share).astype(np.float32)
        new["mu"][split] += shifts[0].astype(np.float32)
        values["mu"][parents] += shifts[1].astype(np.float32)
        new["scale_logit"][split] = values["scale_logit"][parents] = logits
    return new

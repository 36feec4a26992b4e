"""Densification of recipe `paper`: clones or splits gaussians with a large gradient of their place in the image.

3DGS (Kerbl et al. 2023) as HAHA sets it: eleven events of a 3000-step run, gradients summed between the first step and the last
that may be one, nothing is pruned.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from gsac.avatar.logistic import logit

FIRST, LAST, EVERY, PHASE = 100, 2500, 201, 99
"""Gradients are summed in the steps strictly between FIRST and LAST; events are those that leave PHASE when divided by EVERY."""
LARGEST = 0.1
"""Scales are LARGEST * sigmoid(logit), in units of the face."""
THRESHOLD = 5e-5
"""Mean length of the batch loss's gradient with respect to a gaussian's place in the image, from -1 to 1 across the frame."""
SMALL = 0.005
"""Largest scale, in units of the face, up to which a gaussian is cloned and not split."""
SHRINK, SHIFT = 1.6, 0.2
"""Of a split: what the scales are divided by, and the share of the parent's deviation by which the halves are moved."""
ABOVE = 1e-5
"""Added to a split's scales as shares of LARGEST, before their logit."""


class Growable(Protocol):
    """Gaussians that can grow in number."""

    values: dict[str, np.ndarray]
    """As `children` takes them, (N, C) each."""
    face: np.ndarray
    """(N,) index of each gaussian's face."""

    def append(self, parents: np.ndarray, new: dict[str, np.ndarray]) -> None:
        """Adds rows: new: name -> (n, C), bound as their parents (n,) are."""


def counts(step: int) -> bool:
    """Whether the gradients of this step, from 0, are summed."""
    return FIRST < step < LAST


def due(step: int) -> bool:
    """Whether gaussians are added after this step, from 0."""
    return counts(step) and step % EVERY == PHASE


class Densifier:
    """Sums of the gradient lengths of N gaussians: length (N,) and hits (N,), the images they were in; anew when some are added."""

    def __init__(self, count: int):
        self.reset(count)

    def reset(self, count: int) -> None:
        """Empties the sums, for `count` gaussians."""
        self.length, self.hits = np.zeros(count), np.zeros(count, np.int64)

    def note(self, step: int, gradient: np.ndarray, visible: np.ndarray) -> None:
        """Adds one image where the step counts. gradient: (N, 2), -1..1 across the frame; visible: (N,) bool."""
        if not counts(step):
            return
        self.length += np.where(visible, np.linalg.norm(gradient, axis=1), 0)
        self.hits += visible

    def grow(self, step: int, gaussians: Growable, rng: np.random.Generator) -> None:
        """Grows the gaussians where the step is an event. New ones start with empty Adam moments."""
        if not due(step):
            return
        chosen = self.choose()
        if len(chosen):
            parents, new = make_children(gaussians.values, chosen, rng)
            gaussians.append(parents, new)
            self.reset(len(gaussians.face))

    def choose(self) -> np.ndarray:
        """(n,) indices of the gaussians whose mean gradient is large."""
        return np.flatnonzero(self.length / np.maximum(self.hits, 1) >= THRESHOLD)


def make_children(values: dict[str, np.ndarray], chosen: np.ndarray,
                  rng: np.random.Generator) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The parents (n,) of the rows to append, clones first, and the rows (n, C); parents that split are changed in place.

    values: mu (N, 3), scale_logit (N, 3), and others (N, C) that are copied; chosen: (n,) indices. A split moves the parent by a
    sample of its deviations times SHIFT, in the frame of its face and away from the body (y), and the child by another one from
    there.
    """
    act = LARGEST / (1 + np.exp(-values["scale_logit"][chosen].astype(np.float64)))
    split = act.max(1) > SMALL
    act = act[split]
    chosen, halved = np.concatenate([chosen[~split], chosen[split]]), chosen[split]
    if len(halved):
        shifts = rng.normal(size=(2, *act.shape)) * act * SHIFT
        shifts[..., 1] = np.abs(shifts[..., 1])
        values["mu"][halved] += shifts[0].astype(np.float32)
        values["scale_logit"][halved] = logit(act / SHRINK / LARGEST + ABOVE).astype(np.float32)
    new = {name: value[chosen].copy() for name, value in values.items()}
    if len(halved):
        new["mu"][-len(halved):] += shifts[1].astype(np.float32)
    return chosen, new

"""The logistic function and its inverse: an opacity in 0..1 is learned as its logit."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

Real = TypeVar("Real", float, np.ndarray)


def sigmoid(x: Real) -> Real:
    """x: scalar or (...). Returns the same shape in 0..1; under -700 float64 overflows to 0 with a warning."""
    return 1 / (1 + np.exp(-x))


def clipped_sigmoid(x: Real) -> Real:
    """As `sigmoid`, x (...) cut to -80..80 first: no float32 logit of a network overflows."""
    return 1 / (1 + np.exp(-np.clip(x, -80, 80)))


def logit(p: Real) -> Real:
    """The inverse of `sigmoid`. p: scalar or (...), inside 0..1."""
    return np.log(p / (1 - p))


def opacity_logit(opacity: np.ndarray) -> np.ndarray:
    """`logit` of opacity (N,), kept off 0 and 1; in its precision."""
    return logit(np.clip(opacity, 1e-4, 1 - 1e-4))

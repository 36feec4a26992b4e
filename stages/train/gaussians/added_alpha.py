"""How much each gaussian adds to an image."""

from __future__ import annotations

import numpy as np

from gsac.avatar.raster import Rendering, render_backward


def added_alpha(rendering: Rendering, counted: np.ndarray | None = None) -> np.ndarray:
    """(N,) px of alpha that each gaussian adds to the image: the gradient of the sum of its pixels by the gaussian's colour.

    counted: (H, W) how much each pixel counts; None: all do.
    """
    counted = np.ones_like(rendering.alpha) if counted is None else counted.astype(rendering.alpha.dtype, copy=False)
    gradients = render_backward(rendering.state, counted[..., None].repeat(3, 2), np.zeros_like(rendering.alpha))
    return gradients.rgb[:, 0].copy()  # the next pass takes the same memory

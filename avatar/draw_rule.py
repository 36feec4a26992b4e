"""The draw rule: the numbers by which every program draws a gaussian alike.

Both rasterisers, their plain reference and the head of `.gsac` files take them from here; the viewer and Unity repeat them as
defaults (tests/avatar/test_draw_rule.py compares). A splat is `alpha = min(MAX_ALPHA, opacity exp(-s))`, not drawn below MIN_ALPHA.
"""

from __future__ import annotations

from typing import NamedTuple


class LowPass(NamedTuple):
    """The filter of every splat on the screen."""

    px2: float
    """Added to both variances, px^2."""
    keeps_energy: bool
    """Whether the opacity falls as the splat grows by it: by sqrt(det of the covariance before / after)."""


ADDED = LowPass(0.3, keeps_energy=False)
"""3DGS (Kerbl et al. 2023): what is small on the screen becomes fat."""
PIXEL = LowPass(0.1, keeps_energy=True)
"""Mip-Splatting (Yu et al. 2024): about a pixel's area, so that an avatar looks alike from every distance."""
MAX_ALPHA = 0.999
ALPHA_LEVELS = 255
MIN_ALPHA = 1 / ALPHA_LEVELS
STOP = 1e-4
"""A gaussian that would leave this transmittance or less is not composited, nor any behind it."""
NEAR = 0.01
"""m: gaussians nearer to the camera are not drawn."""
FRUSTUM = 0.3
"""The projection's Jacobian is taken at a point clamped to the frustum grown by this share of its half width on each side."""
DARKEST, BRIGHTEST = 0.25, 2.5
"""The clip's light changes a colour by a factor between these: its first order knows no shadow."""


def cuda_constants() -> str:
    """The same numbers as CUDA text, each the exact double."""
    numbers = {"MAX_ALPHA": MAX_ALPHA, "ALPHA_LEVELS": ALPHA_LEVELS, "MIN_ALPHA": MIN_ALPHA, "STOP": STOP,
               "NEAR_PLANE": NEAR, "FRUSTUM": FRUSTUM, "DARKEST": DARKEST, "BRIGHTEST": BRIGHTEST}
    return "".join(f"constexpr double {name} = {value!r};\n" for name, value in numbers.items())

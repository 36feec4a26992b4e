"""Image metrics: the one scorer behind every table.

Images are (H, W, 3) float in 0..1, rounded to 8 bit before they are scored, as in an image file. A rendering is premultiplied rgb
and alpha, a frame is cut out by its mask; both are scored on the same background.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gsac.avatar.flip_metric import flip
from gsac.avatar.lpips import Lpips

WHITE, BLACK = 1.0, 0.0
BOXES = ("face", "left_hand", "right_hand")
NAMES = {"mse_white": "psnr_full", "mse_black": "psnr_full_black", "mse_fg": "psnr_fg",
         **{f"mse_{name}": f"psnr_{name}" for name in BOXES}}
"""Name of a mean squared error -> name of its PSNR."""
LPIPS = {"lpips_alex": ("lpips-alex", True), "lpips_alex_unscaled": ("lpips-alex", False), "lpips_vgg": ("lpips-vgg", True)}
"""Metric -> network, and whether its images are in -1..1, as in its training, or in 0..1, as in many papers' scorers."""


def composite(premultiplied: np.ndarray, alpha: np.ndarray, background: float) -> np.ndarray:
    """An image (H, W, 3) on a grey background, float64 in 0..1, rounded to 8 bit. premultiplied: (H, W, 3); alpha: (H, W)."""
    image = premultiplied.astype(np.float64) + (1 - alpha.astype(np.float64))[..., None] * background
    return np.round(np.clip(image, 0, 1) * 255) / 255


def psnr(mse: float) -> float | None:
    """dB for a peak of 1; equal images get 59 dB, the noise of 8-bit rounding. None for no measurement."""
    return None if mse is None or not np.isfinite(mse) else float(-10 * np.log10(max(mse, 1 / 12 / 255**2)))


def ssim(a: np.ndarray, b: np.ndarray) -> float:
    """Mean SSIM of images a and b, (H, W, 3): Gaussian window of 11 taps, sigma 1.5, k1 .01, k2 .03, whole windows only."""
    import cv2

    if min(a.shape[:2]) < 11:
        return float("nan")

    def blur(x):
        return cv2.GaussianBlur(x, (11, 11), 1.5)[5:-5, 5:-5]

    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    ma, mb = blur(a), blur(b)
    va, vb, cov = blur(a * a) - ma * ma, blur(b * b) - mb * mb, blur(a * b) - ma * mb
    c1, c2 = 0.01**2, 0.03**2
    return float(np.mean((2 * ma * mb + c1) * (2 * cov + c2) / ((ma**2 + mb**2 + c1) * (va + vb + c2))))


def detail(image: np.ndarray, truth: np.ndarray, region: np.ndarray) -> float:
    """Gradient energy of an image over that of the truth in a region: below 1 for a blurred image, above for a noisy one.

    image, truth: (H, W, 3); region: (H, W) bool. Central differences; NaN where the truth is flat.
    """
    own, true = (sum((np.gradient(x, axis=axis)[region] ** 2).sum() for axis in (0, 1)) for x in (image, truth))
    return float(own / true) if true > 0 else float("nan")


def score(rgb: np.ndarray, alpha: np.ndarray, truth: np.ndarray, mask: np.ndarray, boxes: dict | None = None,
          with_flip: bool = False, lpips: Mapping[str, Lpips] | None = None) -> dict[str, float]:
    """Scores one image. rgb, truth: (H, W, 3) premultiplied; alpha, mask: (H, W) in 0..1; boxes: name -> x0, y0, x1, y1 px.

    `mse_white`, `mse_black`: the whole frame on that background. `mse_fg`: the person only, that is pixels where mask
    or alpha is at least 0.5, on white, so that both a missing and an added limb count. `ssim`: whole frame on white.
    `alpha_iou`: of alpha and mask at 0.5. `detail`: gradient energy over the truth's, where both show the person.
    `mse_<name>`: all of a box on white, NaN without one. `flip`: mean over the person, NaN unless asked for. The names of LPIPS:
    whole frame on white, NaN for a network that is not in `lpips` (name -> network).
    """
    white, white_truth = composite(rgb, alpha, WHITE), composite(truth, mask, WHITE)
    error = ((white - white_truth) ** 2).mean(2)
    black = ((composite(rgb, alpha, BLACK) - composite(truth, mask, BLACK)) ** 2).mean()
    both = (alpha >= 0.5) & (mask >= 0.5)
    either = (alpha >= 0.5) | (mask >= 0.5)
    return {
        "mse_white": float(error.mean()), "mse_black": float(black),
        "mse_fg": float(error[either].mean()) if either.any() else float("nan"),
        "fg_pixels": int(either.sum()), "ssim": ssim(white, white_truth),
        "alpha_iou": float(both.sum() / either.sum()) if either.any() else float("nan"),
        "detail": detail(white, white_truth, both) if both.any() else float("nan"),
        **{f"mse_{name}": _in_box(error, (boxes or {}).get(name)) for name in BOXES},
        "flip": float(flip(white_truth, white)[either].mean()) if with_flip and either.any() else float("nan"),
        **{figure: lpips[net].distance(white, white_truth, scaled) if lpips and net in lpips else float("nan")
           for figure, (net, scaled) in LPIPS.items()},
    }


def _in_box(error: np.ndarray, box: tuple[int, int, int, int] | None) -> float:
    x0, y0, x1, y1 = box or (0, 0, 0, 0)
    return float(error[y0:y1, x0:x1].mean()) if x1 > x0 and y1 > y0 else float("nan")


def figures(scores: dict[str, float]) -> dict[str, float | None]:
    """One image's metrics under the names of `summary`, each hand by itself; None where not measured."""
    known = {name: float(value) if np.isfinite(value) else None for name, value in scores.items()}
    return {NAMES.get(name, name): psnr(value) if name in NAMES else value for name, value in known.items()}


def summary(scores: list[dict[str, float]]) -> dict[str, float | None]:
    """Metrics of many images: `psnr_*` is the mean of the images' PSNR, `psnr_*_pooled` the PSNR of all their pixels together.

    `lpips` is that of `lpips_net`, the first available network of `LPIPS`; None without one.
    """
    def mean(name):
        values = [s[name] for s in scores if np.isfinite(s[name])]
        return float(np.mean(values)) if values else None

    def mean_psnr(*names):
        values = [psnr(s[name]) for s in scores for name in names if np.isfinite(s[name])]
        return float(np.mean(values)) if values else None

    def pooled(name, weight):
        kept = [s for s in scores if np.isfinite(s[name]) and s[weight] > 0] if weight else scores
        if not kept:
            return None
        return psnr(float(np.average([s[name] for s in kept], weights=[s[weight] for s in kept] if weight else None)))

    perceptual = {name: mean(name) for name in LPIPS}
    first = next((name for name, value in perceptual.items() if value is not None), None)
    return {
        "psnr_full": mean_psnr("mse_white"), "psnr_full_pooled": pooled("mse_white", None),
        "psnr_full_black": mean_psnr("mse_black"), "psnr_full_black_pooled": pooled("mse_black", None),
        "psnr_fg": mean_psnr("mse_fg"), "psnr_fg_pooled": pooled("mse_fg", "fg_pixels"), "ssim": mean("ssim"),
        "lpips": first and perceptual[first], "lpips_net": first and LPIPS[first][0], **perceptual,
        "flip": mean("flip"), "psnr_face": mean_psnr("mse_face"), "psnr_hands": mean_psnr("mse_left_hand", "mse_right_hand"),
        "alpha_iou": mean("alpha_iou"), "detail": mean("detail"),
    }

"""Image metrics: the one scorer behind every table.

Images are (H, W, 3) float in 0..1, rounded to 8 bit before they are scored, as in an image file. A rendering is premultiplied rgb
and alpha, a frame is cut out by its mask; both are scored on the same background.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from gsac.avatar.feature_distance import FeatureDistance
from gsac.avatar.flip_metric import flip
from gsac.avatar.metric_kernels import lay_on_grey, likeness_of_windows, mean_square, pair_moments, slopes_in

WHITE, BLACK = 1.0, 0.0
BOXES = ("face", "left_hand", "right_hand")
NAMES = {"mse_white": "psnr_full", "mse_black": "psnr_full_black", "mse_fg": "psnr_fg", "mse_edge": "psnr_edge",
         "mse_inside": "psnr_inside", **{f"mse_{name}": f"psnr_{name}" for name in BOXES}}
"""Name of a mean squared error -> name of its PSNR."""
EDGE, RIM, EDGE_HEIGHT = 4.0, 2.0, 1280
"""px to each side of the silhouette that `mse_edge` is of, and outside that `stray_edge_alpha` allows, at EDGE_HEIGHT."""
TAPS = 11
"""px, window of SSIM."""
REACH = 10
"""px from a difference within which a window of SSIM or FLIP may see it."""


class Perceptual(NamedTuple):
    """How a perceptual distance is measured."""

    network: str
    scaled: bool
    """Whether its images are in -1..1, as in the training of LPIPS, or in 0..1, as in many papers' scorers."""
    background: float


LPIPS = {"lpips_alex": Perceptual("lpips-alex", True, WHITE), "lpips_alex_unscaled": Perceptual("lpips-alex", False, WHITE),
         "lpips_vgg": Perceptual("lpips-vgg", True, WHITE), "lpips_alex_black": Perceptual("lpips-alex", False, BLACK),
         "lpips_vgg_black": Perceptual("lpips-vgg", False, BLACK)}
"""By metric; `*_black` is the paper's."""
VGG_HED = {"vgg_hed": Perceptual("vgg-hed", False, WHITE)}
"""By metric, which is among the scores only where its network is: `avatar.vgg_hed`."""


def composite(premultiplied: np.ndarray, alpha: np.ndarray, background: float) -> np.ndarray:
    """An image (H, W, 3) on a grey background, float64 in 0..1, rounded to 8 bit. premultiplied: (H, W, 3); alpha: (H, W)."""
    image = np.empty(premultiplied.shape)
    lay_on_grey(np.ascontiguousarray(premultiplied), np.ascontiguousarray(alpha), float(background), image)
    return image


def psnr(mse: float) -> float | None:
    """dB for a peak of 1; equal images get 59 dB, the noise of 8-bit rounding. None for no measurement."""
    return None if mse is None or not np.isfinite(mse) else float(-10 * np.log10(max(mse, 1 / 12 / 255**2)))


def ssim(a: np.ndarray, b: np.ndarray, frame: tuple[int, int] | None = None) -> float:
    """Mean SSIM of images a and b, (H, W, 3): Gaussian window of 11 taps, sigma 1.5, k1 .01, k2 .03, whole windows only.

    frame: height and width of the images that a and b are cut from, which are equal in every window that lies elsewhere.
    """
    import cv2

    total = float(np.prod([side + 1 - TAPS for side in frame or a.shape[:2]]))
    if min(frame or a.shape[:2]) < TAPS:
        return float("nan")
    if not a.size:
        return 1.0

    # Variances of numbers about zero lose no digits in float32.
    levels = np.float32(a.mean()), np.float32(b.mean())
    moments = [np.empty(a.shape, np.float32) for _ in range(4)]
    pair_moments(a, b, *levels, *moments)
    means = [cv2.GaussianBlur(each, (TAPS, TAPS), 1.5) for each in moments]
    alike = np.empty((max(a.shape[0] + 1 - TAPS, 0), max(a.shape[1] + 1 - TAPS, 0), a.shape[2]), np.float32)
    likeness_of_windows(*means, *levels, np.float32(0.01**2), np.float32(0.03**2), TAPS // 2, alike)
    return float((alike.sum(dtype=np.float64) / 3 + total - alike.size / 3) / total)


def detail(image: np.ndarray, truth: np.ndarray, region: np.ndarray) -> float:
    """Gradient energy of an image over that of the truth in a region: below 1 for a blurred image, above for a noisy one.

    image, truth: (H, W, 3); region: (H, W) bool. Central differences; NaN where the truth is flat.
    """
    slopes = np.empty((2, np.count_nonzero(region), 3), np.float32)

    def energy(values):
        slopes_in(values, region, slopes)
        return sum(float(np.vdot(slope, slope)) for slope in slopes)

    own, true = energy(image), energy(truth)
    return own / true if true > 0 else float("nan")


def score(rgb: np.ndarray, alpha: np.ndarray, truth: np.ndarray, mask: np.ndarray, boxes: dict | None = None,
          with_flip: bool = False, networks: Mapping[str, FeatureDistance] | None = None) -> dict[str, float]:
    """Scores one image. rgb, truth: (H, W, 3) premultiplied; alpha, mask: (H, W) in 0..1; boxes: name -> x0, y0, x1, y1 px.

    `mse_white`, `mse_black`: the whole frame on that background. `ssim`, `ssim_black`: likewise. `alpha_iou`: of alpha and mask
    at 0.5. `mse_edge`, `mse_inside`, `stray_edge_alpha`: see `find_edge`, and alpha farther outside than RIM over the mask's
    area. `mse_<name>`: all of a box on white, NaN without one. `flip`: mean over the person, NaN unless asked for. The names of
    LPIPS: whole frame, NaN for a network that is not in `networks` (name -> network). Those of VGG_HED: likewise, where it is in
    there. The others: see `score_person`.
    """
    area = find_shown(alpha, mask)
    # Outside of the area both images are their background: the rest of the frame has no error, and a likeness of one.
    cut, cut_alpha, cut_truth, cut_mask = (np.ascontiguousarray(each[area]) for each in (rgb, alpha, truth, mask))
    white, white_truth = composite(cut, cut_alpha, WHITE), composite(cut_truth, cut_mask, WHITE)
    black, black_truth = composite(cut, cut_alpha, BLACK), composite(cut_truth, cut_mask, BLACK)
    error = np.zeros(mask.shape)
    error[area] = squared_error(white, white_truth)
    person = _score_person(white, white_truth, error[area], cut_alpha, cut_mask)
    band, inside, away = find_edge(cut_mask >= 0.5, mask.shape[0])
    either, both = (f(cut_alpha >= 0.5, cut_mask >= 0.5) for f in (np.logical_or, np.logical_and))
    networks = networks or {}
    asked = LPIPS | (VGG_HED if "vgg-hed" in networks else {})
    backgrounds = {} if not networks else {ground: (composite(rgb, alpha, ground), composite(truth, mask, ground))
                                        for ground in (WHITE, BLACK)}
    return person | {
        "mse_white": float(error.mean()), "mse_black": float(squared_error(black, black_truth).sum() / mask.size),
        "ssim": ssim(white, white_truth, mask.shape), "ssim_black": ssim(black, black_truth, mask.shape),
        "alpha_iou": float(both.sum() / either.sum()) if either.any() else float("nan"),
        "mse_edge": _mean(error[area][band]), "mse_inside": _mean(error[area][inside]),
        "stray_edge_alpha": float(cut_alpha[away].sum() / (cut_mask >= 0.5).sum()) if (cut_mask >= 0.5).any() else float("nan"),
        **{f"mse_{name}": _in_box(error, (boxes or {}).get(name)) for name in BOXES},
        "flip": _mean(flip(white_truth, white)[either]) if with_flip and either.any() else float("nan"),
        **{figure: networks[how.network].distance(*backgrounds[how.background], how.scaled)
           if how.network in networks else float("nan") for figure, how in asked.items()},
    }


def score_person(rgb: np.ndarray, alpha: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> dict[str, float]:
    """The part of `score` that tells avatars of one clip apart, for a fraction of its time.

    rgb, truth: (H, W, 3) premultiplied; alpha, mask: (H, W) in 0..1. `mse_fg`: the person only, that is `fg_pixels` pixels where
    mask or alpha is at least 0.5, on white, so that both a missing and an added limb count. `detail`: gradient energy over the
    truth's, where both show the person.
    """
    area = find_shown(alpha, mask)
    white, white_truth = composite(rgb[area], alpha[area], WHITE), composite(truth[area], mask[area], WHITE)
    return _score_person(white, white_truth, squared_error(white, white_truth), alpha[area], mask[area])


def squared_error(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(H, W), mean over the channels. image, truth: (H, W, 3)."""
    error = np.empty(image.shape[:2])
    mean_square(image, truth, error)
    return error


def _score_person(white: np.ndarray, white_truth: np.ndarray, error: np.ndarray, alpha: np.ndarray,
                  mask: np.ndarray) -> dict[str, float]:
    both, either = (alpha >= 0.5) & (mask >= 0.5), (alpha >= 0.5) | (mask >= 0.5)
    return {"mse_fg": _mean(error[either]), "fg_pixels": int(either.sum()),
            "detail": detail(white, white_truth, both) if both.any() else float("nan")}


def find_shown(alpha: np.ndarray, mask: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns of all that either shows, and of what a window or a band sees of it. alpha, mask: (H, W)."""
    room = max(REACH, int(np.ceil(EDGE * mask.shape[0] / EDGE_HEIGHT)) + 1)
    shown = (alpha > 0) | (mask > 0)
    hits = [np.flatnonzero(shown.any(axis)) for axis in (1, 0)]
    rows, columns = (slice(max(at[0] - room, 0), at[-1] + 1 + room) if len(at) else slice(0, 0) for at in hits)
    return rows, columns


def find_edge(person: np.ndarray, height: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Three (H, W) bool: the band of EDGE px to each side of the silhouette's pixels, the person inside of it, and all that is
    farther than RIM px outside. person: (H, W) bool; height: px of the frame that it is cut from, which both scale with.
    """
    import cv2

    if not person.any():
        return np.zeros_like(person), np.zeros_like(person), ~person
    deep, far = (cv2.distanceTransform(area.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) for area in (person, ~person))
    edge, rim = EDGE * height / EDGE_HEIGHT, max(1.0, RIM * height / EDGE_HEIGHT)
    inside = deep > edge + 1
    return ~inside & (far <= edge), inside, far > rim


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else float("nan")


def _in_box(error: np.ndarray, box: tuple[int, int, int, int] | None) -> float:
    x0, y0, x1, y1 = box or (0, 0, 0, 0)
    return _mean(error[y0:max(y1, y0), x0:max(x1, x0)])


def figures(scores: dict[str, float]) -> dict[str, float | None]:
    """One image's metrics under the names of `summary`, each hand by itself; None where not measured."""
    known = {name: float(value) if np.isfinite(value) else None for name, value in scores.items()}
    return {NAMES.get(name, name): psnr(value) if name in NAMES else value for name, value in known.items()}


def mean_psnr(scores: list[dict[str, float]], *names: str) -> float | None:
    """dB, the mean of the images' PSNR of one or more mean squared errors; None where none was measured."""
    values = [value for s in scores for name in names if (value := psnr(s[name])) is not None]
    return float(np.mean(values)) if values else None


def summary(scores: list[dict[str, float]]) -> dict[str, Any]:
    """Metrics of many images by `score`: `psnr_*` is the mean of the images' PSNR, `psnr_*_pooled` that of all pixels together.

    `lpips` is that of `lpips_net`, the first available network of `LPIPS`, and `lpips_black` the first one on black; None without
    one.
    """
    def mean(name):
        values = [s[name] for s in scores if np.isfinite(s[name])]
        return float(np.mean(values)) if values else None

    def pooled(name, weight):
        kept = [s for s in scores if np.isfinite(s[name]) and s[weight] > 0] if weight else scores
        if not kept:
            return None
        return psnr(float(np.average([s[name] for s in kept], weights=[s[weight] for s in kept] if weight else None)))

    def first(background):
        return next((name for name, how in LPIPS.items() if how.background == background and perceptual[name] is not None), None)

    perceptual = {name: mean(name) for name in (*LPIPS, *VGG_HED) if name in LPIPS or scores and name in scores[0]}
    white, black = first(WHITE), first(BLACK)
    return {
        "psnr_full": mean_psnr(scores, "mse_white"), "psnr_full_pooled": pooled("mse_white", None),
        "psnr_full_black": mean_psnr(scores, "mse_black"), "psnr_full_black_pooled": pooled("mse_black", None),
        "psnr_fg": mean_psnr(scores, "mse_fg"), "psnr_fg_pooled": pooled("mse_fg", "fg_pixels"),
        "psnr_edge": mean_psnr(scores, "mse_edge"), "psnr_inside": mean_psnr(scores, "mse_inside"),
        "stray_edge_alpha": mean("stray_edge_alpha"), "ssim": mean("ssim"), "ssim_black": mean("ssim_black"),
        "lpips": white and perceptual[white], "lpips_net": white and LPIPS[white].network,
        "lpips_black": black and perceptual[black], **perceptual,
        "flip": mean("flip"), "psnr_face": mean_psnr(scores, "mse_face"),
        "psnr_hands": mean_psnr(scores, "mse_left_hand", "mse_right_hand"),
        "alpha_iou": mean("alpha_iou"), "detail": mean("detail"),
    }

"""Likeness of body, face and hands at one size of the person, so that large and small footage give figures that compare.

The rim of the cut-out takes no part: an error there is the mask's or the pose's.
"""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np

from gsac.avatar.metrics import WHITE, composite, find_shown, psnr

SIZES = {"body": 320, "face": 40, "hands": 28}
"""px that the person's height and the side of a face's and a hand's box are judged at."""
RIM = 2
"""px at that size that are left out inside of the mask's edge."""
WINDOW = 1.5
"""px, standard deviation of the window of `structure`."""
FLAT = 0.03**2
"""Variance, squared brightness, up to which a window counts as flat: noise is no structure."""
LEAST = 24
"""Fewest pixels of a part that is judged."""


def compare_parts(rgb: np.ndarray, alpha: np.ndarray, true_rgb: np.ndarray, mask: np.ndarray,
                  boxes: Mapping[str, tuple[int, int, int, int]]) -> dict[str, list[dict[str, float]]]:
    """`compare_part` of body, face and each hand in one frame, with `px`, their extent in it.

    rgb, true_rgb: (H, W, 3) premultiplied; alpha, mask: (H, W); boxes: name -> x0, y0, x1, y1 px of face, left_hand and right_hand.
    """
    render, real = np.ones(rgb.shape, np.float32), np.ones(rgb.shape, np.float32)
    shown = find_shown(alpha, mask)
    render[shown], real[shown] = composite(rgb[shown], alpha[shown], WHITE), composite(true_rgb[shown], mask[shown], WHITE)
    rows = np.flatnonzero((mask >= 0.5).any(1))
    areas = [("body", (0, 0, mask.shape[1], mask.shape[0]), rows[-1] + 1 - rows[0])] if len(rows) else []
    areas += [("face" if name == "face" else "hands", box, max(box[2] - box[0], box[3] - box[1])) for name, box in boxes.items()]
    found: dict[str, list[dict[str, float]]] = {part: [] for part in SIZES}
    for part, (x0, y0, x1, y1), extent in areas:
        cut = np.s_[max(y0, 0):y1, max(x0, 0):x1]
        if extent > 0 and min(mask[cut].shape) > 0:
            compared = compare_part(render[cut], real[cut], mask[cut], SIZES[part] / extent)
            if compared:
                found[part].append(compared | {"px": float(extent)})
    return found


def compare_part(render: np.ndarray, real: np.ndarray, mask: np.ndarray, scale: float) -> dict[str, float] | None:
    """Figures of one part, brought to its size by `scale`; None where too little of it shows.

    render, real: (H, W, 3) on white; mask: (H, W). `psnr`: dB inside of the rim. `structure`: mean there of the likeness of
    contrast and its course in small windows, as in SSIM, 1 for the same.
    """
    size = [max(1, round(side * scale)) for side in mask.shape[::-1]]
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    render, real, mask = (cv2.resize(np.asarray(x, np.float32), size, interpolation=how) for x in (render, real, mask))
    rim = np.ones((2 * RIM + 1, 2 * RIM + 1), np.uint8)
    inside = cv2.erode((mask >= 0.5).astype(np.uint8), rim, borderType=cv2.BORDER_REPLICATE) > 0
    if inside.sum() < LEAST:
        return None
    a, b = render.mean(2), real.mean(2)
    mean_a, mean_b, square_a, square_b, product = (cv2.GaussianBlur(x, (0, 0), WINDOW) for x in (a, b, a * a, b * b, a * b))
    alike = (2 * (product - mean_a * mean_b) + FLAT) / (square_a - mean_a**2 + square_b - mean_b**2 + FLAT)
    error = psnr(float(((render - real) ** 2).mean(2)[inside].mean()))
    return None if error is None else {"psnr": error, "structure": float(alike[inside].mean())}


def average(rows: list[dict[str, float]]) -> dict[str, float] | None:
    """Mean of each figure, and `worst`, the least structure; None of no row."""
    if not rows:
        return None
    means = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
    return means | {"worst": min(row["structure"] for row in rows)}

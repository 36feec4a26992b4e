"""The rule that picks one of several sizes of an avatar, all judged on the same frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MOST_LOST = 0.25
"""dB below the best that no standard error excuses."""
DETAIL_LOST = 0.05
"""Share of the best's detail that may be lost even where the frames agree closely: less cannot be seen."""


@dataclass
class SizeScore:
    """One size, judged on F frames."""

    n_gaussians: int
    psnr_fg: list[float]
    """(F,) dB."""
    detail: list[float]
    """(F,) `metrics.detail`."""

    def means(self) -> dict[str, float]:
        """Mean and standard error over the frames."""
        return {"psnr_fg_mean": float(np.mean(self.psnr_fg)), "psnr_fg_error": standard_error(self.psnr_fg),
                "detail_mean": float(np.mean(self.detail)), "detail_error": standard_error(self.detail)}


def choose(scores: list[SizeScore]) -> SizeScore:
    """The smallest size within one standard error of the best in PSNR (at most `MOST_LOST`), and of the sharpest of these in detail
    (at least `DETAIL_LOST`): where frame and pose disagree a little, blur has the best PSNR. One frame has no standard error.
    """
    best = max(scores, key=lambda r: np.mean(r.psnr_fg))
    lost = min(standard_error(best.psnr_fg), MOST_LOST) if len(best.psnr_fg) > 1 else MOST_LOST
    near = [r for r in scores if np.mean(r.psnr_fg) >= np.mean(best.psnr_fg) - lost]
    sharpest = max(near, key=lambda r: np.mean(r.detail))
    least = np.mean(sharpest.detail) - max(standard_error(sharpest.detail), DETAIL_LOST * np.mean(sharpest.detail))
    return min((r for r in near if np.mean(r.detail) >= least), key=lambda r: r.n_gaussians)


def optimism(scores: list[SizeScore]) -> float:
    """dB by which the choosing frames flatter the choice: each frame's score minus that of the size the other frames choose."""
    frames = range(len(scores[0].psnr_fg))
    if len(frames) < 3:
        return 0.0
    best, found = choose(scores), []
    for f in frames:
        rest = [t for t in frames if t != f]
        others = [SizeScore(r.n_gaussians, [r.psnr_fg[t] for t in rest], [r.detail[t] for t in rest]) for r in scores]
        taken = scores[others.index(choose(others))]
        found.append(best.psnr_fg[f] - taken.psnr_fg[f])
    return float(np.mean(found))


def standard_error(values: list[float]) -> float:
    """Of the mean of the values; 0 for a single one."""
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0

"""The rule that picks a size from a ladder of avatars, all judged on the same frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MOST_LOST = 0.25
"""dB below the best that no standard error excuses."""
DETAIL_LOST = 0.05
"""Share of the best's detail that may be lost however little the frames differ: less cannot be seen."""


@dataclass
class Rung:
    """One size, judged."""

    n_gaussians: int
    psnr_fg: list[float]
    """dB, one a frame."""
    detail: list[float]
    """`metrics.detail`, one a frame."""

    def means(self) -> dict[str, float]:
        """Mean and standard error over the frames."""
        return {"psnr_fg_mean": float(np.mean(self.psnr_fg)), "psnr_fg_error": standard_error(self.psnr_fg),
                "detail_mean": float(np.mean(self.detail)), "detail_error": standard_error(self.detail)}


def choose(rungs: list[Rung]) -> Rung:
    """The smallest rung within one standard error of the best in PSNR (and `MOST_LOST`) and in detail (or `DETAIL_LOST`)."""
    best = max(rungs, key=lambda r: np.mean(r.psnr_fg))
    least = np.mean(best.psnr_fg) - min(standard_error(best.psnr_fg), MOST_LOST)
    least_detail = np.mean(best.detail) - max(standard_error(best.detail), DETAIL_LOST * np.mean(best.detail))
    good = [r for r in rungs if np.mean(r.psnr_fg) >= least and np.mean(r.detail) >= least_detail]
    return min(good, key=lambda r: r.n_gaussians)


def optimism(rungs: list[Rung]) -> float:
    """dB by which the frames that chose flatter their choice: each judged with what all the others would have taken."""
    frames = range(len(rungs[0].psnr_fg))
    if len(frames) < 3:
        return 0.0
    best, found = choose(rungs), []
    for f in frames:
        rest = [t for t in frames if t != f]
        others = [Rung(r.n_gaussians, [r.psnr_fg[t] for t in rest], [r.detail[t] for t in rest]) for r in rungs]
        taken = rungs[others.index(choose(others))]
        found.append(best.psnr_fg[f] - taken.psnr_fg[f])
    return float(np.mean(found))


def standard_error(values: list[float]) -> float:
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0

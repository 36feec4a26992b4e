"""Figures of the avatars of a batch beside each other: which stand out, and which have changed since the batch before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median
from typing import Any

from gsac.pipeline.report.results import number

FEWEST = 6
"""Clips below which none stands out from the others."""
FAR = 3.5
"""Median deviations, as of a normal distribution, from which on a figure stands out."""
NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median deviation."""


@dataclass(frozen=True)
class Figure:
    """A figure of metrics.json on the page of a batch."""

    name: str
    title: str
    unit: str
    digits: int
    notable: float
    """Difference between two batches, or from the median of this one, below which nobody needs to look."""
    more_is_better: bool = True

    def words(self, value: float) -> str:
        """`23.4 dB`"""
        return f"{value:,.{self.digits}f}{' ' if self.unit else ''}{self.unit}"

    def worse(self, value: float, other: float) -> float:
        """By how much a value is worse than another one."""
        return (other - value) if self.more_is_better else (value - other)


FIGURES = (
    Figure("psnr_fg", "Person", "dB", 1, 0.3),
    Figure("psnr_face", "Face", "dB", 1, 0.5),
    Figure("psnr_hands", "Hands", "dB", 1, 0.5),
    Figure("alpha_iou", "Outline", "", 3, 0.01),
)
"""Of held-out frames, in the order of the page."""


def read_figures(metrics: Mapping[str, Any]) -> dict[str, float]:
    """Name -> value, of the figures that there are."""
    found = {figure.name: number(metrics.get(figure.name)) for figure in FIGURES}
    return {name: value for name, value in found.items() if value is not None}


def list_words(values: Mapping[str, float]) -> list[str]:
    """`Person 23.4 dB`, of each figure that there is."""
    return [f"{figure.title} {figure.words(values[figure.name])}" for figure in FIGURES if figure.name in values]


def list_changes(values: Mapping[str, float], before: Mapping[str, float]) -> list[str]:
    """Figures that differ notably from those of the batch before, in words."""
    both = [(figure, values[figure.name], before[figure.name]) for figure in FIGURES
            if figure.name in values and figure.name in before]
    return [f"{figure.title} {figure.words(value)}, before {figure.words(old)}" for figure, value, old in both
            if abs(value - old) >= figure.notable]


def find_outliers(clips: list[Mapping[str, float]]) -> list[list[str]]:
    """For each clip the figures that are far worse than those of the others, in words."""
    out: list[list[str]] = [[] for _ in clips]
    for figure in FIGURES:
        values = [clip[figure.name] for clip in clips if figure.name in clip]
        if len(values) < FEWEST:
            continue
        middle = median(values)
        bound = max(FAR * NORMAL * median(abs(value - middle) for value in values), figure.notable)
        for words, clip in zip(out, clips, strict=True):
            if figure.name in clip and figure.worse(clip[figure.name], middle) > bound:
                words.append(f"{figure.title} {figure.words(clip[figure.name])}, the median is {figure.words(middle)}")
    return out

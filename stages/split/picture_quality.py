"""Judges a clip by its pictures alone: repeated ones, other scenes, changes of exposure, blur.

Each picture is looked at small and forgotten; what is kept of it are the means of its blocks, and how sharp it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from gsac.stages.findings import Code, Finding, runs_of_frames

HEIGHT = 480
"""px at most of the small picture: blur that is not seen there takes no detail from an avatar."""
BLOCKS = 30
"""Blocks from top to bottom of a picture."""
STILL = 1.5
"""Largest change of a block, of 255, by noise and compression alone; a person who moves changes one by ten times that."""
FROZEN = 3
"""Repeated pictures in a row that are news: phones repeat one now and then."""
MANY_REPEATED = 0.1
"""Share of the frames from which on single repeated ones are news."""
OTHER_PICTURE, SAME_PLACE = 12.0, 0.5
"""Of another scene: the median change of a block, of 255, and the correlation of the blocks below which it is one."""
SAME_SCENE = 0.8
"""Least correlation of the two pictures before a cut, or of the two after it: where a camera swings, all neighbours differ."""
MIRRORED = 0.8
"""Correlation with the mirrored picture from which on a scene is the same one."""
ALIKE = 0.5
"""Least correlation with the clip's median picture for exposure to be compared."""
STEP, TINT = np.log(1.2), np.log(1.1)
"""Change of exposure, and of one colour against the others, that leaves patches on an avatar."""
DARKEST = 4
"""Added to a block before it is divided, of 255: noise decides below."""
DETAIL = 0.99
"""Quantile of the differences of neighbouring pixels that stands for a picture's edges."""
FLAT = 6
"""Edges, of 255, below which a picture is too plain to tell its blur."""
BLURRED = 0.65
"""Sharpness below which a picture is blurred: it is 0.5 where one half as large holds all that it holds, and from 0.67 on in
filmed ones."""
SOFTER = 0.7
"""Share of the clip's own sharpness, across or along, below which a frame moved or lost its focus."""
SHARPEST = 90
"""Percentile of the frames that stands for the clip's own sharpness."""


@dataclass(frozen=True)
class Look:
    """What is kept of one picture."""

    blocks: np.ndarray
    """(h, w, 3) float32 means, 0..255."""
    sharpness: np.ndarray
    """(3,) as `measure_sharpness`."""

    def turned(self) -> Look:
        """Of the mirrored picture."""
        return replace(self, blocks=self.blocks[:, ::-1])


def look_at(picture: np.ndarray) -> Look:
    """picture: (H, W, 3) uint8 RGB, at most HEIGHT high."""
    height, width = picture.shape[:2]
    size = max(2, round(width * BLOCKS / height)), BLOCKS
    return Look(cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.float32), measure_sharpness(picture))


def measure_sharpness(picture: np.ndarray) -> np.ndarray:
    """Edges of picture (H, W, 3) uint8 against those of one half as large. Returns (3,), 0.5 to about 1: of all edges, of upright
    and of level ones; NaN where it is too plain to tell."""
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    half = cv2.resize(grey, (max(2, grey.shape[1] // 2), max(2, grey.shape[0] // 2)), interpolation=cv2.INTER_AREA)
    fine, coarse = measure_edges(grey), measure_edges(half)
    return np.where(coarse[0] < FLAT, np.nan, fine / np.maximum(coarse, 1))


def measure_edges(grey: np.ndarray) -> np.ndarray:
    """The quantile DETAIL of the slopes of grey (H, W) uint8. Returns (3,), 0..255: across and along together, across, along."""
    across, along = (cv2.convertScaleAbs(cv2.Sobel(grey, cv2.CV_16S, 1 - axis, axis), alpha=0.25) for axis in (0, 1))
    return np.array([_quantile(slope) for slope in (cv2.addWeighted(across, 0.5, along, 0.5, 0), across, along)])


def _quantile(image: np.ndarray) -> float:
    """The quantile DETAIL of image (H, W) uint8, from its histogram: sorting takes ten times as long."""
    share = np.cumsum(cv2.calcHist([image], [0], None, [256], [0, 256]).ravel(), dtype=np.float64) / image.size
    at = int(np.searchsorted(share, DETAIL))
    below = share[at - 1] if at else 0.0
    return at + float((DETAIL - below) / (share[at] - below))


def find_repeats(blocks: np.ndarray) -> np.ndarray:
    """blocks: (T, h, w, 3), 0..255. Returns (T,) bool: pictures that show what an earlier one shows, all in a row since then; none
    where nothing moves all through the clip."""
    repeated, shown = np.zeros(len(blocks), bool), 0
    for t in range(1, len(blocks)):
        repeated[t] = is_still(blocks[shown], blocks[t])
        shown = shown if repeated[t] else t
    return repeated & (shown > 0)


def is_still(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """(...) bool: whether pictures show what an earlier one shows. before: (h, w, 3); after: (..., h, w, 3); 0..255."""
    return np.abs(after - before).mean(-1).max((-2, -1)) < STILL


def find_scene_cuts(blocks: np.ndarray) -> np.ndarray:
    """blocks: (T, h, w, 3), 0..255. Returns (T,) bool: the first frames of other scenes; not those of a flash, of black or mirrored
    pictures, or of a camera that swings."""
    cuts = np.zeros(len(blocks), bool)
    for t in range(1, len(blocks) - 1):
        if max(correlate(*blocks[t:t + 2]), correlate(*blocks[t - 2:t]) if t > 1 else 0) < SAME_SCENE:
            continue
        cuts[t] = all(np.median(np.abs(after - before)) > OTHER_PICTURE and abs(correlate(after, before)) < SAME_PLACE
                      and correlate(after[:, ::-1], before) < MIRRORED and min(after.std(), before.std()) > OTHER_PICTURE
                      for before in blocks[max(0, t - 2):t] for after in blocks[t:t + 2])
    return cuts


def correlate(a: np.ndarray, b: np.ndarray) -> float:
    """a, b: (...) of one shape. Returns their correlation, -1..1; 0 where one is constant."""
    a, b = a - a.mean(), b - b.mean()
    size = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / size) if size > 1e-6 else 0.0


def measure_exposure(blocks: np.ndarray) -> np.ndarray:
    """blocks: (T, h, w, 3), 0..255. Returns (T, 3) log of each colour against the frame of median brightness; NaN in frames
    that show something else than most."""
    usual = np.median(blocks, 0)
    gains = np.median(np.log((blocks + DARKEST) / (usual + DARKEST)), (1, 2))
    alike = [correlate(each, usual) >= ALIKE for each in blocks]
    gains = np.where(np.array(alike)[:, None], gains, np.nan)
    return gains - gains[np.argsort(gains.mean(1))[sum(alike) // 2]]  # a frame: the median may lie between two exposures


def find_exposure_steps(gains: np.ndarray) -> np.ndarray:
    """gains: (T, 3) of `measure_exposure`. Returns (T,) bool: frames of another exposure or white balance than most."""
    gains = np.nan_to_num(gains)
    level = np.median(gains, 1)
    return (np.abs(level) > STEP) | (np.abs(gains - level[:, None]).max(1) > TINT)


def find_blurred(sharpness: np.ndarray) -> np.ndarray:
    """sharpness: (T, 3) of `measure_sharpness`. Returns (T,) bool: frames that are blurred, or far more than the sharpest."""
    sharpness = np.where(np.isfinite(sharpness), sharpness, 1)
    softer = sharpness[:, 1:] < SOFTER * np.percentile(sharpness[:, 1:], SHARPEST, 0)
    return (sharpness[:, 0] < BLURRED) | softer.any(1)


def judge_pictures(looks: list[Look], timed: bool,
                   find_shown: Callable[[np.ndarray], np.ndarray] | None = None) -> tuple[np.ndarray, list[Finding]]:
    """Repeated frames (T,) bool, and what is wrong with the pictures.

    timed: whether they are of a video: photos repeat nothing; find_shown: of some frames (T,) bool, those that show somebody: an
    empty room stands still and may be plain; None: all do.
    """
    blocks, findings = np.stack([look.blocks for look in looks]), []
    repeated = find_repeats(blocks) if timed else np.zeros(len(looks), bool)
    frozen = np.zeros(len(looks), bool)
    for first, last in runs_of_frames(repeated):
        frozen[first:last + 1] = last - first + 1 >= FROZEN
    single = repeated & ~frozen
    sharpness = np.stack([look.sharpness for look in looks])
    blurred = find_blurred(sharpness)
    doubted = frozen | blurred
    if find_shown is not None and doubted.any() and not doubted.all():
        shown = find_shown(doubted)
        frozen, blurred = frozen & shown, blurred & shown
    if timed and len(blocks) > FROZEN and is_still(blocks[0], blocks[1:]).all():
        findings.append(Finding.of(Code.NOTHING_MOVES, figure=len(blocks)))
    if frozen.any():
        findings.append(Finding.of(Code.FROZEN, frozen, figure=frozen.sum()))
    if single.mean() > MANY_REPEATED:
        findings.append(Finding.of(Code.REPEATED, single, figure=single.sum()))
    if timed and (cuts := find_scene_cuts(blocks)).any():
        findings.append(Finding.of(Code.SCENE_CUT, cuts, figure=cuts.sum()))
    gains = measure_exposure(blocks)
    if (steps := find_exposure_steps(gains)).any():
        findings.append(Finding.of(Code.EXPOSURE_STEPS, steps, figure=np.exp(np.abs(gains[steps]).max()) - 1))
    if blurred.any():
        findings.append(Finding.of(Code.BLURRED, blurred, figure=sharpness[blurred, 0].min()))
    return repeated, findings

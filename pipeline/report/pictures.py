"""Pictures for a page: frames by time, one crop round the person, size-bounded WebP data URIs."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.artifacts import FILLED_SHAPES, KEYPOINT_SHAPES, ArtifactError, Clip, check_arrays, frame_paths
from gsac.avatar.frame_files import read_alpha, read_frame
from gsac.avatar.wholebody import BODY, FEET
from gsac.pipeline.report.results import AbsentError, Results

QUALITIES = (82, 68, 52, 36, 20)
EXACT = 101
"""The quality above all others: every pixel as it is."""
MOST_BYTES = 42_000
"""Of one picture; about 60 of them make a page."""
SEEN = 0.2
"""Least score of a point that is drawn or counted."""
MARGIN = 0.08
"""Room round the person's box, in units of its longer side."""


@dataclass
class Picture:
    """One <img> and the words under it."""

    uri: str
    width: int
    height: int
    caption: str
    alt: str
    frame: int | None = None
    """The frame of the clip that it shows."""


def make_picture(rgb: np.ndarray, caption: str, alt: str, most_bytes: int = MOST_BYTES, frame: int | None = None,
                 qualities: tuple[int, ...] = QUALITIES) -> Picture:
    """rgb: (H, W, 3) uint8; frame: that it shows. Quality falls, then size, until the file is at most `most_bytes`."""
    shown = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    while True:
        for quality in qualities:
            ok, data = cv2.imencode(".webp", shown, [cv2.IMWRITE_WEBP_QUALITY, quality])
            if ok and len(data) <= most_bytes:
                uri = "data:image/webp;base64," + base64.b64encode(data.tobytes()).decode()
                return Picture(uri, shown.shape[1], shown.shape[0], caption, alt, frame)
        shown = cv2.resize(shown, None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA)


def shrink_to_fit(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """image: (H, W, 3) uint8. Returns it, (h, w, 3), made smaller, never larger, to fit into width x height; its aspect stays."""
    scale = min(width / image.shape[1], height / image.shape[0], 1.0)
    if scale == 1.0:
        return image
    size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def spread_evenly(count: int, most: int) -> list[int]:
    """At most `most` of the numbers 0..count-1, evenly spaced, the first and the last among them."""
    return sorted({round(x) for x in np.linspace(0, count - 1, min(most, count))}) if count else []


@dataclass(frozen=True)
class Crop:
    """A box of the frame and the scale at which it is shown."""

    x0: int
    y0: int
    x1: int
    y1: int
    scale: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture, px."""
        return max(1, round((self.x1 - self.x0) * self.scale)), max(1, round((self.y1 - self.y0) * self.scale))

    def cut(self, image: np.ndarray) -> np.ndarray:
        """image: (H, W, ...), the whole frame. Returns the box, (h, w, ...)."""
        return cv2.resize(image[self.y0:self.y1, self.x0:self.x1], self.size, interpolation=cv2.INTER_AREA)

    def points(self, xy: np.ndarray) -> np.ndarray:
        """xy: (..., 2) px of the frame. Returns (..., 2) px of the crop."""
        return (xy - (self.x0, self.y0)) * (np.array(self.size) / (self.x1 - self.x0, self.y1 - self.y0))


def is_found(k: dict[str, np.ndarray]) -> np.ndarray:
    """(T, 133) bool: the point was found in the image, not filled. k: arrays of keypoints.npz, (T, 133, ...)."""
    return (k["score"] >= SEEN) & ~k["filled"] if "filled" in k else k["score"] >= SEEN


class RunPictures:
    """Frames, masks and keypoints of one run, read once."""

    def __init__(self, results: Results):
        self.results = results
        self._frames: dict[int, np.ndarray] = {}

    @cached_property
    def clip(self) -> Clip:
        return Clip.read(self.results.path("split/clip.json"))

    @cached_property
    def frames(self) -> list[Path]:
        paths = frame_paths(self.results.path("split/frames"))
        if not paths:
            raise AbsentError("split/frames holds no frame.")
        return paths

    @cached_property
    def keypoints(self) -> dict[str, np.ndarray]:
        """Arrays of handgap/keypoints.npz: xy (T, 133, 2) px, score (T, 133), missing (T, 2), filled (T, 133); else, without the
        last two, of keypoints/keypoints.npz."""
        try:
            return check_arrays(self.results.path("handgap/keypoints.npz"), FILLED_SHAPES)
        except AbsentError:
            return check_arrays(self.results.path("keypoints/keypoints.npz"), KEYPOINT_SHAPES)

    @cached_property
    def face_valid(self) -> np.ndarray | None:
        """(T,) bool, frames whose face was used; None where stage face left nothing readable."""
        try:
            return check_arrays(self.results.path("face/face.npz"), {"valid": ("T",)})["valid"].astype(bool)
        except (AbsentError, ArtifactError):
            return None

    @cached_property
    def person_found(self) -> np.ndarray:
        """(T,) bool, frames in which the detector found a point of the body; what handgap filled is none. All, without readable
        points."""
        count = len(self.frames)
        try:
            k = self.keypoints
        except (AbsentError, ArtifactError):
            return np.ones(count, bool)
        found = is_found(k)[:, BODY].any(1)
        return np.concatenate([found, np.zeros(count, bool)])[:count]

    def frame(self, t: int) -> np.ndarray:
        """Frame t, (H, W, 3) uint8."""
        if t not in self._frames:
            self._frames[t] = read_frame(self.frames[t])
        return self._frames[t]

    def alpha(self, t: int) -> np.ndarray:
        """Mask of frame t, (H, W) float32 in 0..1. AbsentError where there is none that can be read."""
        path = self.results.path("segment/alpha") / f"{self.frames[t].stem}.exr"
        if not path.is_file():
            raise AbsentError(f"segment/alpha has no mask for frame {self.frames[t].stem}.")
        try:
            return read_alpha(path)
        except ArtifactError as e:
            raise AbsentError(f"The mask of frame {self.frames[t].stem} in segment/alpha cannot be read.") from e

    def moment(self, t: int) -> str:
        """`frame 12 · 0.40 s`"""
        times = self.clip.timestamps_s
        return f"frame {t}" + (f" · {times[t]:.2f} s" if times and t < len(times) else "")

    def crop(self, width: int, height: int) -> Crop:
        """A box round the person in all frames, one for all pictures of a sheet; width, height: px that it is shown in, at most."""
        h, w = self.frame(0).shape[:2]
        box = (0, 0, w, h)
        try:
            k = self.keypoints
            stem = slice(BODY.start, FEET.stop)
            xy = k["xy"][:, stem][(k["score"][:, stem] >= SEEN) & np.isfinite(k["xy"][:, stem]).all(2)]
        except Exception:  # without usable keypoints the whole frame is shown
            xy = np.empty((0, 2))
        if len(xy) >= 4:
            low, high = np.quantile(xy, (0.002, 0.998), axis=0)
            room = MARGIN * (high - low).max()
            low, high = np.clip(low - room, 0, (w - 1, h - 1)), np.clip(high + room, 1, (w, h))
            if (high - low).min() >= 16:
                (x0, y0), (x1, y1) = np.floor(low).astype(int).tolist(), np.ceil(high).astype(int).tolist()
                box = (x0, y0, x1, y1)
        scale = min(width / (box[2] - box[0]), height / (box[3] - box[1]), 1.0)
        return Crop(*box, scale)

"""A truth clip as the camera gave it: pictures, times, and the truth of each picture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.artifacts import frame_paths, read_arrays
from gsac.avatar.frame_files import read_frame
from gsac.benchmarks.fit.truth import Truth, read_truth
from gsac.stages.contract import BadInput

FPS = 10.0
"""Of truth clips that do not say theirs."""


@dataclass(frozen=True)
class Take:
    """T pictures of a person, and the truth of the clean take that they come from."""

    frames: np.ndarray  # (T, H, W, 3) uint8, RGB
    masks: np.ndarray  # (T, H, W) bool, the person of the truth
    points: np.ndarray  # (T, 23, 2) px, COCO's body and feet
    times: np.ndarray  # (T,) s
    yaw: np.ndarray  # (T,) rad, 0: the person faces the camera
    number: np.ndarray  # (T,) place of each picture, and of its truth, in the clean take
    asked: np.ndarray  # (T,) bool, pictures that the fit is judged by
    rotation: np.ndarray  # (T, 3, 3) camera of the truth -> camera of the picture
    truth: Truth
    focal: float | None = None
    """px, as the file would say it."""

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of the pictures, px."""
        return self.frames.shape[1], self.frames.shape[2]

    @property
    def scale(self) -> float:
        """px of these pictures for one of a clip 1280 px high."""
        return max(self.size) / 1280

    @property
    def camera(self) -> np.ndarray:
        """(3, 3) px, the truth's camera at the size of these pictures."""
        (x, y), scale = self.truth.center, self.size[0] / (2 * self.truth.center[1])
        return np.array([[self.truth.focal * scale, 0, x * scale], [0, self.truth.focal * scale, y * scale], [0, 0, 1]])

    def at(self, order: np.ndarray) -> Take:
        """The take of pictures order, (N,) int, at their own times."""
        names = ("frames", "masks", "points", "times", "yaw", "number", "asked", "rotation")
        each = {name: getattr(self, name)[order] for name in names}
        return replace(self, **each)

    def turned(self, quarters: int) -> Take:
        """The take turned by so many quarters, counter-clockwise as seen."""
        points = self.points
        for width in (self.size[::-1] * 2)[:quarters]:
            points = np.stack([points[..., 1], width - points[..., 0]], -1)
        own = Rotation.from_euler("z", -90 * quarters, degrees=True).as_matrix()  # y points down
        return replace(self, frames=np.rot90(self.frames, quarters, (1, 2)), masks=np.rot90(self.masks, quarters, (1, 2)),
                       points=points, rotation=own @ self.rotation)

    def boxes(self) -> np.ndarray:
        """Left, top, right and bottom (T, 4) px of the person; zeros where there is none."""
        out = np.zeros((len(self.masks), 4), int)
        for t, mask in enumerate(self.masks):
            rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
            if len(rows):
                out[t] = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
        return out


@lru_cache(maxsize=3)
def read_take(folder: Path, frames: int, height: int) -> Take:
    """The truth clip of a folder (clip.mp4 or frames/, mask/ and truth.npz), that many frames spread evenly, at that height, px."""
    if not (folder / "truth.npz").is_file():
        raise BadInput(f"{folder}: expected a truth clip (clip.mp4, mask/, truth.npz), as gsac.turntable makes it")
    arrays, truth = read_arrays(folder / "truth.npz"), read_truth(folder)
    pictures = _read_pictures(folder)
    count = min(len(pictures), len(truth.joints))
    keep = np.linspace(0, count, min(frames, count), endpoint=False).astype(int)
    full_height, full_width = pictures[0].shape[:2]
    width = 2 * round(height * full_width / full_height / 2)
    small = np.stack([cv2.resize(pictures[t], (width, height), interpolation=cv2.INTER_AREA) for t in keep])
    masks = np.stack([cv2.resize(truth.masks[t].astype(np.uint8), (width, height), interpolation=cv2.INTER_AREA) for t in keep]) > 0
    yaw = arrays.get("yaw", np.zeros(count))[keep]
    fps = float(arrays.get("fps", FPS))
    few = replace(truth, joints=truth.joints[keep], keypoints=truth.keypoints[keep], masks=truth.masks[keep, :1, :1], vertices=None)
    return Take(small, masks, few.keypoints * (height / full_height), keep / fps, yaw, np.arange(len(keep)),
                np.ones(len(keep), bool), np.tile(np.eye(3), (len(keep), 1, 1)), few)


def _read_pictures(folder: Path) -> list[np.ndarray]:
    """Frames (H, W, 3) uint8 RGB of frames/, or of clip.mp4."""
    if (folder / "frames").is_dir():
        return [read_frame(path) for path in frame_paths(folder / "frames")]
    video, out = cv2.VideoCapture(str(folder / "clip.mp4")), []
    while (got := video.read())[0]:
        out.append(cv2.cvtColor(got[1], cv2.COLOR_BGR2RGB))
    if not out:
        raise BadInput(f"{folder / 'clip.mp4'}: cannot be read as a video")
    return out

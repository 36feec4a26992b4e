"""Frames as training and judging use them, cut out with the mask, 8 bit: scaled and cropped to the person, or whole as filmed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.artifacts import frame_paths
from gsac.avatar.camera import Camera
from gsac.avatar.frame_files import read_alpha, read_frame
from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.threads import available_cores, side_by_side
from gsac.stages.contract import StageError
from gsac.stages.missing_frames import pair_masks
from gsac.stages.train.edge_colour import unmix

MARGIN = 0.06
"""Margin round the mask's box, in units of its height: limbs may move there while poses are refined."""
FAINT = 25
"""Value of the mask, 0..255, up to which a pixel shows nobody."""
NEAR = 0.02
"""Share of the person's height within which something that stands there hides the person, rather than stands beside them."""
KEPT = 0.8
"""Least share of the person's pixels that a cut may keep: a pole hides less than a cut beside it would take."""
LEAST_SHARE = 2e-4
"""A mask that covers less of the frame counts as empty."""


@dataclass
class View:
    """A frame, or a crop of it, at one size."""

    camera: Camera
    """Of the crop: the frame's, with its centre moved."""
    pixels: np.ndarray
    """(h, w, 4) uint8, premultiplied RGB and mask."""
    corner: tuple[int, int]
    """x, y of the crop in the frame, px."""
    whole: Camera | None = None
    """The frame's camera, at this size, where this is a crop of it."""

    @property
    def frame(self) -> Camera:
        """The camera of the whole frame at this size."""
        return self.whole or self.camera

    def crop(self, x0: int, y0: int, x1: int, y1: int) -> View:
        """Columns x0 to x1 and rows y0 to y1, px, the last ones excluded."""
        c = self.camera
        return View(Camera(c.focal, (c.center[0] - x0, c.center[1] - y0), x1 - x0, y1 - y0),
                    np.ascontiguousarray(self.pixels[y0:y1, x0:x1]), (self.corner[0] + x0, self.corner[1] + y0), self.frame)

    def halved(self) -> View:
        """The view at half its size, with corner (0, 0)."""
        return self.resized(max(1, self.camera.width // 2), max(1, self.camera.height // 2))

    def scaled(self, scale: float) -> View:
        """The view at `scale` of its size, with corner (0, 0); as it is where that is not smaller."""
        w, h = self.camera.width, self.camera.height
        return self if scale >= 1 else self.resized(max(1, round(scale * w)), max(1, round(scale * h)))

    def reduced(self, height: int) -> View:
        """The view at a height, px, with corner (0, 0); as it is where it is not higher."""
        w, h = self.camera.width, self.camera.height
        return self if h <= height else self.resized(max(1, round(w * height / h)), height)

    def resized(self, width: int, height: int) -> View:
        """The view at a smaller size, px, by area, with corner (0, 0)."""
        pixels = cv2.resize(self.pixels, (width, height), interpolation=cv2.INTER_AREA)
        return View(self.camera.scaled(width, height), pixels, (0, 0))


Views = Mapping[int, View] | list[View]
"""Views by frame."""


def of_each(change: Callable[[View], View], views: Mapping[int, View]) -> dict[int, View]:
    """Frame -> its view, changed: all views side by side."""
    return dict(zip(views, side_by_side(lambda view, _: change(view), views.values()), strict=True))


def read_views(frames: Path, alphas: Path, camera: Camera, height: int | None, mixed: bool = False,
               occluder: np.ndarray | None = None) -> tuple[list[View], list[int]]:
    """All T frames, at most `height` px high (None: as they are), each cropped to its person.

    camera: of the frames on disk; mixed: whether the soft edge keeps what it has of the background's colour; occluder: (h, w) of
    the whole frame, above 0.5 where something stands before the person.

    Returns the views and the indices of those whose mask is empty. Raises StageError for masks that do not fit the frames.
    """
    paths = frame_paths(frames)
    masks = pair_masks([path.stem for path in paths], alphas)

    def read(pair: tuple[Path, Path | None]) -> tuple[View, bool]:
        view, share = _read_view(*pair, camera, height, mixed)
        if share < LEAST_SHARE or not (view.pixels[..., 3] > FAINT).any():
            return view.crop(0, 0, 1, 1), False
        return cut_to_seen(person_crop(view), occluder), True

    with ThreadPoolExecutor(available_cores()) as pool:
        found = list(pool.map(read, zip(paths, masks, strict=True)))
    return [view for view, _ in found], [t for t, (_, shown) in enumerate(found) if not shown]


def read_whole(frames: Path, alphas: Path, camera: Camera, chosen: Iterable[int],
               occluder: np.ndarray | None = None) -> dict[int, View]:
    """Frame -> its view, whole but for what `occluder` (h, w) hides, and as large as its file, of the chosen frames. camera: of the
    frames on disk.

    Raises StageError for masks that do not fit the frames.
    """
    paths = frame_paths(frames)
    masks = pair_masks([path.stem for path in paths], alphas)
    wanted = [int(t) for t in chosen]

    def read(t: int) -> View:
        return cut_to_seen(_read_view(paths[t], masks[t], camera)[0], occluder)

    with ThreadPoolExecutor(available_cores()) as pool:
        return dict(zip(wanted, pool.map(read, wanted), strict=True))


def _read_view(path: Path, mask: Path | None, camera: Camera, height: int | None = None,
               mixed: bool = False) -> tuple[View, float]:
    """The frame cut out with its mask (None: of nobody), at most `height` px high, and the share of it that the mask covers."""
    rgb = read_frame(path)
    alpha: np.ndarray = np.zeros(rgb.shape[:2], np.float32) if mask is None else read_alpha(mask)
    if alpha.shape != rgb.shape[:2]:
        raise StageError(f"{mask}: mask is {alpha.shape[1]}x{alpha.shape[0]} px, its frame {rgb.shape[1]}x{rgb.shape[0]}")
    if not np.isfinite(alpha).all():
        raise StageError(f"{mask}: mask is not finite")
    alpha = np.clip(alpha, 0, 1)
    h = min(height or rgb.shape[0], rgb.shape[0])
    w = max(1, round(rgb.shape[1] * h / rgb.shape[0]))
    if (w, h) == (rgb.shape[1], rgb.shape[0]):
        pixels, area = np.zeros((h, w, 4), np.uint8), _shown(alpha)
        cut, cut_alpha = np.ascontiguousarray(rgb[area]), np.ascontiguousarray(alpha[area])
        pixels[area] = cut_out_bytes(cut if mixed else unmix(cut, cut_alpha), cut_alpha)
    else:
        pixels = _to_bytes(cv2.resize(_cut_out(rgb, alpha, mixed), (w, h), interpolation=cv2.INTER_AREA))
    return View(camera.scaled(w, h), pixels, (0, 0)), float(alpha.mean())


def _shown(alpha: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns of all that the mask, alpha (H, W), shows: elsewhere the cut-out is zero."""
    hits = [np.flatnonzero((alpha > 0).any(axis)) for axis in (1, 0)]
    rows, columns = (slice(at[0], at[-1] + 1) if len(at) else slice(0, 0) for at in hits)
    return rows, columns


def _cut_out(rgb: np.ndarray, alpha: np.ndarray, mixed: bool) -> np.ndarray:
    """(H, W, 4) float32 in 0..255, premultiplied RGB and mask. rgb: (H, W, 3) uint8; alpha: (H, W)."""
    return np.dstack([(rgb if mixed else unmix(rgb, alpha)) * alpha[..., None], alpha * 255])


@own_kernel(nogil=True)
def cut_out_bytes(rgb, alpha):
    """(h, w, 4) uint8, as `_cut_out`. rgb: (h, w, 3) uint8; alpha: (h, w) float32 in 0..1."""
    height, width = alpha.shape
    pixels = np.empty((height, width, 4), np.uint8)
    for y in range(height):
        for x in range(width):
            for c in range(3):
                pixels[y, x, c] = np.uint8(np.rint(np.float32(rgb[y, x, c]) * alpha[y, x]))
            pixels[y, x, 3] = np.uint8(np.rint(alpha[y, x] * np.float32(255)))
    return pixels


def _to_bytes(pixels: np.ndarray) -> np.ndarray:
    """(H, W, 4) uint8."""
    return np.clip(np.round(pixels), 0, 255).astype(np.uint8)


def person_crop(view: View) -> View:
    """The view cut to the box of its mask and a margin."""
    rows, columns = (np.flatnonzero((view.pixels[..., 3] > FAINT).any(axis)) for axis in (1, 0))
    margin = int(np.ceil(MARGIN * (rows[-1] - rows[0]))) + 4
    return view.crop(max(columns[0] - margin, 0), max(rows[0] - margin, 0),
                     min(columns[-1] + 1 + margin, view.camera.width), min(rows[-1] + 1 + margin, view.camera.height))


def cut_to_seen(view: View, occluder: np.ndarray | None) -> View:
    """The view cut to that side of what stands before the person (above, below, left or right of it) which shows most of them.

    occluder: (h, w) of the whole frame at any size, above 0.5 where something hides the person, or None. The view as it is where
    nothing does, or the cut would take more than it hides.
    """
    if occluder is None:
        return view
    mask = (view.pixels[..., 3] > 127).astype(np.uint8)
    if not mask.any():
        return view
    (x, y), (h, w) = view.corner, mask.shape
    whole = cv2.resize(occluder.astype(np.float32), (view.frame.width, view.frame.height), interpolation=cv2.INTER_LINEAR)
    reach = 2 * int(np.ceil(NEAR * np.ptp(np.flatnonzero(mask.any(1))))) + 1
    hides = (whole[y:y + h, x:x + w] > 0.5) & (cv2.dilate(mask, np.ones((reach, reach), np.uint8)) > 0)
    if not hides.any():
        return view
    rows, columns = np.flatnonzero(hides.any(1)), np.flatnonzero(hides.any(0))
    edge = reach // 4 + 1  # the mask's soft edge beside it is no outline
    sides = [(0, 0, w, rows[0] - edge), (0, rows[-1] + 1 + edge, w, h),
             (0, 0, columns[0] - edge, h), (columns[-1] + 1 + edge, 0, w, h)]
    shown = [mask[max(y0, 0):max(y1, 0), max(x0, 0):max(x1, 0)].sum() for x0, y0, x1, y1 in sides]
    best = int(np.argmax(shown))
    return view.crop(*map(int, sides[best])) if shown[best] >= KEPT * mask.sum() else view

"""Square frames: GSAC pads a frame to a square before it trains, so its losses are means over the square and its places are in
half widths of it."""

from __future__ import annotations

import numpy as np

from gsac.avatar.camera import Camera
from gsac.stages.train.views import FAINT, MARGIN, View

CLEAR = 10
"""px of background around all that is shown, at least: no window of SSIM that sees it, 11 px wide, then sees beyond the box."""


def side_of(views: list[View]) -> int:
    """px, side of the square that holds any of the views' frames."""
    return max(max(view.frame.width, view.frame.height) for view in views)


def square_crop(view: View, side: int, vertices: np.ndarray) -> View:
    """The part of the square, with the view's frame in its middle and nothing around the view, that can show the person.

    That is the box of mask and body and a margin; in the rest of the square, render and frame are the same background.
    vertices: (V, 3) m, camera frame. The result's corner is in the square.
    """
    camera, frame = view.camera, view.frame
    shift = np.array([side - frame.width, side - frame.height]) // 2 + view.corner
    rows, columns = np.nonzero(view.pixels[..., 3] > FAINT)
    places = camera.project(vertices[vertices[:, 2] > 0])
    points = np.concatenate([np.stack([columns, rows], 1), np.stack([columns, rows], 1) + 1, places]) + shift
    first, last = points.min(0), points.max(0)
    margin = np.ceil(MARGIN * (last[1] - first[1])) + CLEAR
    x0, y0 = np.clip(np.floor(first - margin), 0, side - 1).astype(int)
    x1, y1 = np.clip(np.ceil(last + margin), (x0 + 1, y0 + 1), side).astype(int)
    pixels = np.zeros((y1 - y0, x1 - x0, 4), np.uint8)
    (left, top), (right, bottom) = np.maximum(shift, (x0, y0)), np.minimum(shift + (camera.width, camera.height), (x1, y1))
    pixels[top - y0:bottom - y0, left - x0:right - x0] = view.pixels[top - shift[1]:bottom - shift[1],
                                                                     left - shift[0]:right - shift[0]]
    centre = camera.center[0] + shift[0] - x0, camera.center[1] + shift[1] - y0
    return View(Camera(camera.focal, centre, int(x1 - x0), int(y1 - y0)), pixels, (int(x0), int(y0)))

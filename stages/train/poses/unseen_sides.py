"""Sides that no trained frame shows the body from, where a training keeps the body's outline sharp.

A frame does not tell how far a gaussian reaches along its line of sight. Where another frame looks across that line it soon tells;
where none does, gaussians stay long, and seen from there they are fur.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.camera import Camera
from gsac.avatar.yaw import yaw
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import MARGIN, View

APART = np.radians(15)
"""rad of yaw off all trained frames from which on a side counts as unseen."""
LOOKED_AT = 24
"""Sides that are looked at for it, evenly about the body."""
BEGIN, EVERY = 0.6, 3
"""Share of a training from which on every so many steps one is made on such a side: gaussians that no frame shows lie by then."""
SHARP = 1.0
"""Weight of the L2 between alpha and its own outline, which is where it is a half."""
NEAREST = 0.2
"""m of depth, at least, of a body that the camera sees."""
HIGHEST = 2
"""Heights of the camera's image, at most, of a side: of somebody near, of whom frames show a part, the whole body is many."""


class Side(NamedTuple):
    """The body of a frame, turned."""

    frame: int
    turn: np.ndarray
    """(3, 3), about the upright axis through the pelvis."""
    view: View
    """Of the turned body, without a picture."""


def find_sides(poses: Poses, trained: np.ndarray, camera: Camera) -> list[Side]:
    """Unseen sides of the bodies as fitted; none of a clip that shows the body all round.

    trained: (n,) indices of frames; camera: of whole frames, at the size that sides are drawn at.
    """
    fitted = Poses(poses.body, poses.params)
    yaws = yaw(rotation.exp(fitted.pose[trained, 0]))
    about = 2 * np.pi * np.arange(LOOKED_AT) / LOOKED_AT
    apart = np.abs((about[:, None] - yaws + np.pi) % (2 * np.pi) - np.pi)
    unseen = about[apart.min(1) > APART]
    spread = np.linspace(0, len(trained) - 1, len(unseen)).round().astype(int)
    sides = []
    for t, own, wanted in zip(trained[spread].tolist(), yaws[spread], unseen, strict=True):
        turn = rotation.about_y(own - wanted)
        vertices = turned_vertices(fitted, t, turn)
        if vertices[:, 2].min() > NEAREST:
            sides.append(Side(t, turn, empty_view(vertices, camera).reduced(HIGHEST * camera.height)))
    return sides


def turned_vertices(poses: Poses, t: int, turn: np.ndarray) -> np.ndarray:
    """(V, 3) float32 m, the body of frame t, turned about its pelvis. turn: (3, 3)."""
    pelvis = poses.rest(t)[1][0] + poses.transl[t]
    return ((poses.vertices(t) - pelvis) @ turn.T + pelvis).astype(np.float32)


def empty_view(vertices: np.ndarray, camera: Camera) -> View:
    """The body, vertices (V, 3) m, and a margin, without a picture; it may lie beside the camera's frame."""
    at = camera.project(vertices)
    low, high = at.min(0), at.max(0)
    left, top = np.floor(low - MARGIN * (high[1] - low[1])).astype(int).tolist()
    right, bottom = np.ceil(high + MARGIN * (high[1] - low[1])).astype(int).tolist()
    width, height = right - left, bottom - top
    cut = Camera(camera.focal, (camera.center[0] - left, camera.center[1] - top), width, height)
    return View(cut, np.zeros((height, width, 4), np.uint8), (left, top), camera)


def side_at(number: int, done: float, count: int) -> int | None:
    """Index of the side, of `count`, that a step is made on; None where it is made on a frame.

    number: of the step; done: share of a training that its rates have behind them.
    """
    if not count or done < BEGIN or number % EVERY < EVERY - 1:
        return None
    return number // EVERY % count

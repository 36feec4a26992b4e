"""Draws the avatar all round for the top of the page: one wide picture, the views of a turn side by side."""

from __future__ import annotations

import numpy as np

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.frame_files import read_frame
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.metrics import WHITE, composite
from gsac.avatar.raster import render_bound
from gsac.avatar.rotation import about_y
from gsac.avatar.threads import Workspace, side_by_side
from gsac.pipeline.report.pictures import make_picture, shrink_to_fit
from gsac.pipeline.report.results import AbsentError, Results
from gsac.pipeline.report.sheets import Sheet
from gsac.stages.train.judge.novel_poses import pose_body
from gsac.stages.train.poses.poses import Poses

VIEWS = 12
"""Views of a turn."""
WIDTH, HEIGHT = 270, 440
"""px of one view."""
A_POSE = {"left_shoulder": (0.0, 0.0, -60.0), "right_shoulder": (0.0, 0.0, 60.0)}
"""Degrees about a joint's own axes, on top of the T-pose."""
ROOM = 1.06
"""Height of the picture over the person's."""
MOST_BYTES = 120_000
UPRIGHT = ((0, 0), (0, 1), (0, 2), (1, 0))
"""Row and column of front, right side, back and left side in train's views.png of two rows and three columns."""


def turn_sheet(results: Results) -> Sheet:
    """One picture of the avatar's turn; `views` of its facts says how many views stand side by side."""
    try:
        views = draw_turn(results)
    except (AbsentError, ValueError):  # of another body model, or of an older version
        views = cut_views(results)
    strip = make_picture(np.hstack(views), "The avatar, turning", "The avatar in an A-pose, turning once", MOST_BYTES)
    return Sheet([strip], facts={"views": len(views)}, columns="one")


def draw_turn(results: Results) -> list[np.ndarray]:
    """VIEWS images, (HEIGHT, WIDTH, 3) uint8, of the avatar in an A-pose."""
    params, body = BodyParams.read(results.path("train/body.npz")), Body.load()
    if params.model and params.model != body.digest:
        raise AbsentError("The avatar is of another body model.")
    gaussians = Gaussians.read(results.path("train/avatar.npz"))
    vertices = pose_body(Poses(body, params), A_POSE)
    middle, height = (vertices.min(0) + vertices.max(0)) / 2, float(np.ptp(vertices[:, 1])) * ROOM
    focal = 5 * HEIGHT
    camera = Camera((focal, focal), (WIDTH / 2, HEIGHT / 2), WIDTH, HEIGHT)

    def view(turn: float, workspace: Workspace) -> np.ndarray:
        posed = (vertices - middle) @ (np.diag([1.0, -1.0, -1.0]) @ about_y(turn)).T + [0, 0, 5 * height]
        drawn = render_bound(posed.astype(np.float32), body.faces, gaussians, camera, workspace)
        return np.round(composite(drawn.rgb, drawn.alpha, WHITE) * 255).astype(np.uint8)

    return list(side_by_side(view, np.linspace(0, 2 * np.pi, VIEWS, endpoint=False).tolist()))


def cut_views(results: Results) -> list[np.ndarray]:
    """Front, right side, back and left side, (h, w, 3) uint8 each, of train's views.png."""
    image = read_frame(results.path("train/heldout/views.png"))
    h, w = image.shape[0] // 2, image.shape[1] // 3
    return [shrink_to_fit(image[row * h:(row + 1) * h, column * w:(column + 1) * w], HEIGHT, HEIGHT) for row, column in UPRIGHT]

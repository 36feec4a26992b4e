"""How much of the surface frames show, and what the number of gaussians has to do with it: nothing."""

import numpy as np
import pytest

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.rotation import about_y, log
from gsac.avatar.zbuffer import silhouette
from gsac.stages.train.judge.surface import seen_area
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View

WIDTH, HEIGHT = 200, 320


@pytest.fixture(scope="module")
def turning():
    """Eight frames of a full turn: Poses and views whose mask is the body's silhouette."""
    body = Body.load()
    pose = np.zeros((8, 55, 3))
    pose[:, 0] = [log((np.diag([1.0, -1.0, -1.0]) @ about_y(angle))[None])[0] for angle in np.arange(8) * np.pi / 4]
    params = BodyParams.from_pose(pose, np.tile((0, 0, 4.0), (8, 1)), np.zeros(body.num_betas),
                                  np.zeros((8, body.exprdirs.shape[2])), 400, (WIDTH / 2, HEIGHT / 2), model=body.digest)
    camera, (vertices, params.joints) = params.camera(WIDTH, HEIGHT), body.posed(params)
    masks = [np.uint8(255) * silhouette(v, body.faces, camera)[..., None] for v in vertices]
    return Poses(body, params), [View(camera, np.repeat(mask, 4, 2), (0, 0)) for mask in masks]


def test_a_full_turn_shows_nearly_all_and_one_side_less_than_two_thirds(turning):
    poses, views = turning
    assert seen_area(poses, np.arange(8), views) > 0.93
    assert 0.35 < seen_area(poses, np.array([0]), views) < 0.65
    front, side, back = (seen_area(poses, np.array(frames), views) for frames in ([0], [0, 2], [0, 4]))
    assert front < side < back


def test_what_the_mask_leaves_out_is_not_seen(turning):
    poses, views = turning
    legs_off = [View(v.camera, np.where(np.arange(HEIGHT)[:, None, None] < HEIGHT // 2, v.pixels, 0), v.corner) for v in views]
    assert seen_area(poses, np.arange(8), legs_off) < 0.75 * seen_area(poses, np.arange(8), views)
    assert seen_area(poses, np.arange(8), [View(v.camera, v.pixels * 0, v.corner) for v in views]) == 0

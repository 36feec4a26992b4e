"""A pose is moved onto its image from coarse to fine: what the stripes of a shirt would hold half-way is not what is judged."""

import numpy as np
import pytest

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace
from gsac.benchmarks.moved_poses import LAST_ROUNDS, measure, move_onto
from gsac.stages.train.fast.initial_gaussians import centres_at_rest
from gsac.stages.train.poses.photometric import converge
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View

WIDTH, HEIGHT, FOCAL = 270, 480, 700.0
SHOULDER, ELBOW = 16, 18


@pytest.fixture(scope="module")
def striped():
    """Gaussians in narrow stripes, two frames of them in A-pose, and their views."""
    body = Body.load()
    pose = np.zeros((2, 55, 3))
    pose[:, 0, 0], pose[:, 16, 2], pose[:, 17, 2] = np.pi, -0.9, 0.9
    params = BodyParams.from_pose(pose, np.tile([0, 0, 3.6], (2, 1)), np.zeros(4), np.zeros((2, body.exprdirs.shape[2])), FOCAL,
                                  (WIDTH / 2, HEIGHT / 2), model=body.digest)
    params.joints = body.posed(params)[1]
    poses = Poses(body, params)
    rest = poses.rest(0)[0]
    gaussians = Gaussians.area(rest, body.faces, 6000, 0)
    places = centres_at_rest(gaussians, rest, body.faces)
    gaussians.rgb = (0.5 + 0.4 * np.sign(np.sin(100 * places))).astype(np.float32)
    camera, views = params.camera(WIDTH, HEIGHT), []
    for t in range(2):
        drawn = render_bound(poses.vertices(t), body.faces, gaussians, camera, Workspace(1))
        views.append(View(camera, np.uint8(np.dstack([drawn.rgb, drawn.alpha]).clip(0, 1) * 255), (0, 0)))
    return gaussians, poses, views


def test_a_pose_that_ends_half_way_at_full_size_goes_on_from_small_images(striped):
    gaussians, true, views = striped
    begun = true.copy()
    begun.pose[0, SHOULDER, 2] += 0.35
    begun.pose[0, ELBOW, 1] += 0.5
    alone, moved = begun.copy(), begun.copy()
    converge(gaussians, alone, [0], views, LAST_ROUNDS)
    move_onto(gaussians, moved, [0], views)
    assert measure(gaussians, moved, [0], views)[0] < 0.6 * measure(gaussians, alone, [0], views)[0]
    np.testing.assert_array_equal(moved.pose[1], true.pose[1])
    np.testing.assert_array_equal(moved.transl[1], true.transl[1])


def test_a_pose_that_fits_stays(striped):
    gaussians, true, views = striped
    moved = true.copy()
    move_onto(gaussians, moved, [1], views)
    assert np.linalg.norm(moved.vertices(1) - true.vertices(1), axis=1).max() < 0.002

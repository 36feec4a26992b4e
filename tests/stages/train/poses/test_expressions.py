"""Frames' own expressions: each face goes to its own image, and what no image tells stays."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace
from gsac.stages.train.gaussians.facial_features import density_on_head
from gsac.stages.train.poses.expressions import Actions, correct_expressions, find_facing, find_rest
from gsac.stages.train.poses.photometric import CURVATURE, find_residuals
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View

FRONT, BACK = (np.pi, 0.0, 0.0), (0.0, 0.0, np.pi)
"""Global orientations, rad."""
CAMERA = Camera((1400.0, 1400.0), (160.0, 160.0), 320, 320)
BODY = Body.load()
JAW, SMILE, BLINK = (BODY.expression_names.index(name) for name in ("jawOpen", "mouthSmileLeft", "eyeBlinkLeft"))
FITTED = 0.15


def stand(orientations) -> Poses:
    """People whose heads fill most of the image, with a jaw that is `FITTED` open."""
    frames = len(orientations)
    pose, expression = np.zeros((frames, 55, 3)), np.zeros((frames, len(BODY.expression_names)))
    pose[:, 0], expression[:, JAW] = orientations, FITTED
    params = BodyParams.from_pose(pose, np.zeros((frames, 3)), np.zeros(BODY.num_betas), expression, CAMERA.focal[0], CAMERA.center)
    params.rest_expression = np.full(expression.shape[1], 0.05, np.float32)
    poses = Poses(BODY, params)
    for t in range(frames):
        head = poses.vertices(t)[BODY.weights[:, BODY.joint_names.index("head")] > 0.9]
        poses.transl[t] = [0, 0, 2] - (head.min(0) + head.max(0)) / 2
    return poses


def skin_of(waves: float = 300.0) -> Gaussians:
    """Gaussians on the outside of the body, painted with waves, rad/m."""
    skin = Gaussians.area(BODY.v_template, BODY.faces, 20000, density=density_on_head(BODY, np.zeros(BODY.num_betas)))
    skin.rgb = np.float32(0.5 + 0.4 * np.sin(waves * BODY.v_template[BODY.faces[skin.face]].mean(1)))
    return skin


def film(poses: Poses, gaussians: Gaussians, t: int) -> View:
    drawn = render_bound(poses.vertices(t), BODY.faces, gaussians, CAMERA, Workspace())
    return View(CAMERA, np.rint(255 * np.clip(np.dstack([drawn.rgb, drawn.alpha]), 0, 1)).astype(np.uint8), (0, 0))


@pytest.fixture(scope="module")
def filmed():
    """Poses as fitted, a skin, and frames of it: the first with a jaw wider open, a smile and a closed lid; the second as fitted;
    the third, of the back of the head, as the first."""
    poses, skin = stand([FRONT, FRONT, BACK]), skin_of()
    real = poses.copy()
    for t in (0, 2):
        real.expression[t, [JAW, SMILE, BLINK]] = 0.12, 0.2, 0.15
    real.forget_expressions()
    return poses, skin, {t: film(real, skin, t) for t in range(3)}, real


def test_a_face_goes_to_its_image_and_those_that_are_right_or_turned_away_stay(filmed):
    poses, skin, views, real = filmed
    assert find_facing(poses, 0) > 0.9 and find_facing(poses, 2) < -0.9
    found = poses.copy()
    for _ in range(3):
        correct_expressions(found, skin, views)
    told = [JAW, SMILE, BLINK]
    np.testing.assert_allclose(found.expression[0, told], real.expression[0, told], atol=0.05)
    off, before = (np.abs(p.vertices(0) - real.vertices(0)).max() for p in (found, poses))
    assert off < 0.4 * before
    assert np.abs(found.vertices(1) - poses.vertices(1)).max() < 0.1 * before
    assert not found.expression[2].any()
    np.testing.assert_array_equal(found.pose, poses.pose)
    worn = found.params.expression + found.expression
    assert worn.min() >= 0 and worn.max() <= 1


def test_gradient_is_that_of_the_squared_error_and_the_hessian_is_near_its_bend(filmed):
    poses, skin, views, _ = filmed
    actions, at, workspace = Actions(poses, skin.face), poses.copy(), Workspace()
    actions.poses = at
    face = actions.crop(0, views[0])

    def half_error(e):
        at.expression[0, :] = e
        at.forget_expressions()
        found = find_residuals(skin, at, 0, face, workspace)
        return 0.5 * float((found.colour.astype(float)**2).sum() + (found.mask.astype(float)**2).sum()), found

    start = np.zeros(at.expression.shape[1])
    gradient, hessian = actions.equations(0, face, half_error(start)[1])
    for k in (JAW, SMILE, BLINK):
        step = np.eye(len(start))[k] * 0.03
        less, same, more = (half_error(start + f * step)[0] for f in (-1, 0, 1))
        assert gradient[k] == pytest.approx((more - less) / 0.06, rel=0.1)
        assert hessian[k, k] / CURVATURE == pytest.approx((more + less - 2 * same) / 9e-4, rel=0.6)
    np.testing.assert_allclose(hessian, hessian.T, rtol=1e-6, atol=1e-6 * hessian.max())


def test_an_image_of_something_else_makes_no_face_worse(filmed):
    poses, skin, _, _ = filmed
    found, other = poses.copy(), {0: film(poses, skin_of(420.0), 0)}
    actions = Actions(poses, skin.face)
    face = actions.crop(0, other[0])
    before = find_residuals(skin, poses, 0, face, Workspace()).mean
    correct_expressions(found, skin, other)
    assert find_residuals(skin, found, 0, face, Workspace()).mean <= before


def test_the_face_at_rest_moves_as_the_frames_do(filmed):
    poses = filmed[0].copy()
    trained = np.arange(3)
    np.testing.assert_allclose(find_rest(poses, trained), poses.params.rest_expression)
    poses.wear_expression(0, np.eye(poses.expression.shape[1])[JAW] * 0.3)
    np.testing.assert_allclose(find_rest(poses, trained), poses.params.rest_expression, err_msg="one of two frames speaks")
    poses.wear_expression(1, np.eye(poses.expression.shape[1])[JAW] * 0.2)
    moved = find_rest(poses, trained) - poses.params.rest_expression
    assert moved[JAW] == pytest.approx(0.2, abs=1e-6) and not np.delete(moved, JAW).any()
    poses.params.rest_expression = None
    assert find_rest(poses, trained) is None

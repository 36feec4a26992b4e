import numpy as np
import trimesh

from gsac.avatar.body import Body
from gsac.avatar.directions import spread_directions
from gsac.stages.train.gaussians.inner_faces import SIDES, axes_along, find_inner
from gsac.turntable.person import REGIONS


def region(name, body):
    """(F,) bool, faces all of which lies in a region of the skin."""
    regions = np.load(REGIONS)
    return (regions["share"][list(regions["names"]).index(name)] > 127)[body.faces].all(1)


def test_a_ball_within_a_ball_is_inner_and_one_beside_it_is_not():
    ball = trimesh.creation.icosphere(subdivisions=3)
    balls = [ball.vertices, 0.5 * ball.vertices, 0.5 * ball.vertices + [2, 0, 0]]
    faces = np.concatenate([ball.faces + i * len(ball.vertices) for i in range(3)])
    inner = find_inner(np.concatenate(balls), faces).reshape(3, -1)
    assert inner[1].all() and not inner[[0, 2]].any()


def test_of_the_body_the_closed_mouth_and_the_backs_of_the_eyes_are_inner_and_nothing_below_the_neck():
    body = Body.load()
    inner = find_inner(body.v_template, body.faces)
    assert inner[region("mouth", body)].mean() > 0.9
    for outside in ("face", "ears", "nails"):
        assert inner[region(outside, body)].mean() < 0.05
    joints = [body.joint_names.index(f"{side}_eye_smplhf") for side in ("left", "right")]
    eyes = ((body.skin_weight * np.isin(body.skin_index, joints)).sum(1) > 0.9)[body.faces].all(1)
    front = body.v_template[body.faces].mean(1)[:, 2]
    assert 0.1 < inner[eyes].mean() < 0.9 and front[eyes & inner].mean() < front[eyes & ~inner].mean()
    head = body.v_template[body.faces].mean(1)[:, 1] > body.v_template[:, 1].max() - 0.3
    assert inner[~head].mean() < 0.001


def test_cameras_look_along_the_sides():
    for side in spread_directions(SIDES):
        axes = axes_along(side)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) > 0 and np.allclose(axes[2], side)

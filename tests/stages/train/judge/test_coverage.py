"""What no frame shows is named."""

import numpy as np
import pytest

from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.wholebody import INDEX
from gsac.stages.train.fast.initial_gaussians import centres_at_rest
from gsac.stages.train.judge.coverage import part_of, unseen_parts


@pytest.fixture(scope="module")
def covering():
    body = Body.load()
    gaussians = Gaussians.area(body.v_template, body.faces, 6000, 0)
    return body, gaussians.face, centres_at_rest(gaussians, body.v_template, body.faces)


def test_every_joint_but_the_neck_belongs_to_a_part(covering):
    body = covering[0]
    assert [name for name in body.joint_names if part_of(name) is None] == ["neck"]
    assert {part_of(name) for name in body.joint_names} >= {"head", "trunk", "left hand", "right foot"}


def test_a_whole_turn_shows_everything_and_names_nothing(covering):
    body, face, at = covering
    assert unseen_parts(face, np.ones(len(face), bool), body) == []
    soles = at[:, 1] < at[:, 1].min() + 0.01
    assert unseen_parts(face, ~soles, body) == []


def test_a_head_above_the_picture_is_named(covering):
    body, face, at = covering
    chin = body.joint_names.index("neck")
    neck = float((body.J_regressor @ body.v_template)[chin, 1])
    assert unseen_parts(face, at[:, 1] < neck, body) == ["head"]


def test_a_head_of_which_only_the_chin_is_in_the_picture_is_named_as_well(covering):
    body, face, at = covering
    mouth = float(body.keypoints(body.v_template)[INDEX["nose"], 1]) - 0.03
    assert unseen_parts(face, at[:, 1] < mouth, body) == ["head"]


def test_views_from_one_side_name_the_other(covering):
    body, face, _ = covering
    ahead = face_frames(body.v_template, body.faces).R[face, 2, 1]
    assert unseen_parts(face, ahead > -0.2, body) == ["back of the head", "back"]
    assert unseen_parts(face, ahead < 0.2, body) == ["face", "front of the trunk"]


def test_a_hidden_hand_is_named_with_its_side_and_the_other_is_not(covering):
    body, face, at = covering
    wrist = float((body.J_regressor @ body.v_template)[body.joint_names.index("left_wrist"), 0])
    assert unseen_parts(face, at[:, 0] < wrist, body) == ["left hand"]

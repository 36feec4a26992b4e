"""Which faces teach nothing in which frame."""

from types import SimpleNamespace

import numpy as np

from gsac.avatar.body import Body
from gsac.avatar.joints import INDEX, J
from gsac.stages.train.fast.trainer import Trainer
from gsac.stages.train.poses.guessed_limbs import find_guessed_faces


def test_a_guessed_wrist_silences_forearm_and_hand_of_its_side_in_its_frame_and_nothing_else():
    body = Body.load()
    sigma = np.full((3, J), 0.03)
    sigma[1, INDEX["left_wrist"]] = 0.12
    found = find_guessed_faces(body, sigma)
    assert list(found) == [1]
    bone = np.asarray(body.weights)[body.faces].sum(1).argmax(1)
    assert set(bone[found[1]]) == {INDEX["left_elbow"], INDEX["left_wrist"]}
    assert found[1][bone == INDEX["left_wrist"]].all()


def test_poses_that_were_all_seen_silence_nothing():
    assert find_guessed_faces(Body.load(), np.full((3, J), 0.05)) == {}


def test_gaussians_and_skin_of_a_guessed_limb_take_no_gradient_from_that_frame_and_all_others_keep_theirs():
    faces = np.array([[0, 1, 2], [2, 3, 4], [4, 5, 6]])
    trainer = SimpleNamespace(guessed={1: np.array([True, False, False])}, face=np.array([0, 1, 2, 0]), faces=faces)
    grads, skin = {"mu": np.ones((4, 3)), "rgb": np.ones((4, 3))}, np.ones((7, 3))
    Trainer._forget_guessed(trainer, 1, grads, skin)
    for grad in grads.values():
        np.testing.assert_array_equal(grad[:, 0], [0, 1, 1, 0])
    np.testing.assert_array_equal(skin[:, 0], [0, 0, 0, 1, 1, 1, 1])

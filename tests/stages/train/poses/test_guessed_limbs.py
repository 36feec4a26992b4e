"""Which faces teach nothing in which frame."""

import numpy as np

from gsac.avatar.body import Body
from gsac.avatar.joints import INDEX, J
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

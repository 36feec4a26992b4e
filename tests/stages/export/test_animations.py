from typing import get_args

import numpy as np
import pytest

from gsac.avatar.skinning import joint_transforms
from gsac.stages.export.animations import CLIPS
from gsac.stages.export.config import AnimationName, ExportConfig


def poses(figure, name):
    """(K, 55, 3) rotations of a clip and (K, 3) transl."""
    clip = figure.clips[name]
    pose = np.zeros((len(clip.rotation), 55, 3), np.float32)
    pose[:, [figure.joint_names.index(j) for j in clip.joints]] = clip.rotation
    return pose, clip.transl


def joints(figure, name):
    pose, transl = poses(figure, name)
    A = joint_transforms(pose, figure.joints, figure.parents)
    placed = np.einsum("tjab,jb->tja", A[..., :3], figure.joints) + A[..., 3] + transl[:, None]
    return {n: placed[:, j] for j, n in enumerate(figure.joint_names)}


@pytest.mark.parametrize("name", ["wave", "walk"])
def test_the_lower_foot_is_on_the_floor_at_each_key_and_between(figure, name):
    pose, transl = poses(figure, name)
    between = (pose + np.roll(pose, -1, 0)) / 2, (transl + np.roll(transl, -1, 0)) / 2
    for p, t, tolerance in (*((p, t, 1e-5) for p, t in zip(pose, transl, strict=True)),
                            *((p, t, 0.015) for p, t in zip(*between, strict=True))):
        assert abs((figure.posed(p)[:, 1] + t[1]).min() - figure.ground) < tolerance


@pytest.mark.parametrize("name", ["wave", "walk"])
def test_a_clip_closes_without_a_jump(figure, name):
    pose, transl = poses(figure, name)
    step = np.abs(np.diff(pose, axis=0)).max(axis=(1, 2))
    assert np.abs(pose[0] - pose[-1]).max() <= 1.3 * step.max()
    assert np.abs(transl[0] - transl[-1]).max() <= 1.3 * np.abs(np.diff(transl, axis=0)).max() + 1e-4


def test_the_wave_raises_the_right_hand_over_the_shoulder_and_keeps_the_left_down(figure):
    place = joints(figure, "wave")
    assert (place["right_middle3"][:, 1] > place["right_shoulder"][:, 1] + 0.2).all()
    assert (place["left_wrist"][:, 1] < place["left_elbow"][:, 1]).all()
    assert np.ptp(place["right_middle3"][:, 0]) > 0.08, "the hand moves to and fro"


def test_the_wave_bends_the_arm_no_further_than_a_sleeve_seen_stretched_holds(figure):
    clip = figure.clips["wave"]
    turned = {joint: np.linalg.norm(clip.rotation[:, clip.joints.index(joint)], axis=1).max()
              for joint in ("right_shoulder", "right_elbow")}
    assert turned["right_elbow"] < 1.6 and turned["right_shoulder"] < 0.7, "rad; at 2.2 the elbow's skin tears into fur"


def test_the_wave_whose_elbow_is_the_hardest_to_show_comes_last():
    assert ExportConfig().clip_names()[-1] == "wave"


def test_the_walk_steps_with_both_legs_and_swings_the_opposite_arm(figure):
    place = joints(figure, "walk")
    left, right = (place[f"{side}_ankle"][:, 2] - place["pelvis"][:, 2] for side in ("left", "right"))
    assert min(np.ptp(left), np.ptp(right)) > 0.4
    arm = place["left_wrist"][:, 2] - place["left_shoulder"][:, 2]
    assert np.corrcoef(left, right)[0, 1] < -0.5
    assert np.corrcoef(left, arm)[0, 1] < -0.5
    middle = (place["left_hip"][:, 2] + place["left_ankle"][:, 2]) / 2
    assert (place["left_knee"][:, 2] > middle - 0.02).all(), "knees bend forward"


def test_a_pose_lowers_both_arms_alike(figure):
    vertices = figure.posed(figure.pose("A"))
    left, right = (figure.skin_index[:, 0] == figure.joint_names.index(f"{s}_middle2") for s in ("left", "right"))
    assert vertices[left, 0].min() > 0.2 and vertices[right, 0].max() < -0.2
    assert vertices[left, 1].mean() == pytest.approx(vertices[right, 1].mean(), abs=0.02)
    assert vertices[left, 1].mean() < figure.joints[figure.joint_names.index("left_shoulder"), 1] - 0.3


def test_every_animation_that_can_be_named_exists():
    assert tuple(CLIPS) == get_args(AnimationName)

import functools
import operator
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.motion import quat
from gsac.avatar.motion.bvh import read_bvh
from gsac.avatar.motion.names import match, split_side
from gsac.avatar.motion.retarget import retarget
from gsac.avatar.motion.source import Motion, MotionError, Source
from support import dances

FOOTAGE = Path(__file__).parents[3] / ".." / "shared" / "footage" / "motion"


def onto(skeleton, source):
    return retarget(source, skeleton.names, skeleton.parents, skeleton.joints, "it.bvh")


@pytest.mark.parametrize(("unit", "world", "name"), [
    (1, None, str), (100, dances.Z_UP, str), (39.37, Rotation.from_rotvec([0, 2, 0]), dances.mixamo),
    (1, Rotation.from_rotvec([np.pi, 0, 0]), dances.mixamo)])
def test_a_motion_comes_back_from_any_unit_world_and_naming(skeleton, dance, unit, world, name):
    names = [name(n) for n in skeleton.names]
    dances.assert_same(onto(skeleton, dances.read_text(dances.bvh_text(skeleton, dance, names, unit, world=world))), dance)


def strange(source, seed=5):
    """The same motion on bones that each have axes of their own, as FBX rigs have."""
    axes = Rotation.random(len(source.names), random_state=seed).as_quat()
    return Source(source.fps, source.names, source.parents, quat.multiply(source.rest_turns, axes), source.rest_places,
                  quat.multiply(source.turns, axes), source.places)


def test_axes_of_the_bones_do_not_matter(skeleton, dance):
    source = strange(dances.read_text(dances.bvh_text(skeleton, dance, [dances.mixamo(n) for n in skeleton.names])))
    dances.assert_same(onto(skeleton, source), dance)


def test_a_rest_pose_that_is_no_person_is_replaced_by_a_frame(skeleton, dance):
    """All bones of the rest pose along x, as motion capture software writes them; frame 0 is a T-pose."""
    source = strange(dances.read_text(dances.bvh_text(skeleton, dance)))
    folded = Source(source.fps, source.names, source.parents, Rotation.random(55, random_state=1).as_quat(),
                    np.arange(55)[:, None] * np.array([.1, 0, 0]), source.turns, source.places)
    got = onto(skeleton, folded)
    turn = Rotation.from_rotvec(got.rotation.reshape(-1, 3)).inv() * Rotation.from_rotvec(dance.rotation.reshape(-1, 3))
    assert np.degrees(turn.magnitude()).max() < 0.05


def test_an_a_pose_at_rest_is_not_taken_for_a_t_pose(skeleton, dance):
    """Every limb points where the source's does, whatever the file calls rest."""
    source = dances.read_text(dances.bvh_text(skeleton, dance))
    rest = np.zeros((1, 55, 3))
    for side, out in (("left", 1), ("right", -1)):
        rest[0, skeleton.names.index(f"{side}_shoulder"), 2] = -out * 0.8
        rest[0, skeleton.names.index(f"{side}_hip"), 2] = out * 0.15
    lowered = dances.read_text(dances.bvh_text(skeleton, Motion(24, rest, np.zeros((1, 3)))))
    source.rest_turns, source.rest_places = lowered.turns[0], lowered.places[0]
    got = onto(skeleton, source)
    limbs = [(skeleton.names.index(f"{s}_{a}"), skeleton.names.index(f"{s}_{b}")) for s in ("left", "right")
             for a, b in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))]
    ours, theirs = skeleton.posed(got.rotation, got.transl), skeleton.posed(dance.rotation, dance.transl)
    for a, b in limbs:
        assert angle(ours[:, b] - ours[:, a], theirs[:, b] - theirs[:, a]).max() < 0.1


def angle(a, b):
    """Degrees between rows."""
    cosine = (a * b).sum(-1) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def test_fewer_and_more_spine_joints_bend_the_back_as_much(skeleton, dance):
    """A spine of one joint: the chest turns as the source's, the joints between share it."""
    source = dances.read_text(dances.bvh_text(skeleton, dance))
    keep = [i for i, n in enumerate(source.names) if n not in ("spine1", "spine2")]
    parents = source.parents.copy()
    parents[source.names.index("spine3")] = 0
    parents = np.array([-1 if parents[i] < 0 else keep.index(parents[i]) for i in keep])
    fewer = Source(source.fps, [source.names[i] for i in keep], parents, source.rest_turns[keep], source.rest_places[keep],
                   source.turns[:, keep], source.places[:, keep])
    got = onto(skeleton, fewer)
    line = [skeleton.names.index(n) for n in ("pelvis", "spine1", "spine2", "spine3")]
    chest = [functools.reduce(operator.mul, (Rotation.from_rotvec(m.rotation[:, j]) for j in line)) for m in (got, dance)]
    assert np.degrees((chest[0].inv() * chest[1]).magnitude()).max() < 0.05
    share = np.linalg.norm(got.rotation[:, line[1:]], axis=-1)
    assert share[6].min() > 0.2 * share[6].max()


def test_the_first_frame_faces_us_on_the_floor_at_the_origin(skeleton, dance):
    away = Rotation.from_rotvec([0, 2.5, 0])
    moved = dances.read_text(dances.bvh_text(skeleton, dance, world=away))
    moved.places = moved.places + (7, 1.5, -3)
    got = onto(skeleton, moved)
    np.testing.assert_allclose(got.transl[0, [0, 2]], 0, atol=1e-6)
    dances.assert_same(got, dance)


def test_longer_legs_take_longer_steps(skeleton, dance):
    source = dances.read_text(dances.bvh_text(skeleton, dance))
    giant = dances.Skeleton(skeleton.names, skeleton.parents, skeleton.joints * 1.25)
    got = onto(giant, source)
    np.testing.assert_allclose(got.transl[:, [0, 2]], dance.transl[:, [0, 2]] * 1.25, atol=1e-4)


def test_a_skeleton_that_is_no_person_names_what_is_missing(skeleton, dance):
    source = dances.read_text(dances.bvh_text(skeleton, dance, [n.replace("left_elbow", "tentacle") for n in skeleton.names]))
    with pytest.raises(MotionError, match=r"it\.bvh: no joint for left_elbow .*tentacle"):
        onto(skeleton, source)


@pytest.mark.parametrize(("names", "expected"), [
    ("LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftShoulder LeftArm LeftForeArm LeftHand",
     "hip knee ankle foot collar shoulder elbow wrist"),
    ("LeftHip LeftKnee LeftAnkle LeftToe LeftCollar LeftShoulder LeftElbow LeftWrist",
     "hip knee ankle foot collar shoulder elbow wrist"),
    ("thigh_l calf_l foot_l ball_l clavicle_l upperarm_l lowerarm_l hand_l", "hip knee ankle foot collar shoulder elbow wrist"),
    ("DEF-thigh.L DEF-shin.L DEF-foot.L DEF-toe.L DEF-shoulder.L DEF-upper_arm.L DEF-forearm.L DEF-hand.L",
     "hip knee ankle foot collar shoulder elbow wrist"),
    ("J_Bip_L_UpperLeg J_Bip_L_LowerLeg J_Bip_L_Foot J_Bip_L_ToeBase J_Bip_L_Shoulder J_Bip_L_UpperArm "
     "J_Bip_L_LowerArm J_Bip_L_Hand",
     "hip knee ankle foot collar shoulder elbow wrist"),
    ("left_hip left_knee left_ankle left_foot left_collar left_shoulder left_elbow left_wrist",
     "hip knee ankle foot collar shoulder elbow wrist"),
    ("lThighBend lShin lFoot lToe lCollar lShldrBend lForearmBend lHand", "hip knee ankle foot collar shoulder elbow wrist"),
    ("Bip01|Bip01 L Thigh;Bip01 L Calf;Bip01 L Foot;Bip01 L Toe0;Bip01 L Clavicle;Bip01 L UpperArm;Bip01 L Forearm;Bip01 L Hand",
     "hip knee ankle - collar shoulder elbow wrist"),
    ("LeftHandIndex1 leftIndexIntermediate index_03_l f_pinky.02.L left_thumb3 leftThumbProximal",
     "index1 index2 index3 pinky2 thumb3 thumb1")])
def test_names_of_the_tools_are_known(names, expected):
    names = names.split(";") if ";" in names else names.split()
    found = match(names)
    assert {i: j for j, i in found.items()} == {i: f"left_{e}" for i, e in enumerate(expected.split()) if e != "-"}


def test_a_name_without_a_side_is_no_limb():
    assert split_side("mixamorig:LeftUpLeg") == ("left_", "upleg")
    assert match(["Thigh", "Foot", "Head"]) == {"head": 2}


def test_a_number_in_a_joints_name_may_be_of_any_length():
    assert split_side("Spine02") == ("", "spine2") and split_side("spine_00") == ("", "spine0")
    assert split_side("spine" + "0" * 3 + "7" * 5000) == ("", "spine" + "7" * 5000)


@pytest.mark.footage
@pytest.mark.parametrize("name", ["dab", "jesse_dance", "jumping_jacks", "wave_hello"])
def test_recorded_motions_point_every_limb_where_the_dancer_does(skeleton, name):
    """z up and y up, rest in T, with legs apart, and with all bones along x."""
    path = FOOTAGE / f"{name}.bvh"
    if not path.is_file():
        pytest.skip("the recorded motions are not here")
    source = read_bvh(path)
    got, found = onto(skeleton, source), match(source.names)
    ours = skeleton.posed(got.rotation, got.transl)
    bones = [(f"{s}_{a}", f"{s}_{b}") for s in ("left", "right")
             for a, b in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))]
    a, b = ([skeleton.names.index(bone[k]) for bone in bones] for k in (0, 1))
    mine = ours[:, b] - ours[:, a]
    theirs = source.places[:, [found[y] for _, y in bones]] - source.places[:, [found[x] for x, _ in bones]]
    upright, _ = Rotation.align_vectors(mine[0], theirs[0])
    assert angle(mine, upright.apply(theirs.reshape(-1, 3)).reshape(theirs.shape)).max() < 1.0
    feet = [skeleton.names.index(f"{s}_{j}") for s in ("left", "right") for j in ("ankle", "foot")]
    height = (ours[:, feet, 1] - skeleton.joints[feet, 1]).min(1)
    assert -0.25 < height.min() < 0.01 and abs(np.percentile(height, 2)) < 0.02

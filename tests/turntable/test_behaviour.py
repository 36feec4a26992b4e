"""What people do and wear in truth clips: behaviour is reached, nothing passes through the body, truth follows."""

import dataclasses
from typing import get_args

import cv2
import numpy as np
import pytest
from scipy.spatial import KDTree

from gsac.avatar.artifacts import read_arrays
from gsac.avatar.joints import INDEX
from gsac.avatar.mesh import vertex_normals
from gsac.avatar.skinning import joint_transforms
from gsac.turntable import clip
from gsac.turntable.appearance import make_appearance
from gsac.turntable.behaviour import POCKET, REACHES, behave, share_of_way
from gsac.turntable.motion import make_motion
from gsac.turntable.options import Behaviour, TurntableOptions
from gsac.turntable.person import MATERIALS, make_person
from gsac.turntable.reach import Arm, Solid

STILL = TurntableOptions(seed=101, frames=20, height=160, supersample=1, arm_swing=0.0)


@pytest.fixture(scope="module")
def person():
    return make_person(STILL, np.random.default_rng([STILL.seed, 1]))


def moved(person, **changes):
    options = dataclasses.replace(STILL, **changes)
    motion = make_motion(person.body, person.joints, options, np.random.default_rng([options.seed, 2]))
    behave(motion, person, options, np.random.default_rng([options.seed, 6]))
    return motion, share_of_way(options)


def depths(person, motion, side, under):
    """(T / 2,) m, the deepest point of an arm in every other frame."""
    out, arm = [], Arm(person, side)
    for pose in motion.pose[::2]:
        still = pose.copy()
        still[0] = 0
        transforms = joint_transforms(still[None], person.joints, person.body.parents)[0]
        out.append(Solid.around(person, still, side, under).depth(arm.place(transforms)).max())
    return np.array(out)


def joints_of(person, pose):
    a = joint_transforms(pose[None], person.joints, person.body.parents)[0]
    return np.einsum("jab,jb->ja", a[..., :3], person.joints) + a[..., 3]


@pytest.mark.parametrize("what", ["left_pocket", "right_hip", "left_hair", "crossed", "right_phone", "talking"])
def test_an_arm_that_does_something_lies_on_the_body_and_never_in_it(person, what):
    motion, _ = moved(person, behaviour=what)
    for side, goal in dict(REACHES[what]).items():
        deep = depths(person, motion, side, goal.under)
        assert deep.max() < 0.025, (side, deep.round(3))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 102, 103])
@pytest.mark.parametrize("what", REACHES)
def test_arms_stay_out_of_other_bodies_and_clothes(seed, what):
    dressed = make_person(dataclasses.replace(STILL, seed=seed), np.random.default_rng([seed, 1]))
    motion, _ = moved(dressed, behaviour=what, seed=seed)
    for side, goal in dict(REACHES[what]).items():
        deep = depths(dressed, motion, side, goal.under)
        assert deep.max() < 0.03, (side, deep.round(3))


def test_half_the_amount_goes_half_the_way_and_none_leaves_the_motion_alone(person):
    rest, none, half, whole = (moved(person, **changes)[0].pose[10] for changes in (
        {}, {"behaviour": "right_hip", "behaviour_amount": 0.0}, {"behaviour": "right_hip", "behaviour_amount": 0.5},
        {"behaviour": "right_hip"}))
    np.testing.assert_allclose(none, rest)
    wrist = INDEX["right_wrist"]
    gone = [np.linalg.norm(joints_of(person, p)[wrist] - joints_of(person, rest)[wrist]) for p in (half, whole)]
    assert gone[0] > 0.02 and gone[1] > 0.1


def test_the_head_bows_and_the_mouth_talks_only_where_it_is_told(person):
    rest, down, talk = (moved(person, **changes)[0] for changes in ({}, {"behaviour": "looking_down"}, {"behaviour": "talking"}))
    head = INDEX["head"]
    np.testing.assert_array_equal(down.pose[0], rest.pose[0])
    assert np.degrees(down.pose[10, head, 0] - rest.pose[10, head, 0]) == pytest.approx(24)
    jaw = list(person.body.expression_names).index("jawOpen")
    assert talk.expression[5:16, jaw].std() > 2 * rest.expression[5:16, jaw].std()


def test_a_hand_in_a_pocket_is_under_the_cloth_and_counts_as_hidden(tmp_path):
    options = dataclasses.replace(STILL, frames=4, height=240, behaviour="left_pocket", behaviour_from=0.5, behaviour_to=0.6)
    clip.make_clip(tmp_path, options)
    truth = read_arrays(tmp_path / "truth.npz")
    joints, points = slice(INDEX["left_index1"], INDEX["left_middle1"]), slice(95, 100)
    assert truth["joints_visible"].shape == (4, 55)
    assert truth["joints_visible"][0, joints].mean() > 0.9 and truth["keypoints_visible"][0, points].mean() > 0.7
    assert truth["joints_visible"][2, joints].mean() < 0.2 and truth["keypoints_visible"][2, points].mean() < 0.2
    assert POCKET.under


def test_joints_are_seen_but_for_those_behind_the_body(tmp_path):
    clip.make_clip(tmp_path, dataclasses.replace(STILL, frames=4, height=240))
    seen = read_arrays(tmp_path / "truth.npz")["joints_visible"]
    assert seen[0, :22].mean() > 0.9  # from the front
    far = [INDEX[f"{side}_{joint}"] for side in ("left", "right") for joint in ("elbow", "wrist")]
    assert not seen[[1, 3]][:, far].all(1).any()  # from a side the body hides one arm


LOOKS = {"top": ("hoodie", "shirt"), "legs": ("skirt", "skirt"), "hair": ("long", "hair"), "glasses": (True, "glasses"),
         "hat": ("cap", "hat"), "behaviour": ("left_phone", "phone")}


@pytest.mark.parametrize("look", LOOKS)
def test_what_is_worn_or_held_is_drawn_outside_the_body_and_moves_with_it(person, look):
    value, material = LOOKS[look]
    dressed = make_person(dataclasses.replace(STILL, **{look: value}), np.random.default_rng([STILL.seed, 1]))
    np.testing.assert_array_equal(dressed.rest[:len(person.body.v_template)], person.rest[:len(person.body.v_template)])

    def surface(of):
        points = of.rest[of.pair[:, 0]] + (of.rest[of.pair[:, 1]] - of.rest[of.pair[:, 0]]) * of.share[:, None]
        return points[np.unique(of.faces[of.material == MATERIALS.index(material)])]

    worn = surface(dressed)
    assert len(worn) > len(surface(person)) or look == "top"
    bare = dressed.rest[:len(person.body.v_template)]
    assert KDTree(bare).query(worn)[0].max() < 0.25
    skin = Solid(bare, vertex_normals(bare, person.body.faces))
    assert np.percentile(skin.depth(worn), 98) < 0.015
    assert np.isfinite(dressed.skin_weight).all()
    np.testing.assert_allclose(dressed.skin_weight.sum(1), 1, atol=2e-3)


def test_an_oversized_hoodie_widens_the_figure_and_a_skirt_closes_the_legs(tmp_path):
    def legs_and_trunk(**changes):
        options = dataclasses.replace(STILL, frames=1, height=240, drawn=True, **changes)
        clip.make_clip(tmp_path, options)
        truth = read_arrays(tmp_path / "truth.npz")
        assert truth["drawn"].shape[:1] == (1,) and truth["drawn_faces"].max() < truth["drawn"].shape[1]
        mask = cv2.imread(str(tmp_path / "mask" / "000000.png"), cv2.IMREAD_GRAYSCALE) > 127
        at = truth["joints"][0, :, :2] / truth["joints"][0, :, 2:] * truth["focal"] + truth["center"]
        middle = int(at[INDEX["pelvis"], 0])
        knees = int(0.65 * at[INDEX["left_knee"], 1] + 0.35 * at[INDEX["left_hip"], 1])
        return mask[knees, middle - 3:middle + 4].mean(), mask.sum()

    plain, skirt, hoodie = legs_and_trunk(), legs_and_trunk(legs="skirt"), legs_and_trunk(top="hoodie")
    assert plain[0] < 0.5 and skirt[0] == 1 and hoodie[1] > 1.05 * plain[1]


def test_behaviours_are_turns_without_another_hidden_hand():
    assert set(REACHES) | {"none", "looking_down"} == set(get_args(Behaviour))
    for change in ({"poses": "novel"}, {"hidden_hand": "left_back"}, {"behaviour_amount": 2.0},
                   {"behaviour_from": 0.9, "behaviour_to": 0.1}):
        with pytest.raises(ValueError, match="behaviour"):
            dataclasses.replace(STILL, behaviour="hips", **change).check()


def test_without_behaviour_and_looks_a_seed_is_the_person_that_it_was(person):
    """Sums noted when behaviours and looks came; measurements on clips of known seeds rest on them."""
    options = TurntableOptions(seed=101)
    motion = make_motion(person.body, person.joints, options, np.random.default_rng([101, 2]))
    looks = make_appearance(person, np.random.default_rng([101, 4]))
    assert person.rest.shape == (19877, 3) and person.faces.shape == (29585, 3) and looks.pattern == "print"
    found = [np.abs(person.rest.astype(float)).sum(), person.share.sum(), np.abs(motion.pose).sum(), motion.expression.sum()]
    np.testing.assert_allclose(found, [21154.96, 333.8157, 822.96017, 154.49934], rtol=1e-5)
    np.testing.assert_allclose(looks.trousers, [0.042165, 0.041439, 0.040782], atol=1e-5)
    before = motion.pose.copy()
    behave(motion, person, options, np.random.default_rng([101, 6]))
    np.testing.assert_array_equal(motion.pose, before)

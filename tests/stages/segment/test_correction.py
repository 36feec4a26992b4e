"""The outline's correction at full size by the plate, on painted pictures whose truth is known."""

import cv2
import numpy as np
import pytest

from gsac.avatar.frame_files import write_frame
from gsac.stages.segment.bones import distance_to_bones
from gsac.stages.segment.correction import correct, find_lost, match_scene
from gsac.stages.segment.plate import Plate
from gsac.stages.segment.plate_from_video import relearn_plate

SIZE = HEIGHT, WIDTH = 240, 160
PERSON = 60, 40, 130
NO_BONES = np.full(SIZE, np.inf), np.ones(SIZE, bool)


def wall():
    """(H, W, 3) float: a textured wall."""
    texture = cv2.GaussianBlur(np.random.default_rng(0).normal(0, 30, SIZE).astype(np.float32), (0, 0), 3)[..., None]
    return np.array((150, 150, 140)) + texture


def comb():
    """(H, W) bool: a trunk with slits 4 to 6 px wide."""
    person = np.zeros(SIZE, bool)
    person[40:200, 40:120] = True
    for column, width in ((56, 4), (74, 5), (94, 6)):
        person[40:120, column: column + width] = False
    return person


def painted(person, background, seed=1):
    mix = np.where(person[..., None], PERSON, background) + np.random.default_rng(seed).normal(0, 2, (*SIZE, 3))
    return np.clip(mix, 0, 255).astype(np.uint8)


def plate_of(background):
    return Plate(painted(np.zeros(SIZE, bool), background, seed=5), np.ones(SIZE, bool))


def test_narrow_gaps_that_show_the_scene_are_opened_and_the_rest_stays():
    truth, background = comb(), wall()
    filled = cv2.morphologyEx(truth.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8)) > 0
    image = painted(truth, background)
    scene = match_scene(image, filled, plate_of(background))
    outline = correct(image, filled, scene, *NO_BONES)
    assert outline[filled & ~truth].mean() < 0.45 and outline[truth].mean() > 0.99  # the blur against noise leaves the slits' rims


def test_a_rim_that_was_lost_comes_back_and_a_shadow_beside_it_does_not():
    truth = np.zeros(SIZE, bool)
    truth[40:200, 40:120] = True
    shade = np.ones(SIZE)
    shade[:, 120:] = cv2.GaussianBlur(np.full((HEIGHT, 40), 0.7), (0, 0), 2)
    image = painted(truth, wall() * shade[..., None])
    lost = cv2.erode(truth.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    scene = match_scene(image, lost, plate_of(wall()))
    outline = correct(image, lost, scene, *NO_BONES)
    assert (truth & ~outline).sum() < 0.1 * (truth & ~lost).sum()
    assert (outline & ~truth).sum() < 0.002 * truth.sum()


def test_clothes_that_look_like_the_scene_are_not_opened():
    truth = np.zeros(SIZE, bool)
    truth[40:200, 40:120] = True
    background = wall()
    image = painted(truth, background)
    plate = plate_of(background)
    image[80:160, 60:100] = plate.image[80:160, 60:100]
    assert correct(image, truth, match_scene(image, truth, plate), *NO_BONES)[80:160, 60:100].all()


def leg():
    """xy (133, 2) px, score (133,): knee and ankle of a leg down the middle."""
    xy, score = np.zeros((133, 2), np.float32), np.zeros(133, np.float32)
    xy[[13, 15]], score[[13, 15]] = [(80, 60), (80, 190)], 0.9
    return xy, score


def camouflaged():
    """A leg with a small part like the scene on its bone and one beside that, and a slit far from it: image, outline, plate."""
    outline = np.zeros(SIZE, bool)
    outline[40:200, 40:120] = True
    image, plate = painted(outline, wall()), plate_of(wall())
    for part in (ON_BONE, BESIDE, SLIT):
        image[part] = plate.image[part]
    return image, outline, plate


ON_BONE, BESIDE, SLIT = np.s_[100:110, 74:90], np.s_[100:110, 93:98], np.s_[100:112, 111:117]


def middle(outline, part):
    """The outline in a part without its rim, which the blur against noise leaves alone."""
    return outline[part][1:-1, 1:-1]


def test_clothes_on_a_bone_that_look_like_the_scene_stay_with_what_lies_beside_and_a_slit_apart_from_it_opens():
    image, outline, plate = camouflaged()
    scene, likely = match_scene(image, outline, plate), np.ones(SIZE, bool)
    kept = correct(image, outline, scene, distance_to_bones(SIZE, *leg()), likely)
    assert kept[ON_BONE].all() and kept[BESIDE].all() and not middle(kept, SLIT).any()


@pytest.mark.parametrize("bones", [True, False])
def test_without_a_bone_or_where_the_network_doubts_what_looks_like_the_scene_opens(bones):
    image, outline, plate = camouflaged()
    xy, score = leg()
    at = distance_to_bones(SIZE, xy, score * bones)
    kept = correct(image, outline, match_scene(image, outline, plate), at, np.full(SIZE, not bones))
    assert np.isinf(at).all() != bones
    assert not any(middle(kept, part).any() for part in (ON_BONE, BESIDE, SLIT))


def test_lost_is_what_lies_beside_a_bone_and_is_likely_the_persons_not_a_stranger_who_stands_apart():
    xy, score = np.zeros((133, 2)), np.zeros(133)
    xy[[13, 15]], score[[13, 15]] = [(60, 100), (60, 180)], 1.0  # a shin
    bones = distance_to_bones((200, 200), xy, score)
    outline, probability = np.zeros((200, 200), bool), np.zeros((200, 200), np.uint8)
    probability[90:190, 50:71] = probability[90:190, 140:171] = 255
    outline[90:130, 50:71] = True
    probability[150:160, 50:71] = 100
    lost = find_lost(outline, probability, bones)
    assert lost[130:150, 50:71].all() and lost[160:185, 52:69].all()
    assert not lost[:130].any() and not lost[150:160].any() and not lost[:, 140:].any()
    assert not find_lost(outline, probability, distance_to_bones((200, 200), xy, 0 * score)).any()


def test_a_strangers_wrist_beside_a_bone_is_not_lost_but_a_foot_on_its_bone_is_though_neither_touches_the_outline():
    xy, score = np.zeros((133, 2)), np.zeros(133)
    xy[[13, 15]], score[[13, 15]] = [(60, 100), (60, 180)], 1.0  # a shin
    outline, probability = np.zeros((200, 200), bool), np.zeros((200, 200), np.uint8)
    outline[90:130, 50:71] = True
    probability[165:185, 55:66] = probability[100:125, 75:85] = 255
    lost = find_lost(outline, probability, distance_to_bones((200, 200), xy, score))
    assert lost[165:185, 55:66].all() and np.count_nonzero(lost) == 20 * 11


def test_a_plate_is_fitted_to_the_exposure_and_one_of_another_place_is_refused():
    truth = comb()
    image = painted(truth, wall())
    scene = match_scene(image, truth, plate_of(wall() * (1.2, 1.1, 0.9)))
    outside = ~cv2.dilate(truth.astype(np.uint8), np.ones((9, 9), np.uint8)).astype(bool)
    assert np.abs(scene.image[outside].astype(int) - image[outside]).mean() < 5
    other = np.random.default_rng(9).integers(0, 255, (12, 8, 3)).astype(np.float64)
    assert match_scene(image, truth, plate_of(cv2.resize(other, (WIDTH, HEIGHT)))) is None


def test_what_the_plate_never_showed_is_left_alone():
    truth, background = comb(), wall()
    filled = cv2.morphologyEx(truth.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8)) > 0
    image, plate = painted(truth, background), plate_of(background)
    plate.known[:130] = False
    assert (correct(image, filled, match_scene(image, filled, plate), *NO_BONES)[:130] == filled[:130]).all()


@pytest.mark.parametrize(("step", "known"), [(20, True), (0, False)])
def test_a_plate_from_outlines_knows_the_scene_up_to_the_person(tmp_path, step, known):
    shapes = [np.roll(comb(), step * t, axis=1) for t in range(-4, 4)]
    paths = [tmp_path / f"{t:06d}.png" for t in range(8)]
    for t, (path, shape) in enumerate(zip(paths, shapes, strict=True)):
        write_frame(path, painted(shape, wall(), seed=t))
    plate = relearn_plate(paths, np.ones(8, bool), lambda t, image: shapes[t])
    assert (plate.known[42:118, 85:88].all()) == known
    assert np.abs(plate.image.astype(int) - wall())[plate.known].mean() < 3
    assert relearn_plate(paths, np.arange(8) < 3, lambda t, image: shapes[t]) is None

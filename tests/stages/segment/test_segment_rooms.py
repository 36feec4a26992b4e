"""The steps of segment on painted pictures whose truth is known."""

from typing import get_args

import cv2
import numpy as np
import pytest

from gsac.avatar.region import Region, crop
from gsac.avatar.wholebody import LEFT_HAND
from gsac.stages.contract import BadInput, make_config
from gsac.stages.segment import STAGE
from gsac.stages.segment.components import keep_person
from gsac.stages.segment.config import MODELS, Method
from gsac.stages.segment.grabcut import cut_out
from gsac.stages.segment.network import onto_frame, person_region
from gsac.stages.segment.plate import Plate, compare
from gsac.stages.segment.plate_from_video import masked_median
from gsac.stages.segment.stage import METHODS, around, cut_frame, finish

HEIGHT, WIDTH = 480, 320
NO_POINTS = np.zeros((133, 2)), np.zeros(133)


def iou(a, b):
    return (a & b).sum() / (a | b).sum()


def scene(seed=0, base=(150, 150, 140), spread=12):
    """(H, W, 3) float: a textured wall, darker to one side."""
    rng = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(rng.normal(0, spread * 3, (HEIGHT, WIDTH, 1)).astype(np.float32), (0, 0), 3)[..., None]
    return np.array(base) + texture + np.linspace(-15, 15, WIDTH)[None, :, None]


def figure():
    """(H, W) 0..1, anti-aliased: trunk, head, a spread arm."""
    big = np.zeros((HEIGHT * 8, WIDTH * 8), np.uint8)
    cv2.ellipse(big, (160 * 8, 280 * 8), (52 * 8, 140 * 8), 0, 0, 360, 255, -1)
    cv2.circle(big, (160 * 8, 104 * 8), 34 * 8, 255, -1)
    cv2.line(big, (160 * 8, 200 * 8), (280 * 8, 300 * 8), 255, 20 * 8)
    return cv2.resize(big, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA).astype(np.float64) / 255


def painted(alpha, background, person=(40, 60, 130), noise=2.0, seed=1):
    """The person over the background, with sensor noise."""
    rng = np.random.default_rng(seed)
    mix = alpha[..., None] * np.array(person) + (1 - alpha[..., None]) * background
    return np.clip(mix + rng.normal(0, noise, mix.shape), 0, 255).astype(np.uint8)


def empty_scene(background, seed=5):
    """The plate of a background, with its own noise."""
    return Plate(painted(np.zeros((HEIGHT, WIDTH)), background, seed=seed), np.ones((HEIGHT, WIDTH), bool))


def mask_frame(image, probability, points, plate):
    """Alpha (H, W) of a frame by itself, and whether the plate, if any, fits it. points: xy (133, 2) px, score (133,)."""
    cutout, fits = cut_frame(image, probability, *points, plate, 1)
    return finish(image, cutout, plate), fits


def rough(alpha, sigma=8.0):
    """What a network would say: the figure at low resolution."""
    return cv2.GaussianBlur(alpha.astype(np.float32), (0, 0), sigma)


@pytest.fixture
def points():
    xy, score = np.zeros((133, 2)), np.zeros(133)
    xy[:4] = (160, 104), (160, 240), (160, 360), (220, 250)
    score[:4] = 0.9
    return xy, score


def test_grabcut_finds_the_outline_that_the_network_blurs():
    truth = figure()
    said = np.roll(rough(truth), 3, axis=1)
    outline = cut_out(painted(truth, scene()), said, *NO_POINTS, iterations=1)
    assert iou(outline > 0.5, truth > 0.5) > max(0.97, iou(said > 0.5, truth > 0.5) + 0.01)


def test_the_same_frame_gives_the_same_outline():
    image, said = painted(figure(), scene()), rough(figure())
    first = cut_out(image, said, *NO_POINTS, iterations=2)
    cv2.setRNGSeed(99)
    assert np.array_equal(first, cut_out(image, said, *NO_POINTS, iterations=2))


def test_fingers_that_the_network_lost_come_back_from_the_hands_points():
    truth = figure()
    hand = np.zeros((21, 2))
    hand[0] = 280, 300
    for finger, angle in enumerate(np.linspace(-0.5, 0.9, 5)):
        for joint in range(4):
            hand[1 + 4 * finger + joint] = hand[0] + (18 + 8 * joint) * np.array([np.sin(angle), np.cos(angle)])
    fingers = np.zeros((HEIGHT, WIDTH), np.uint8)
    for finger in range(5):
        cv2.polylines(fingers, [hand[[0, *range(1 + 4 * finger, 5 + 4 * finger)]].astype(np.int32)], False, 1, 4)
    whole = np.maximum(truth, fingers)
    xy, score = np.zeros((133, 2)), np.zeros(133)
    xy[LEFT_HAND], score[LEFT_HAND] = hand, 0.9
    image = painted(whole, scene())
    lost = (fingers > 0) & (truth < 0.5)
    assert (cut_out(image, rough(truth), xy, score, 1) > 0.5)[lost].mean() > 0.8
    assert (cut_out(image, rough(truth), *NO_POINTS, 1) > 0.5)[lost].mean() < 0.5


def test_islands_without_points_are_dropped_and_parts_with_points_kept(points):
    outline = (figure() > 0.5).astype(np.float32)
    outline[20:60, 20:80] = 1
    outline[400:450, 260:300] = 1
    xy, score = points
    xy[9], score[9] = (280, 420), 0.9
    kept = keep_person(outline, xy, score)
    assert not kept[10:70, 10:90].any() and kept[410:440, 270:290].all() and kept[240, 160] == 1


def test_without_any_point_on_the_mask_the_largest_part_is_kept():
    outline = (figure() > 0.5).astype(np.float32)
    outline[20:60, 20:80] = 1
    kept = keep_person(outline, *NO_POINTS)
    assert kept[240, 160] == 1 and not kept[20:60, 20:80].any()


def test_a_plate_brings_back_what_the_network_missed_and_clears_what_it_filled(points):
    truth = figure()
    hole = np.zeros_like(truth)
    hole[260:320, 140:156] = 1  # bare scene that the network calls person
    truth = truth * (1 - hole)
    background = scene()
    image, plate = painted(truth, background), empty_scene(background)
    said = rough(figure())
    said[:, 230:] *= 0.4  # half of the arm is doubted
    with_plate, fits = mask_frame(image, said, points, plate)
    without, _ = mask_frame(image, said, points, None)
    assert fits and iou(with_plate > 0.5, truth > 0.5) > 0.97 > iou(without > 0.5, truth > 0.5)


def test_a_soft_shadow_on_the_scene_is_not_person(points):
    truth = figure()
    background = scene()
    shadow = np.zeros((HEIGHT, WIDTH), np.float32)
    cv2.ellipse(shadow, (160, 424), (120, 28), 0, 0, 360, 0.3, -1)
    shaded = background * (1 - cv2.GaussianBlur(shadow, (0, 0), 10))[..., None]
    image, plate = painted(truth, shaded), empty_scene(background)
    alpha, fits = mask_frame(image, rough(truth), points, plate)
    assert fits and (alpha > 0.5)[(truth == 0)].mean() < 0.004
    assert iou(alpha > 0.5, truth > 0.5) > 0.97


def test_another_exposure_of_the_plate_is_brought_into_line():
    truth, background = figure(), scene()
    plate = empty_scene(background * [1.2, 1.1, 0.9])
    difference = compare(painted(truth, background), plate.half, rough(truth))
    assert difference.gain == pytest.approx([1 / 1.2, 1 / 1.1, 1 / 0.9], abs=0.02)
    assert difference.empty[10:60, 10:40].mean() > 0.9 and difference.changed[120:160, 70:90].all()


def test_clothes_that_look_like_the_scene_are_not_cut_open(points):
    truth, background = figure(), scene(spread=0)
    plate = empty_scene(background)
    image = painted(truth, background)
    patch = np.zeros((HEIGHT, WIDTH), bool)
    patch[200:360, 124:196] = True
    image[patch] = plate.image[patch]
    alpha, _ = mask_frame(image, rough(truth), points, plate)
    assert (alpha > 0.5)[patch].mean() > 0.95


def test_a_plate_of_another_place_is_not_used(points):
    truth = figure()
    plate = empty_scene(scene(seed=9, base=(60, 160, 60), spread=40))
    image = painted(truth, scene())
    alpha, fits = mask_frame(image, rough(truth), points, plate)
    assert not fits and np.array_equal(alpha, mask_frame(image, rough(truth), points, None)[0])


def test_where_the_plate_was_never_seen_it_says_nothing(points):
    truth, background = figure(), scene()
    plate = empty_scene(background)
    plate.known[:, 100:260] = False
    plate.image[:, 100:260] = 0
    difference = compare(painted(truth, background), plate.half, rough(truth))
    assert not difference.empty[:, 50:130].any() and not difference.changed[:, 50:130].any()
    alpha, fits = mask_frame(painted(truth, background), rough(truth), points, plate)
    assert fits and iou(alpha > 0.5, truth > 0.5) > 0.97


def test_a_still_video_teaches_its_own_plate():
    background = scene()
    moves = [np.roll(figure(), shift, axis=1) for shift in (-80, -40, 0, 40, 80, 0, 40)]
    images = np.stack([painted(m, background, seed=i) for i, m in enumerate(moves)])
    plate = masked_median(images, np.stack([m == 0 for m in moves]))
    empty = painted(0 * figure(), background, noise=0).astype(int)
    assert np.abs(plate.image[plate.known].astype(int) - empty[plate.known]).mean() < 2
    assert plate.known.mean() > 0.9 and not plate.known.all()
    assert not plate.known[sum(m == 0 for m in moves) < 3].any()


def test_a_moving_camera_teaches_no_plate_that_is_used(points):
    tiles = np.random.default_rng(4).integers(40, 220, (12, 16, 3)).astype(np.float64)
    wide = cv2.resize(tiles, (2 * WIDTH, HEIGHT), interpolation=cv2.INTER_NEAREST)
    images = np.stack([painted(figure(), wide[:, s: s + WIDTH], seed=s) for s in range(0, 80, 10)])
    plate = masked_median(images, np.repeat(figure()[None] == 0, 8, axis=0))
    for image in images[::3]:
        assert not mask_frame(image, rough(figure()), points, plate)[1]


@pytest.mark.parametrize("size", [(HEIGHT, WIDTH), (HEIGHT - 1, WIDTH - 1)])
def test_odd_sizes_pass(points, size):
    truth = figure()
    cut = np.s_[: size[0], : size[1]]
    image, plate = painted(truth, scene())[cut], empty_scene(scene()).part((0, 0, size[1], size[0]))
    alpha, _ = mask_frame(image, rough(truth)[cut], points, plate)
    assert alpha.shape == size and iou(alpha > 0.5, truth[cut] > 0.5) > 0.97


def test_no_probability_anywhere_gives_an_empty_mask(points):
    alpha, _ = mask_frame(painted(figure(), scene()), np.zeros((HEIGHT, WIDTH), np.float32), points, None)
    assert alpha.shape == (HEIGHT, WIDTH) and not alpha.any()


def test_a_mask_comes_back_where_its_crop_was_taken():
    picture = (figure()[..., None] * np.ones(3) * 255).astype(np.uint8)
    for region in (Region((160.0, 240.0), 400.0), Region((140.0, 220.0), 300.0, 0.3)):
        back = onto_frame(crop(picture, region, 256)[..., 0], region, HEIGHT, WIDTH)
        inside = onto_frame(np.ones((256, 256), np.float32), region, HEIGHT, WIDTH) > 0.99
        assert np.abs(back - figure())[inside].mean() < 0.01


def test_a_region_needs_three_points(points):
    xy, score = points
    assert person_region(xy, np.zeros(133)) is None
    region = person_region(xy, score)
    assert region.side == pytest.approx(1.2 * 256) and region.center == pytest.approx((190, 232))


def test_the_box_is_even_and_inside_the_frame():
    probability = np.zeros((101, 77), np.float32)
    probability[31:95, 13:76] = 1
    x0, y0, x1, y1 = around(probability)
    assert x0 % 2 == y0 % 2 == 0 and x1 == 77 and y1 == 101 and x0 <= 9 and y0 <= 27


def test_every_named_method_exists_and_bad_parameters_are_named():
    assert {*METHODS, "brought"} == {*MODELS} == {*get_args(Method)}
    with pytest.raises(BadInput, match="segment.method.*'magic'.*pose"):
        make_config(STAGE, {"method": "magic"})
    with pytest.raises(BadInput, match="segment.iterations"):
        make_config(STAGE, {"iterations": -1})

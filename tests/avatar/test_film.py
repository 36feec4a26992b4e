"""Films of the asymmetric figure: its left hand is red, its right one blue, its front green."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar import film as rules
from gsac.avatar.film import FOLLOW_S, draw_frames, find_distances, find_targets, fit_aspect, performance, turntable
from gsac.avatar.motion.source import Motion
from support.scripts import TOOLS, script

WIDTH, HEIGHT = 120, 160
BLACK = np.zeros(3)


def drawn(figure, film):
    return np.stack(list(draw_frames(figure, film, WIDTH, HEIGHT, BLACK))).astype(float)


def columns(image, channel):
    """Mean column of the pixels where a channel outshines the two others."""
    others = [c for c in range(3) if c != channel]
    mask = image[..., channel] > image[..., others].max(-1) + 80
    assert mask.any()
    return np.nonzero(mask)[1].mean()


def raised(figure, joint, turn, T=4):
    rotation = np.zeros((T, len(figure.joints), 3), np.float32)
    rotation[:, figure.joint_names.index(joint)] = turn
    return Motion(10.0, rotation, np.zeros((T, 3), np.float32))


def test_the_turn_begins_at_the_front_goes_all_round_and_the_left_hand_is_at_the_right(figure):
    seen = drawn(figure, turntable(figure, 0.8, 10))
    assert len(seen) == 8
    assert columns(seen[0], 0) > WIDTH / 2 > columns(seen[0], 2)
    assert columns(seen[4], 0) < WIDTH / 2 < columns(seen[4], 2), "half way round we see the back"
    green = [(image[..., 1] > image[..., 0] + 40).mean() for image in seen]
    assert green[0] > 5 * green[4]
    assert columns(seen[1], 0) < columns(seen[0], 0), "the camera goes to our right, so the left hand comes to the middle"


def test_an_avatar_without_poses_turns_in_t_pose_as_in_the_viewer(figure):
    np.testing.assert_array_equal(turntable(replace(figure, poses={}), 0.2, 10).pose, np.zeros((2, len(figure.joints), 3)))
    only_t = replace(figure, poses={"T": figure.poses["A"]})
    np.testing.assert_array_equal(turntable(only_t, 0.1, 10).pose[0], figure.pose("A"))


def test_the_shadow_lies_under_the_feet_and_nowhere_else(figure):
    film = turntable(figure, 0.1, 10)
    white = np.ones(3)
    plain, shaded = (next(iter(draw_frames(figure, film, WIDTH, HEIGHT, white, shadow=s))).astype(float) for s in (False, True))
    darker = (plain - shaded).max(-1)
    rows, columns_ = np.nonzero(darker > 20)
    assert darker.min() >= -1 and len(rows) > 50
    assert rows.min() > 0.8 * HEIGHT and abs(columns_.mean() - WIDTH / 2) < 4


def test_a_floor_lies_under_the_feet_has_lines_and_fades_out_before_the_horizon(figure):
    film, red = turntable(figure, 0.1, 10), np.array([1.0, 0, 0])
    plain, floored = (next(iter(draw_frames(figure, film, WIDTH, HEIGHT, BLACK, floor=f))).astype(float) for f in (None, red))
    gained = (floored - plain).max(-1)
    there = gained[:, [2, -3]].mean(1)
    assert there[-1] > 200 and there[:HEIGHT // 2].max() < 1 and (np.diff(there[HEIGHT // 2:]) > -30).all()
    lines = floored[-20:][gained[-20:] > 0]
    assert 5 < (lines[:, 1] > 5).sum() < 0.4 * len(lines), "on a dark colour they are brighter"
    (bare,) = draw_frames(figure, film, WIDTH, HEIGHT, None, floor=red)
    assert (bare[-1, 2] == (255, 0, 0, 255)).all() or bare[-1, 2, 3] > 200
    assert (bare[:HEIGHT // 4, :5, 3] == 0).all(), "what is not there stays transparent"


def test_the_shadow_lies_on_the_floor(figure):
    film = turntable(figure, 0.1, 10)
    plain, shaded = (next(iter(draw_frames(figure, film, WIDTH, HEIGHT, BLACK, shadow=s, floor=np.ones(3)))).astype(float)
                     for s in (False, True))
    rows, columns_ = np.nonzero((plain - shaded).max(-1) > 20)
    assert len(rows) > 50 and rows.min() > 0.8 * HEIGHT and abs(columns_.mean() - WIDTH / 2) < 4


def test_a_motion_may_be_seen_from_behind(figure):
    still = raised(figure, "head", (0, 0, 0))
    front, behind = (next(iter(draw_frames(figure, performance(still, 10, yaw=yaw), WIDTH, HEIGHT, BLACK))).astype(float)
                     for yaw in (0.0, 180.0))
    assert columns(front, 0) > WIDTH / 2 > columns(behind, 0)


def test_a_raised_right_arm_is_raised_at_the_left_of_the_picture(figure):
    film = performance(raised(figure, "right_shoulder", (0, 0, -1.2)), 10)
    image = drawn(figure, film)[0]
    blue = image[..., 2] > image[..., :2].max(-1) + 80
    red = image[..., 0] > image[..., 1:].max(-1) + 80
    (blue_y, blue_x), (red_y, red_x) = (np.array(np.nonzero(m)).mean(1) for m in (blue, red))
    assert blue_x < WIDTH / 2 < red_x and blue_y < red_y - 20


def restless(figure, T=41):
    """Stands, spreads a leg in the middle, and has the arms down or up by turns."""
    moved = raised(figure, "left_hip", (0, 0, 0), T)
    moved.rotation[T // 2:T // 2 + 4, figure.joint_names.index("left_hip")] = (0, 0, 1.4)
    for name, side in (("left_shoulder", 1), ("right_shoulder", -1)):
        moved.rotation[:, figure.joint_names.index(name), 2] = side * np.where(np.arange(T) < T // 3, 1.3, -1.1)
    return moved


def test_every_pose_is_inside_the_picture_and_fills_it(figure):
    for film in (turntable(figure, 1, 12), performance(restless(figure), 10)):
        lit = drawn(figure, film).max(-1) > 8
        assert not lit[:, [0, -1]].any() and not lit[:, :, [0, -1]].any()
        used = lit.any(0)
        assert max(np.ptp(np.nonzero(used)[0]) / HEIGHT, np.ptp(np.nonzero(used)[1]) / WIDTH) > 0.85


def test_in_a_picture_as_wide_as_the_motion_needs_the_figure_fills_the_height_all_the_time(figure):
    film = performance(restless(figure), 10)
    aspect = fit_aspect(figure, film)
    lit = np.stack(list(draw_frames(figure, film, int(np.ceil(HEIGHT * aspect)), HEIGHT, BLACK))).max(-1) > 8
    tall = np.array([np.ptp(np.nonzero(frame.any(1))[0]) / HEIGHT for frame in lit])
    assert np.median(tall) > 0.8 and tall.min() > 0.65
    assert not lit[:, [0, -1]].any() and not lit[:, :, [0, -1]].any()
    assert lit.any((0, 1))[[7, -8]].any(), "and no wider"


def test_the_camera_comes_nearer_slowly_and_keeps_its_distance_on_the_way_round(figure):
    film = performance(restless(figure), 10)
    distances = find_distances(figure, film, find_targets(figure, film), 0.75)
    assert np.ptp(distances) > 0.1 and np.abs(np.diff(np.log(distances))).max() * film.fps < 0.6
    film = turntable(figure, 1, 10)
    assert np.ptp(find_distances(figure, film, find_targets(figure, film), 0.75)) == 0


def test_the_camera_goes_along_and_a_step_is_still_seen_as_one(figure):
    walk = raised(figure, "left_elbow", 0, 41)
    walk.transl[:, 0] = np.linspace(0, 8, 41)
    seen = drawn(figure, performance(walk, 10))
    assert np.abs(np.array([columns(i, 0) for i in seen[10:30]]) - columns(seen[20], 0)).max() < 3
    jump = raised(figure, "left_elbow", 0, 3)
    jump.transl[1, 0] = 0.3
    seen = drawn(figure, performance(jump, 10))
    assert FOLLOW_S > 0.3 and columns(seen[1], 0) > columns(seen[0], 0) + 5


def test_the_light_stands_still_in_the_room_while_the_camera_goes_round(figure):
    grey = replace(figure, gaussians=replace(figure.gaussians, rgb=np.full_like(figure.gaussians.rgb, .4)))
    from_its_left = replace(grey, gaussians=replace(grey.gaussians, light=np.float32([[1] * 3, [.8] * 3, [0] * 3, [0] * 3])))
    film = turntable(figure, 0.8, 10)
    even, lit = drawn(grey, film).mean(-1), drawn(from_its_left, film).mean(-1)
    person = even > 90
    at_left, front, at_right, back = (lit[t][person[t]].mean() / even[t][person[t]].mean() for t in (2, 0, 6, 4))
    assert at_left > 1.25 and at_right < .75 and abs(front - 1) < .1 and abs(back - 1) < .1


@pytest.mark.parametrize(("fps", "seconds", "count"), [(10, None, 11), (20, None, 21), (7, None, 8), (10, 0.5, 6), (10, 9, 11)])
def test_a_film_has_the_frames_of_its_rate_and_length(figure, fps, seconds, count):
    motion = raised(figure, "left_elbow", 0, 11)
    motion.rotation[:, 4, 0] = np.arange(11) * 0.1
    film = performance(motion, fps, seconds)
    assert len(film) == count
    np.testing.assert_allclose(film.pose[:, 4, 0], np.arange(count) / fps, atol=1e-5)


def test_the_readme_s_film_turns_once_walks_and_ends_where_it_begins(figure):
    motion = script("demo_pictures").turn_and_walk(figure)
    yaw = motion.rotation[:120, 0, 1]
    assert yaw[0] == 0 and yaw[-1] == pytest.approx(2 * np.pi, abs=0.01) and (np.diff(yaw) > 0).all()
    assert np.abs(motion.rotation[-1, 1:] - motion.rotation[0, 1:]).max() < 0.1 > np.abs(motion.transl[-1]).max()
    knee = motion.rotation[:, figure.joint_names.index("left_knee"), 0]
    assert np.sum((knee[:-1] < 0.6) & (knee[1:] >= 0.6)) == 4, "four double steps"


def test_the_readme_s_film_is_small_and_plays():
    from PIL import Image

    file = TOOLS.parent / "docs" / "demo-film.webp"
    assert file.stat().st_size < 1.5e6
    with Image.open(file) as film:
        assert film.n_frames > 200 and film.info["loop"] == 0


@pytest.mark.parametrize(("file", "pattern", "expected"), [
    ("camera.js", r"this\.fov = ([\d.]+);", rules.FOV), ("camera.js", r"\bPITCH = ([\d.]+);", rules.PITCH),
    ("address.js", r"degrees, 1 to 150\"\) \?\? ([\d.]+),", rules.FOV),
    ("viewer.js", r"\bSHADOW_RADIUS = ([\d.]+);", rules.SHADOW_RADIUS),
    ("viewer.js", r"\bSHADOW_STRENGTH = ([\d.]+);", rules.SHADOW_STRENGTH)])
def test_a_film_is_framed_and_shadowed_as_the_viewer_does_it(file, pattern, expected):
    text = (Path(__file__).resolve().parents[2] / "viewer" / file).read_text()
    assert [float(number) for number in re.findall(pattern, text)] == [expected]

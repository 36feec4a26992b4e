"""A moving camera is told from a still one, and from what moves before a still one."""

import cv2
import numpy as np
import pytest

from gsac.avatar.camera_motion import find_moved, make_view, measure_sway

T, WIDTH, HEIGHT = 12, 270, 480
Y, X = np.mgrid[:HEIGHT, :WIDTH]
PX = HEIGHT / 1280
"""px here per px of a phone's 720 x 1280."""


def texture(seed, height=HEIGHT, width=WIDTH):
    """(height, width) float32 in 0..255, blots of some px."""
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=(height, width)).astype(np.float32), (0, 0), 3)
    return np.clip(128 + 45 * noise / noise.std(), 0, 255)


def place(t):
    """(2, 3) of a still camera."""
    return np.eye(2, 3)


def sway(px):
    return lambda t: np.array([[1, 0, px * PX * np.sin(t)], [0, 1, 0.6 * px * PX * np.cos(1.3 * t)]])


def pan(px):
    return lambda t: np.array([[1, 0, px * PX * t / (T - 1)], [0, 1, 0.0]])


def zoom(by):
    return lambda t: cv2.getRotationMatrix2D((WIDTH / 2, HEIGHT / 2), 0, 1 + by * t / (T - 1))


def film(room, camera=place, grain=2.0):
    """The views of a person who turns in a room. room: t -> (HEIGHT, WIDTH), what stands there; camera: t -> (2, 3)."""
    rng = np.random.default_rng(5)
    for t in range(T):
        person = (((X - WIDTH / 2) / (40 + 10 * np.sin(t))) ** 2 + ((Y - 260) / 180) ** 2 < 1).astype(np.float32)
        scene = np.where(person > 0, np.roll(texture(9), 7 * t, 1), room(t)).astype(np.float32)
        scene, alpha = (cv2.warpAffine(picture, camera(t), (WIDTH, HEIGHT), borderMode=cv2.BORDER_REFLECT_101)
                        for picture in (scene, person))
        scene = np.clip(scene + rng.normal(0, grain, scene.shape), 0, 255).astype(np.uint8)
        yield make_view(np.repeat(scene[..., None], 3, 2), alpha)


def furnished(t):
    return texture(1)


def plain(t):
    return np.full((HEIGHT, WIDTH), 170.0) - 40 * (Y > 380)


def shadow(t):
    return plain(t) * (1 - 0.4 * (((X - 130 - 50 * np.sin(0.3 * t)) / 45) ** 2 + ((Y - 220) / 110) ** 2 < 1))


def screen(t):
    room = plain(t)
    room[30:160, 20:250] = texture(3, 130, 230 + 5 * T)[:, 5 * t: 5 * t + 230]
    return room


def leaves(t):
    bend = cv2.resize(np.random.default_rng(t).normal(0, 5, (8, 5, 2)).astype(np.float32), (WIDTH, HEIGHT),
                      interpolation=cv2.INTER_CUBIC)
    return cv2.remap(texture(1), np.float32(X) + bend[..., 0], np.float32(Y) + bend[..., 1], cv2.INTER_LINEAR,
                     borderMode=cv2.BORDER_REFLECT_101)


@pytest.mark.parametrize(("camera", "most"), [(sway(10), 11.7), (sway(40), 47), (pan(40), 20), (pan(300), 150), (zoom(0.1), 18.4)])
def test_sway_a_pan_and_a_zoom_are_measured_to_two_px(camera, most):
    found = measure_sway(film(furnished, camera))
    assert np.isfinite(found).all()
    assert np.max(found) / PX == pytest.approx(most, abs=2)
    assert find_moved(found, HEIGHT).sum() >= T // 2


def zoom_step(by):
    return lambda t: cv2.getRotationMatrix2D((WIDTH / 2, HEIGHT / 2), 0, 1 + by * (t >= 7))


def bump(px):
    return lambda t: np.array([[1, 0, px * PX * (t >= 7)], [0, 1, 0.0]])


@pytest.mark.parametrize(("camera", "px"), [(bump(60), 60), (bump(220), 220), (zoom_step(0.1), 37), (zoom_step(0.25), 92)])
def test_a_jump_is_measured_whole_and_only_the_frames_after_it_are_named(camera, px):
    sway = measure_sway(film(furnished, camera)) / PX
    assert find_moved(sway, HEIGHT / PX).tolist() == [False] * 7 + [True] * 5
    assert np.nanmax(sway) == pytest.approx(px, rel=0.1)


@pytest.mark.parametrize("room", [furnished, plain, shadow, screen, leaves])
@pytest.mark.parametrize("grain", [0, 8])
def test_no_shadow_screen_leaves_or_grain_before_a_still_camera_is_taken_for_its_motion(room, grain):
    assert not find_moved(measure_sway(film(room, grain=grain)), HEIGHT).any()


def test_flicker_and_a_screen_in_a_furnished_room_leave_the_camera_known_to_be_still():
    def lit(t):
        room = furnished(t)
        room[30:160, 20:150] = screen(t)[30:160, 20:150]
        return room * (1 + 0.12 * np.sin(2 * t))

    found = measure_sway(film(lit))
    assert np.isfinite(found).all() and np.max(found) < 1


@pytest.mark.parametrize("camera", [place, sway(40)])
def test_before_a_plain_wall_it_is_unknown_whether_the_camera_moves(camera):
    assert np.isnan(measure_sway(film(plain, camera))).all()


def test_frames_hidden_by_a_hand_at_the_start_do_not_hide_the_rest():
    found = measure_sway(film(lambda t: plain(t) if t < 3 else furnished(t), sway(10)))
    assert np.isnan(found[:2]).all() and np.isfinite(found[3:]).all() and find_moved(found, HEIGHT).any()


def test_one_frame_alone_is_no_motion_and_no_frames_no_error():
    assert not find_moved(np.array([0.0, 9.0, 0.0]), 480).any()
    assert find_moved(np.array([0.0, 9.0, np.nan, 9.0]), 480).tolist() == [False, True, False, True]
    assert np.isnan(measure_sway([*film(furnished)][:1])).all() and len(measure_sway([])) == 0

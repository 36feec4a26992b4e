"""The colour in the soft edge of a frame that is cut out."""

import cv2
import numpy as np
import pytest

from gsac.avatar.camera import Camera
from gsac.avatar.frame_files import write_alpha, write_frame
from gsac.stages.train.edge_colour import unmix
from gsac.stages.train.views import read_whole

PERSON, WALL = (40, 60, 130), (220, 210, 200)


def disc():
    """(H, W) 0..1: a disc with a soft edge."""
    big = cv2.circle(np.zeros((480, 320), np.uint8), (160, 240), 100, 255, -1)
    return cv2.resize(cv2.GaussianBlur(big, (0, 0), 5), (80, 120), interpolation=cv2.INTER_AREA) / np.float32(255)


def mixed(alpha):
    return np.uint8(np.round(alpha[..., None] * PERSON + (1 - alpha[..., None]) * WALL))


def test_the_soft_edge_is_cut_out_in_the_persons_own_colour(tmp_path):
    alpha = disc()
    for folder in ("frames", "alpha"):
        (tmp_path / folder).mkdir()
    write_frame(tmp_path / "frames/000000.png", mixed(alpha))
    write_alpha(tmp_path / "alpha/000000.exr", alpha)
    view = read_whole(tmp_path / "frames", tmp_path / "alpha", Camera((100, 100), (40, 60), 80, 120), [0])[0]
    error = np.abs(view.pixels[..., :3] - alpha[..., None] * PERSON).max(2)
    assert ((alpha > 0.2) & (alpha < 0.8)).sum() > 100
    assert error.max() < 5
    assert np.abs(mixed(alpha) * alpha[..., None] - alpha[..., None] * PERSON).max() > 30


def test_inside_and_far_from_any_sure_pixel_the_frame_keeps_its_colours():
    alpha = disc()
    frame = np.random.default_rng(0).integers(0, 255, (*alpha.shape, 3), np.uint8)
    assert np.array_equal(unmix(frame, alpha)[(alpha >= 0.98) | (alpha == 0)], frame[(alpha >= 0.98) | (alpha == 0)])
    thin = alpha * 0.9
    thin[5, 5] = 1
    assert np.array_equal(unmix(frame, thin)[20:], frame[20:])


@pytest.mark.parametrize("value", [0, 1])
def test_a_frame_without_an_edge_stays_as_it_is(value):
    frame = mixed(disc())
    assert np.array_equal(unmix(frame, np.full(frame.shape[:2], value, np.float32)), frame)

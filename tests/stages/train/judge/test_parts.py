"""Likeness at one size: what the size, the rim and the parts do to its figures."""

import cv2
import numpy as np
import pytest

from gsac.stages.train.judge.parts import SIZES, average, compare_parts


def person(height, blur=0.0, shift=0):
    """rgb (H, W, 3) premultiplied, mask (H, W) and boxes of a chequered block, as fine at every size; blur, shift: shares of it."""
    width = height // 2
    y, x = np.mgrid[:height, :width] / height
    chequer = (np.floor(y * 24) + np.floor((x + shift) * 24)) % 2
    mask = np.float32((y > 0.1) & (y < 0.9) & (x > 0.1) & (x < 0.4))
    rgb = np.repeat((0.3 + 0.4 * chequer)[..., None], 3, 2).astype(np.float32)
    if blur:
        rgb = cv2.GaussianBlur(rgb, (0, 0), blur * height)
    box = tuple(round(height * v) for v in (0.15, 0.15, 0.35, 0.35))
    return rgb * mask[..., None], mask, {"face": box}


def judged(height, **changes):
    real, mask, boxes = person(height)
    render = person(height, **changes)
    return {part: average(rows) for part, rows in compare_parts(*render[:2], real, mask, boxes).items()}


def test_the_same_avatar_is_as_like_at_every_size_of_the_footage():
    small, large = judged(540, blur=0.008), judged(1280, blur=0.008)
    for part in ("body", "face"):
        assert small[part]["psnr"] == pytest.approx(large[part]["psnr"], abs=1.0)
        assert small[part]["structure"] == pytest.approx(large[part]["structure"], abs=0.05)
        assert large[part]["px"] > 2 * small[part]["px"]


def test_blur_costs_structure_in_every_part():
    sharp, soft = judged(600), judged(600, blur=0.02)
    assert sharp["body"]["structure"] > 0.99 and soft["body"]["structure"] < 0.6
    assert soft["face"]["structure"] < sharp["face"]["structure"] - 0.2 and soft["face"]["worst"] <= soft["face"]["structure"]


def test_a_cut_out_that_is_wrong_at_its_rim_is_no_unlikeness():
    real, mask, boxes = person(600)
    wider = cv2.dilate(mask, np.ones((3, 3), np.uint8))
    rgb = np.where((wider > mask)[..., None], 0.1, real).astype(np.float32)
    assert average(compare_parts(rgb, wider, real, mask, boxes)["body"])["psnr"] > 50


def test_a_part_that_no_frame_shows_has_no_figures():
    assert judged(600)["hands"] is None and set(judged(600)) == set(SIZES)
    real, mask, _ = person(600)
    assert compare_parts(real * 0, mask * 0, real * 0, mask * 0, {}) == {part: [] for part in SIZES}

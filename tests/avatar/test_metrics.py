"""Metrics against figures worked out by hand."""

import numpy as np
import pytest

from gsac.avatar.metrics import detail, psnr, score, ssim, summary


def square(value=0.5, size=40, at=10, side=20):
    rgb, alpha = np.zeros((size, size, 3)), np.zeros((size, size))
    alpha[at:at + side, at:at + side] = 1
    rgb[alpha > 0] = value
    return rgb, alpha


def test_psnr_of_a_known_difference():
    assert psnr(0.01) == pytest.approx(20)
    rgb, alpha = square(128 / 255)
    truth, mask = square(102 / 255)
    scores = score(rgb, alpha, truth, mask)
    assert scores["mse_fg"] == pytest.approx((26 / 255) ** 2)
    assert scores["mse_white"] == pytest.approx((26 / 255) ** 2 / 4)
    assert scores["alpha_iou"] == 1 and scores["fg_pixels"] == 400


def test_a_missing_limb_and_an_added_limb_cost_person_psnr():
    full, half = square(), square(side=10)
    assert score(*half, *full)["mse_fg"] == pytest.approx(0.75 * (127 / 255) ** 2, rel=1e-2)
    assert score(*full, *half)["mse_fg"] == pytest.approx(0.75 * (127 / 255) ** 2, rel=1e-2)


def test_background_shows_alpha_errors():
    rgb, alpha = square(0.0)
    empty = np.zeros_like(rgb), np.zeros_like(alpha)
    scores = score(rgb, alpha, *empty)
    assert scores["mse_black"] == 0 and scores["mse_white"] == pytest.approx(0.25)


def test_pooled_psnr_is_never_above_the_mean_of_psnr():
    truth = square(102 / 255)
    figures = summary([score(*square(v), *truth) for v in (104 / 255, 128 / 255, 200 / 255)])
    assert figures["psnr_fg_pooled"] < figures["psnr_fg"]
    assert figures["lpips"] is None


def test_ssim_is_one_for_equal_images_and_follows_the_formula_for_constants():
    rng = np.random.default_rng(0)
    image = rng.random((30, 40, 3))
    assert ssim(image, image) == pytest.approx(1)
    a, b = np.full((20, 20, 3), 0.2), np.full((20, 20, 3), 0.6)
    assert ssim(a, b) == pytest.approx((2 * 0.12 + 1e-4) / (0.04 + 0.36 + 1e-4), rel=1e-6)
    assert ssim(image, rng.random((30, 40, 3))) < 0.2


def test_an_empty_frame_gives_no_person_figure_and_no_nan_in_the_summary():
    empty = np.zeros((20, 20, 3)), np.zeros((20, 20))
    figures = summary([score(*empty, *empty)])
    assert figures["psnr_fg"] is None and figures["psnr_fg_pooled"] is None and figures["alpha_iou"] is None
    assert figures["psnr_full"] > 50
    assert summary([])["psnr_full"] is None


def test_detail_falls_with_blur_and_rises_with_noise():
    import cv2

    rng = np.random.default_rng(0)
    truth = cv2.GaussianBlur(rng.random((40, 40, 3)), (0, 0), 1.0)
    region = np.ones((40, 40), bool)
    assert detail(truth, truth, region) == 1
    assert detail(cv2.GaussianBlur(truth, (0, 0), 1.0), truth, region) < 0.8
    assert detail(truth + rng.normal(0, 0.1, truth.shape), truth, region) > 1.2
    assert np.isnan(detail(truth, np.zeros_like(truth), region))

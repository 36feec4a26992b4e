"""Metrics against figures worked out by hand."""

import numpy as np
import pytest

from gsac.avatar.flip_metric import flip
from gsac.avatar.metrics import BLACK, WHITE, composite, detail, figures, psnr, score, score_person, ssim, summary


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


def soft_person(seed, size=(150, 120)):
    """rgb (H, W, 3) premultiplied and alpha (H, W) of a textured ellipse with a soft edge."""
    import cv2

    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size[0], :size[1]]
    alpha = cv2.GaussianBlur(np.float32(((y - 80) / 40) ** 2 + ((x - 50 - 2 * seed) / 20) ** 2 < 1), (0, 0), 1.5)
    alpha[alpha < 0.02] = 0
    return np.float32(rng.random((*size, 3)) * alpha[..., None]), alpha


def test_the_background_that_is_not_looked_at_changes_no_figure():
    render, truth = soft_person(0), soft_person(1)
    scores = score(*render, *truth, with_flip=True)
    white, black = ((composite(*render, ground), composite(*truth, ground)) for ground in (WHITE, BLACK))
    assert scores["ssim"] == pytest.approx(ssim(*white), abs=1e-5)
    assert scores["ssim_black"] == pytest.approx(ssim(*black), abs=1e-5) and scores["ssim"] != scores["ssim_black"]
    assert scores["mse_white"] == pytest.approx(((white[0] - white[1]) ** 2).mean())
    assert scores["mse_black"] == pytest.approx(((black[0] - black[1]) ** 2).mean())
    person = (render[1] >= 0.5) | (truth[1] >= 0.5)
    assert scores["flip"] == pytest.approx(flip(white[1], white[0])[person].mean(), rel=1e-6)
    assert scores["detail"] == pytest.approx(detail(*white, (render[1] >= 0.5) & (truth[1] >= 0.5)))
    assert score_person(*render, *truth) == {name: scores[name] for name in ("mse_fg", "fg_pixels", "detail")}


def test_an_error_at_the_outline_and_one_inside_are_told_apart():
    truth, mask = square(128 / 255, size=1280, at=400, side=400)
    edge, inside = truth.copy(), truth.copy()
    edge[400:405, 400:800], inside[405:795, 405:795] = 1, 1
    at_edge, deep = (figures(score(rgb, mask, truth, mask)) for rgb in (edge, inside))
    assert at_edge["psnr_inside"] > 58 > 20 > at_edge["psnr_edge"]
    assert deep["psnr_edge"] > 58 > 20 > deep["psnr_inside"] == pytest.approx(psnr((127 / 255) ** 2))
    assert score(edge, mask, truth, mask)["mse_edge"] == pytest.approx((127 / 255) ** 2 * 2000 / (408**2 - 390**2), rel=1e-2)


def test_the_band_at_the_outline_is_as_much_of_the_person_in_a_smaller_frame():
    truth, mask = square(128 / 255, size=640, at=200, side=200)
    edge = truth.copy()
    edge[200:203, 200:400] = 1
    assert figures(score(edge, mask, truth, mask))["psnr_inside"] > 58
    edge[203] = 1
    assert figures(score(edge, mask, truth, mask))["psnr_inside"] < 40


def test_alpha_is_astray_beyond_two_px_of_the_mask():
    truth, mask = square(0.5, size=1280, at=400, side=100)
    near, far = mask.copy(), mask.copy()
    near[398:502, 400:500], far[380, 400:500] = 1, 0.5
    assert score(truth, near, truth, mask)["stray_edge_alpha"] == 0
    assert score(truth, far, truth, mask)["stray_edge_alpha"] == pytest.approx(50 / 100**2)


def test_the_papers_ssim_and_lpips_are_of_images_on_black_and_lpips_of_0_to_1():
    class Network:
        calls = []

        def distance(self, a, b, scaled):
            self.calls.append((float(a[0, 0, 0]), scaled))
            return float(len(self.calls))

    render, truth = square(0.5, size=80), square(0.6, size=80)
    told = summary([score(*render, *truth, networks={"lpips-vgg": Network()})])
    assert Network.calls == [(1.0, True), (0.0, False)]
    assert told["lpips"] == told["lpips_vgg"] == 1 and told["lpips_black"] == told["lpips_vgg_black"] == 2
    assert told["lpips_net"] == "lpips-vgg" and told["lpips_alex_black"] is None


def test_vgg_features_are_a_figure_of_their_own_never_lpips_and_only_where_their_network_is():
    class Network:
        def distance(self, a, b, scaled):
            assert not scaled and a[0, 0, 0] == 1
            return 0.25

    render, truth = square(0.5, size=80), square(0.6, size=80)
    told = summary([score(*render, *truth, networks={"vgg-hed": Network()})])
    assert told["vgg_hed"] == 0.25 and told["lpips"] is told["lpips_net"] is told["lpips_black"] is told["lpips_vgg"] is None
    assert "vgg_hed" not in summary([score(*render, *truth)]) | summary([])

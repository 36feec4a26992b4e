"""The loop's kernels against plain numpy."""

import numpy as np
import pytest

from gsac.avatar.threads import Workspace
from gsac.stages.train.gaussians.kernels import adam_rows, count_rows, limit, on_background, through_background

SHARE = Workspace(2).share


def images(seed=0, h=7, w=5):
    rng = np.random.default_rng(seed)
    alpha = rng.random((h, w))
    rgb = rng.random((h, w, 3)) * alpha[..., None]
    pixels = rng.integers(0, 256, (h, w, 4)).astype(np.uint8)
    return rgb, alpha, pixels, rng.random(3), rng.random(3) + 0.5


def spans(alpha):
    return np.empty((len(alpha), 2), np.int64)


def test_backgrounds_gradient_agrees_with_central_differences():
    rgb, alpha, pixels, background, gain = images()
    weight = np.random.default_rng(1).normal(size=rgb.shape)

    def loss(rgb, alpha, gain):
        image, target = np.empty_like(rgb), np.empty_like(rgb)
        on_background(SHARE, rgb, alpha, pixels, background, gain, image, target, spans(alpha))
        return (image * weight).sum() + 0.3 * ((alpha - pixels[..., 3] / 255) ** 2).mean()

    got = [np.empty_like(rgb), np.empty_like(alpha), np.empty(3)]
    term = through_background(SHARE, weight, rgb, alpha, pixels, background, gain, 0.3, *got)
    assert term == pytest.approx(0.3 * ((alpha - pixels[..., 3] / 255) ** 2).mean())
    values = [rgb, alpha, gain]
    for which in range(3):
        want = np.empty_like(values[which])
        for i in np.ndindex(want.shape):
            step = np.zeros_like(want)
            step[i] = 1e-6
            args = [[a + s * step if n == which else a for n, a in enumerate(values)] for s in (1, -1)]
            want[i] = (loss(*args[0]) - loss(*args[1])) / 2e-6
        np.testing.assert_allclose(got[which], want, rtol=1e-6, atol=1e-8)


def test_frame_and_render_of_the_same_content_agree_on_any_background():
    _, _, pixels, background, _ = images()
    alpha = pixels[..., 3] / 255
    image, target = np.empty((*alpha.shape, 3)), np.empty((*alpha.shape, 3))
    on_background(SHARE, pixels[..., :3] / 255, alpha, pixels, background, np.ones(3), image, target, spans(alpha))
    np.testing.assert_allclose(image, target, atol=1e-12)


def test_spans_hold_all_that_shows_the_person_and_no_blank_column_beside():
    rgb, alpha, pixels, background, gain = images(h=4, w=9)
    alpha[:, :2], pixels[:, :3] = 0, 0
    alpha[1, 7:], pixels[1, 6:] = 0, 0
    alpha[2], pixels[2] = 0, 0
    found = spans(alpha)
    on_background(SHARE, rgb, alpha, pixels, background, gain, np.empty_like(rgb), np.empty_like(rgb), found)
    assert found[[0, 1]].tolist() == [[2, 9], [2, 7]] and found[2, 0] == found[2, 1]


def test_a_background_gives_the_same_bytes_on_any_number_of_threads():
    rgb, alpha, pixels, background, gain = images(h=70, w=33)

    def both(workers: int) -> list[np.ndarray]:
        share, (image, target, grad_rgb), grad_alpha = Workspace(workers).share, np.empty((3, *rgb.shape)), np.empty_like(alpha)
        grad_gain = np.empty(3)
        on_background(share, rgb, alpha, pixels, background, gain, image, target, spans(alpha))
        term = through_background(share, image - target, rgb, alpha, pixels, background, gain, 0.3, grad_rgb, grad_alpha, grad_gain)
        return [image, target, grad_rgb, grad_alpha, grad_gain, np.array(term)]

    for one, more in zip(both(1), both(3), strict=True):
        np.testing.assert_array_equal(one, more)


def test_adam_moves_a_row_by_the_rate_at_first_and_leaves_rows_without_gradient():
    value, grad = np.ones((3, 2), np.float32), np.array([[1.0, -50], [0, 0], [1e-6, 1]], np.float32)
    first, second, count = np.zeros((3, 2)), np.zeros((3, 2)), np.zeros(3, np.int64)
    bias = np.empty((3, 2))
    count_rows(grad, count, bias)
    adam_rows(value, grad, first, second, bias, 0.1)
    np.testing.assert_allclose(value, [[0.9, 1.1], [1, 1], [0.9, 0.9]], atol=1e-5)
    np.testing.assert_array_equal(count, [1, 0, 1])


def test_no_needle_speck_giant_or_floater_survives_the_limits():
    rng = np.random.default_rng(2)
    n = 200
    mu, start = rng.normal(0, 3, (n, 3)), rng.normal(0, 0.01, (n, 3))
    quat = rng.normal(size=(n, 4))
    quat[0] = 0
    log_scale, rgb, logit = rng.normal(0, 5, (n, 3)), rng.normal(0, 2, (n, 3)), rng.normal(0, 20, (n, 1))
    k = rng.uniform(0.05, 1, n)
    largest, tied = rng.uniform(0.03, 0.05, n), np.arange(n) % 3 == 0
    limit(mu, quat, log_scale, rgb, logit, start, k, largest, tied, 4.0, 0.002, 0.08, 0.003, 0.0)
    scales = np.sort(np.exp(log_scale), axis=1)
    assert (scales[:, 2] <= 4.0 * scales[:, 1] * 1.0001).all() and (scales[:, 2] <= 10.001 * scales[:, 0]).all()
    assert (scales[:, 2] * k <= largest * 1.001).all() and (scales[:, 0] * k >= 0.00199).all()
    assert (np.linalg.norm(mu - start, axis=1) * k <= np.where(tied, 0.00301, 0.08001)).all()
    assert not quat[tied][:, [1, 3]].any() and quat[~tied][:, [1, 3]].all()
    assert (np.exp(log_scale[tied, 1]) <= np.exp(log_scale[tied][:, [0, 2]].min(1)) * 1.0001).all()
    np.testing.assert_allclose(np.linalg.norm(quat, axis=1), 1)
    assert rgb.min() >= 0 and rgb.max() <= 1 and abs(logit).max() <= 9

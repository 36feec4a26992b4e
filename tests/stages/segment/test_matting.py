"""The soft edge against a plain transcription of closed-form matting, and on a painted edge whose truth is known."""

import cv2
import numpy as np

from gsac.stages.segment.matting import HOLD, NOISE, settle
from gsac.stages.segment.matting_kernels import matting_rows, solve_rows

SIZE = 14


def levin(image, noise):
    """The matting Laplacian of Levin et al. 2008, equation 12, as it is printed: dense, (H W, H W). image: (H, W, 3) in 0..1."""
    height, width = image.shape[:2]
    at, out = np.arange(height * width).reshape(height, width), np.zeros((height * width, height * width))
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            colours, pixels = image[y - 1: y + 2, x - 1: x + 2].reshape(9, 3), at[y - 1: y + 2, x - 1: x + 2].ravel()
            apart = colours - colours.mean(axis=0)
            inverse = np.linalg.inv(apart.T @ apart / 9 + noise * np.eye(3))
            out[np.ix_(pixels, pixels)] += np.eye(9) - (1 + apart @ inverse @ apart.T) / 9
    return out


def small_problem():
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (SIZE, SIZE, 3)).astype(np.uint8)
    known = np.repeat((np.arange(SIZE) < SIZE // 2).astype(np.float32)[None], SIZE, axis=0)
    unknown = np.zeros((SIZE, SIZE), bool)
    unknown[1:-1, 4:10] = True
    return image, known, unknown


def rows_of(image, known, unknown):
    order = np.full(unknown.shape, -1, np.int32)
    order[unknown] = np.arange(unknown.sum())
    centres = np.argwhere(np.ones((SIZE - 2, SIZE - 2))) + 1
    return matting_rows(image, order, known, centres, NOISE)


def test_the_rows_are_those_of_the_published_laplacian():
    image, known, unknown = small_problem()
    rows, pulls = rows_of(image, known, unknown)
    whole = levin(image / 255, NOISE)
    inside, at = unknown.ravel(), np.argwhere(unknown)
    np.testing.assert_allclose(pulls, -whole[np.ix_(inside, ~inside)] @ known.ravel()[~inside], atol=1e-4)
    dense = np.zeros((len(at), len(at)))
    for i, one in enumerate(at):
        for j, other in enumerate(at):
            if (np.abs(other - one) <= 2).all():
                dense[i, j] = rows[i, *(other - one + 2)]
    np.testing.assert_allclose(dense, whole[np.ix_(inside, inside)], atol=1e-4)


def test_the_solver_finds_the_alpha_of_these_rows():
    image, known, unknown = small_problem()
    rows, pulls = rows_of(image, known, unknown)
    rows[:, 2, 2] += HOLD
    at, inside = np.argwhere(unknown), unknown.ravel()
    start = np.full(len(at), 0.5, np.float32)
    alpha = solve_rows(rows, (at[:, 0] + 2) * (SIZE + 4) + at[:, 1] + 2, SIZE + 4, pulls + np.float32(HOLD) * start, start, 200)
    whole = levin(image / 255, NOISE)
    wanted = np.linalg.solve(whole[np.ix_(inside, inside)] + HOLD * np.eye(inside.sum()),
                             HOLD * start - whole[np.ix_(inside, ~inside)] @ known.ravel()[~inside])
    np.testing.assert_allclose(alpha, wanted, atol=2e-4)


def disc(size=160, noise=2.0):
    """A disc before a wall, both of smooth colours: image (size, size, 3) uint8, its true alpha (size, size)."""
    big = np.zeros((8 * size, 8 * size), np.float32)
    cv2.circle(big, (4 * size, 4 * size), 360, 1, -1)
    truth = cv2.resize(big, (size, size), interpolation=cv2.INTER_AREA)
    across = np.linspace(0, 1, size)
    person = 90 + 60 * across[:, None, None] * np.array([1, 0.6, 0.3])
    wall = 170 + 40 * across[None, :, None] * np.array([0.4, 1, 0.8])
    image = truth[..., None] * person + (1 - truth[..., None]) * wall
    image += np.random.default_rng(1).normal(0, noise, image.shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8), truth


def test_an_edge_that_the_network_blurs_is_settled_by_the_colours():
    image, truth = disc()
    blurred = cv2.GaussianBlur(truth, (0, 0), 1)
    assert ((settle(image, blurred) - truth) ** 2).sum() < 0.5 * ((blurred - truth) ** 2).sum()


def test_where_the_network_is_sure_nothing_changes():
    image = np.random.default_rng(2).integers(0, 256, (60, 60, 3)).astype(np.uint8)
    alpha = np.zeros((60, 60), np.float32)
    alpha[:, :30], alpha[:, 30] = 1, 0.5
    settled = settle(image, alpha)
    assert (settled[:, :30] == 1).all() and (settled[:, 31:] == 0).all()
    for flat in (0, 1):
        assert (settle(image, np.full((60, 60), flat, np.float32)) == flat).all()
    assert settle(image[:2], alpha[:2]).shape == (2, 60)

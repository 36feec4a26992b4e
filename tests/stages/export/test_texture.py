"""The mesh's picture: charts lie apart, and each place of the surface gets the colours of the gaussians over it."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from gsac.avatar.camera import Camera
from gsac.avatar.zbuffer import rasterise
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import SIZE, fill_gaps, paint_surface
from gsac.stages.export.unwrap import find_parts, unwrap


@pytest.fixture(scope="module")
def rest(figure):
    return pose_gaussians(figure, figure.pose("T"))


@pytest.fixture(scope="module")
def surface(figure, rest):
    return paint_surface(figure, *rest)


def test_each_corner_of_a_face_is_the_vertex_that_it_was(figure, surface):
    np.testing.assert_array_equal(surface.vertex[surface.faces], figure.faces)
    np.testing.assert_allclose(surface.positions, figure.vertices[surface.vertex] - np.float32([0, figure.ground, 0]))


def test_charts_lie_inside_the_picture_and_apart(figure):
    part = find_parts(figure.faces, figure.skin_index, figure.skin_weight, figure.joint_names)
    flat = unwrap(figure.vertices, figure.faces, part, SIZE)
    assert flat.uv.min() > 0 and flat.uv.max() < 1
    px = flat.uv[flat.faces].astype(float) * SIZE
    sides = px[:, 1:] - px[:, :1]
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]).sum() / 2
    face = rasterise(np.column_stack([flat.uv, np.ones(len(flat.uv))]), flat.faces, Camera((SIZE, SIZE), (0, 0), SIZE, SIZE))[0]
    assert (face >= 0).sum() == pytest.approx(area, rel=0.03), "where two charts overlap, texels are fewer than their areas"
    assert area > 0.15 * SIZE ** 2, "room is used"


def test_the_head_has_more_texels_a_metre_than_the_trunk(figure):
    part = find_parts(figure.faces, figure.skin_index, figure.skin_weight, figure.joint_names)
    flat = unwrap(figure.vertices, figure.faces, part, SIZE)

    def longest(x):
        return np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(1)

    texels = longest(flat.uv[flat.faces]) * SIZE / longest(figure.vertices[figure.faces])
    head = figure.vertices[figure.faces].mean(1)[:, 1] > 0.55
    assert np.median(texels[head]) > 2 * np.median(texels[part == -1])


def test_each_face_shows_the_gaussian_that_lies_over_it(figure):
    """Large opaque gaussians of one colour a joint, and one of another colour inside each, which is hidden."""
    g, n = figure.gaussians, len(figure.gaussians)
    joint = figure.skin_index[figure.faces[g.face, 0], 0]
    rgb = np.random.default_rng(4).random((55, 3)).astype(np.float32)[joint]
    both = replace(g, face=np.tile(g.face, 2), mu=np.concatenate([0 * g.mu, g.mu * 0 - (0, 0.2, 0)]).astype(np.float32),
                   quat=np.tile(np.float32([1, 0, 0, 0]), (2 * n, 1)), log_scale=np.full((2 * n, 3), -4.2, np.float32),
                   rgb=np.concatenate([rgb, 1 - rgb]), opacity=np.full(2 * n, 0.99, np.float32))
    avatar = replace(figure, gaussians=both)
    surface = paint_surface(avatar, *pose_gaussians(avatar, avatar.pose("T")))
    picture = np.asarray(Image.open(io.BytesIO(surface.jpeg)).convert("RGB"), float) / 255
    column, row = (surface.uv[surface.faces].mean(1) * SIZE).astype(int).T
    forearms = (lambda x: (np.abs(x) > 0.48) & (np.abs(x) < 0.6))(figure.vertices[figure.faces].mean(1)[:, 0])
    near, hidden = (np.abs(picture[row, column] - colour).max(1)[forearms] for colour in (rgb, 1 - rgb))
    assert forearms.sum() > 20 and near.max() < 0.1 and (near < hidden).all()


def test_same_input_same_picture(figure, rest, surface):
    assert paint_surface(figure, *rest).jpeg == surface.jpeg
    assert len(surface.jpeg) < 400_000


def test_what_lies_between_charts_takes_the_colour_of_the_nearest():
    picture, known = np.zeros((16, 16, 3), np.float32), np.zeros((16, 16), bool)
    known[3, 3], known[12, 12] = True, True
    picture[3, 3], picture[12, 12] = (1, 0, 0), (0, 0, 1)
    full = fill_gaps(picture, known)
    assert full[1:6, 1:6].tolist() == np.broadcast_to([255, 0, 0], (5, 5, 3)).tolist()
    assert full[10:15, 10:15].tolist() == np.broadcast_to([0, 0, 255], (5, 5, 3)).tolist()
    assert (full.max(-1) > 0).all(), "no texel is left black"

"""The face network with attention: its crops, and the real file taken apart."""

import os
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.stages.face.attention_mesh import SIDE, AttentionMesh, Part, sample, take_apart

EYE = Part(np.array([0, 1, 2, 3]), (0, 1), 1.5)
"""Corners, upper and lower lid."""


@pytest.fixture(scope="module")
def file() -> Path:
    try:
        return model_path("face_landmark_with_attention", Path(os.environ.get("GSAC_CACHE", "~/.cache/gsac")).expanduser())
    except ModelMissingError as missing:
        pytest.skip(str(missing))


@pytest.mark.parametrize("angle", [-2.0, 0.0, 0.5])
def test_a_crop_is_level_and_holds_its_points_with_a_margin(angle):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    points = np.array([(-6, 0), (6, 0), (0, -2), (0, 2)]) @ turn.T + (20, 24)
    axes, corner = EYE.crop(points)
    places = (points - corner) @ np.linalg.inv(axes).T
    np.testing.assert_allclose(places, [(8 / 3, 8), (40 / 3, 8), (8, 8 / 3), (8, 40 / 3)], atol=1e-9)


def test_features_are_sampled_where_the_crop_lies_and_are_nothing_outside():
    y, x = np.mgrid[:48, :48] + 0.5
    features = np.stack([x, y, np.ones_like(x)], axis=-1)
    axes, corner = np.array([[0.6, -0.8], [0.8, 0.6]]) * 1.3, np.array([12.0, 20.0])
    got = sample(features, axes, corner)
    places = np.stack(np.meshgrid(np.arange(SIDE) + 0.5, np.arange(SIDE) + 0.5), axis=-1) @ axes.T + corner
    inside = ((places >= 0.5) & (places <= 47.5)).all(axis=-1)
    assert 150 < inside.sum() < 256
    np.testing.assert_allclose(got[inside], np.dstack([places, np.ones((SIDE, SIDE))])[inside])
    assert not got[~inside].any()


def test_a_crop_along_the_last_samples_keeps_their_values():
    features = np.arange(48.0 * 48).reshape(48, 48, 1)
    np.testing.assert_allclose(sample(features, np.eye(2), np.array([32.0, 32.0])), features[32:, 32:])


def test_lips_and_both_eyes_are_read_again_each_point_once(file):
    _, _, parts = take_apart(file)
    assert [len(part.points) for part in parts] == [80, 71, 71]
    points = np.concatenate([part.points for part in parts])
    assert len(set(points.tolist())) == len(points) and points.max() < 468
    assert [part.level for part in parts] == [(61, 291), (33, 133), (362, 263)]


def test_it_says_of_a_grey_picture_that_there_is_no_face(file):
    points, presence = AttentionMesh(file, threads=1)(np.full((192, 192, 3), 0.5, np.float32))
    assert points.shape == (468, 3) and presence.reshape(-1)[0] < 0

import numpy as np
import pytest

from gsac.avatar.region import Region, around_circle, around_points, crop, full_frame, upright_angle
from support.regions import to_region

TURNED = Region((62.0, 55.0), 35.0, 0.7)


def test_to_frame_maps_the_square_one_to_one():
    points = np.random.default_rng(0).uniform(-1, 2, (50, 2))
    np.testing.assert_allclose(to_region(TURNED, TURNED.to_frame(points)), points, atol=1e-12)


def test_to_frame_puts_the_middle_at_the_centre_and_keeps_lengths():
    np.testing.assert_allclose(TURNED.to_frame(np.array([0.5, 0.5])), TURNED.center)
    corners = TURNED.to_frame(np.array([[0.0, 0], [1, 0], [0, 1]]))
    np.testing.assert_allclose(np.linalg.norm(corners[1:] - corners[0], axis=1), TURNED.side)


def ramp(height: int, width: int) -> np.ndarray:
    """(height, width, 3) uint8: red is twice the x of a pixel's centre, green twice its y."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([2 * x, 2 * y, 0 * x], axis=-1).astype(np.uint8)


@pytest.mark.parametrize("region", [TURNED, Region((60.0, 50.0), 64.0), Region((60.0, 52.0), 70.0, -2.0),
                                    Region((63.3, 55.9), 5.0, 0.1)])
@pytest.mark.parametrize("size", [64, 16])
def test_crop_shows_at_each_pixel_what_the_frame_has_there(region, size):
    out = crop(ramp(110, 125), region, size) * 255 / 2
    cells = (np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1) + 0.5) / size
    where = region.to_frame(cells)
    inside = ((where > 5) & (where < np.array([120, 105]))).all(axis=-1)
    assert inside.mean() > 0.5
    assert np.abs(out[..., :2] - where)[inside].max() < 1
    assert np.abs((out[..., :2] - where)[inside].mean(axis=0)).max() < 0.3


def test_crop_outside_of_the_frame_repeats_the_rim_or_is_black():
    image = np.full((50, 40, 3), 200, np.uint8)
    away = Region((-100.0, 25.0), 40.0)
    assert crop(image, away, 16).min() == pytest.approx(200 / 255)
    assert crop(image, away, 16, outside="black").max() == 0


def test_full_frame_holds_the_whole_frame():
    assert full_frame(720, 1280).box().tolist() == [-280, 0, 1000, 1280]


def test_upright_angle_turns_the_direction_to_its_target():
    start, end = np.array([10.0, 20]), np.array([60.0, -5])
    for target, wanted in ((np.pi / 2, [0, -1]), (0.0, [1, 0]), (-np.pi / 2, [0, 1])):
        region = Region((0.0, 0.0), 1.0, upright_angle(start, end, target))
        np.testing.assert_allclose((end - start) / np.hypot(*(end - start)) @ region.axes, wanted, atol=1e-12)


def test_around_circle_has_its_rim_straight_above():
    region = around_circle(np.array([100.0, 100]), np.array([130.0, 60]))
    np.testing.assert_allclose(to_region(region, np.array([130.0, 60])), [0.5, 0.0], atol=1e-12)


def test_around_points_tight_holds_turned_points_exactly():
    box = TURNED.to_frame(np.array([[0.1, 0.2], [0.7, 0.2], [0.1, 0.4], [0.7, 0.4]]))
    region = around_points(box, TURNED.angle, tight=True)
    inside = to_region(region, box)
    assert inside[:, 0].min() == pytest.approx(0) and inside[:, 0].max() == pytest.approx(1)
    assert inside[:, 1].mean() == pytest.approx(0.5)

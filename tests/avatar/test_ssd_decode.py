import numpy as np
import pytest

from gsac.avatar.ssd_decode import Detections, anchor_centers, decode, iou, suppress


@pytest.mark.parametrize(("size", "strides", "count"), [(224, (8, 16, 32, 32, 32), 2254), (192, (8, 16, 16, 16), 2016),
                                                        (128, (8, 16, 16, 16), 896)])
def test_anchors_are_as_many_as_the_networks_give_boxes(size, strides, count):
    centers = anchor_centers(size, strides)
    assert centers.shape == (count, 2)
    assert centers.min() == pytest.approx(4 / size) and centers.max() == pytest.approx(1 - 4 / size)


def test_decode_places_a_box_and_its_points_about_the_anchor():
    raw = np.array([[10, -20, 40, 60, 5, 5, -10, 0]], np.float32)
    found = decode(raw, np.array([[2.0]]), np.array([[0.5, 0.25]]), 100, 0.5)
    np.testing.assert_allclose(found.box, [[0.4, -0.25, 0.8, 0.35]])
    np.testing.assert_allclose(found.points, [[[0.55, 0.3], [0.4, 0.25]]])
    assert found.score[0] == pytest.approx(1 / (1 + np.exp(-2)))


def test_decode_without_a_find_is_empty_and_so_is_its_suppression():
    found = decode(np.zeros((7, 8), np.float32), np.full((7, 1), -3.0), np.zeros((7, 2)), 100, 0.5)
    assert len(found) == 0 and len(suppress(found)) == 0


def test_iou_of_known_boxes():
    a = np.array([0, 0, 2, 2.0])
    np.testing.assert_allclose(iou(a, np.array([[0, 0, 2, 2], [1, 0, 3, 2], [5, 5, 6, 6], [0, 0, 0, 0.0]])),
                               [1, 1 / 3, 0, 0])


def test_suppress_blends_what_overlaps_by_score_and_keeps_what_does_not():
    box = np.array([[0, 0, 1, 1], [0.1, 0, 1.1, 1], [3, 3, 4, 4.0]])
    found = Detections(box, box.reshape(3, 2, 2), np.array([0.9, 0.6, 0.7]))
    order = np.argsort(-found.score)
    out = suppress(Detections(found.box[order], found.points[order], found.score[order]))
    np.testing.assert_allclose(out.box, [[0.04, 0, 1.04, 1], [3, 3, 4, 4]])
    np.testing.assert_allclose(out.points.reshape(2, 4), out.box)
    np.testing.assert_allclose(out.score, [0.9, 0.7])

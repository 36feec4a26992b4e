import numpy as np
import pytest

from gsac.avatar.camera import Camera
from gsac.avatar.zbuffer import interpolate, rasterise, silhouette, visible_points

CAMERA = Camera((60.0, 55.0), (24.3, 19.1), 48, 40)


def soup(seed, faces=30, low=0.6, high=3.0):
    """Random triangles before the camera, some of them reaching out of the image."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(low, high, (faces * 3, 1))
    xy = rng.uniform(-0.6, 0.6, (faces * 3, 2)) * z
    return np.hstack([xy, z]), np.arange(faces * 3).reshape(-1, 3)


def brute_force(vertices, faces, camera):
    """Each pixel's ray against each face's plane, in 3D: no projection, no edge functions."""
    ys, xs = np.mgrid[: camera.height, : camera.width] + 0.5
    ray = np.stack([(xs - camera.center[0]) / camera.focal[0], (ys - camera.center[1]) / camera.focal[1],
                    np.ones_like(xs)], -1)
    depth = np.full(xs.shape, np.inf)
    face_id = np.full(xs.shape, -1)
    bary = np.zeros(xs.shape + (3,))
    margin = np.full(xs.shape, np.inf)  # how near any face's border comes to the centre, in barycentric units
    for f, corners in enumerate(vertices[faces]):
        w = ray @ np.linalg.inv(corners)  # ray = w @ corners; the hit is at z = 1 / sum(w)
        total = w.sum(-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            b, z = w / total[..., None], 1 / total
        margin = np.minimum(margin, np.abs(b.min(-1)))
        hit = (b.min(-1) >= 0) & (z > 0) & (z < depth)
        depth[hit], face_id[hit], bary[hit] = z[hit], f, b[hit]
    return face_id, bary, depth, margin


@pytest.mark.parametrize("seed", range(4))
def test_equals_ray_casting_away_from_borders(seed):
    vertices, faces = soup(seed)
    face_id, bary, depth = rasterise(vertices, faces, CAMERA)
    want_id, want_bary, want_depth, margin = brute_force(vertices, faces, CAMERA)
    sure = margin > 1e-2
    assert sure.mean() > 0.5 and (want_id[sure] >= 0).mean() > 0.5
    # Two faces may cross within rounding of each other; everything else must agree.
    assert (face_id[sure] == want_id[sure]).mean() > 0.999
    same = sure & (face_id == want_id) & (want_id >= 0)
    np.testing.assert_allclose(depth[same], want_depth[same], rtol=2e-3)
    np.testing.assert_allclose(bary[same], want_bary[same], atol=5e-3)


def test_barycentrics_are_perspective_correct():
    vertices = np.array([[-1.0, -1, 2], [1, -1, 2], [3, 6, 12.0], [-3, 6, 12.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    face_id, bary, depth = rasterise(vertices, faces, CAMERA)
    seen = face_id >= 0
    assert seen.sum() > 200
    points = interpolate(vertices, faces, face_id, bary)[seen]
    ys, xs = np.nonzero(seen)
    np.testing.assert_allclose(CAMERA.project(points), np.stack([xs, ys], -1) + 0.5, atol=2e-2)
    np.testing.assert_allclose(points[:, 2], depth[seen], rtol=1e-5)


@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_a_closed_grid_has_no_cracks_and_no_doubly_owned_pixels(jitter):
    """jitter 0 puts corners and edges exactly on pixel centres."""
    n = 21
    rng = np.random.default_rng(5)
    camera = Camera((1.0, 1.0), (0.0, 0.0), 24, 24)
    gy, gx = np.mgrid[:n, :n] + 1.5
    inner = (gx > 1.5) & (gx < n + 0.5) & (gy > 1.5) & (gy < n + 0.5)
    gx += inner * rng.uniform(-jitter, jitter, gx.shape)
    gy += inner * rng.uniform(-jitter, jitter, gy.shape)
    vertices = np.stack([gx, gy, np.ones_like(gx)], -1).reshape(-1, 3)
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + n], -1), np.stack([i + 1, i + n + 1, i + n], -1)])
    faces[::3] = faces[::3, ::-1]  # both windings
    count = np.zeros((24, 24), int)
    for face in faces:
        count += silhouette(vertices, face[None], camera)
    want = np.zeros_like(count)
    want[1:n, 1:n] = 1  # top-left: the first row and column of centres belong, the last do not
    np.testing.assert_array_equal(count, want)
    np.testing.assert_array_equal(rasterise(vertices, faces, camera)[0] >= 0, want > 0)


def test_nearest_face_wins_whatever_the_order():
    vertices = np.array([[-1, -1, 2.0], [1, -1, 2], [0, 1, 2], [-1, -1, 1.5], [1, -1, 1.5], [0, 1, 1.5]])
    for faces in (np.array([[0, 1, 2], [3, 4, 5]]), np.array([[3, 4, 5], [0, 1, 2]])):
        face_id, _, depth = rasterise(vertices, faces, CAMERA)
        assert faces[face_id[18, 24]][0] == 3
        assert depth[18, 24] == pytest.approx(1.5)


def test_faces_behind_or_across_the_camera_and_broken_corners_are_left_out():
    vertices, faces = soup(1)
    alone = rasterise(vertices, faces, CAMERA)
    bad = np.array([[0, 0, -1.0], [1, 0, -1], [0, 1, -2], [0, 0, 0], [0, 0, 1e-9], [np.nan, 0, 1], [np.inf, 0, 2]])
    k = len(vertices)
    more = np.array([[k, k + 1, k + 2], [0, 1, k],
                     [0, 1, k + 3], [0, 2, k + 4], [0, 1, k + 5], [0, 1, k + 6], [0, 0, 1]])
    with_bad = rasterise(np.vstack([vertices, bad]), np.vstack([faces, more]), CAMERA)
    for a, b in zip(alone, with_bad, strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(silhouette(np.vstack([vertices, bad]), np.vstack([faces, more]), CAMERA),
                                  alone[0] >= 0)


@pytest.mark.parametrize("seed", range(3))
def test_silhouette_is_where_a_face_is_seen(seed):
    vertices, faces = soup(seed, faces=8)
    mask = silhouette(vertices, faces, CAMERA)
    assert 0 < mask.sum() < mask.size
    np.testing.assert_array_equal(mask, rasterise(vertices, faces, CAMERA)[0] >= 0)


def test_nothing_to_draw_is_an_empty_image():
    face_id, bary, depth = rasterise(np.zeros((0, 3)), np.zeros((0, 3), int), CAMERA)
    assert face_id.shape == depth.shape == (40, 48) and bary.shape == (40, 48, 3)
    assert (face_id == -1).all() and np.isinf(depth).all()


def test_wrong_shapes_and_indices_are_named():
    with pytest.raises(ValueError, match="faces"):
        rasterise(np.zeros((3, 3)), np.array([[0, 1, 3]]), CAMERA)
    with pytest.raises(ValueError, match="vertices"):
        rasterise(np.zeros((3, 2)), np.array([[0, 1, 2]]), CAMERA)


def test_points_are_visible_before_the_surface_and_hidden_behind_it():
    vertices = np.array([[-5, -5, 2.0], [5, -5, 2], [0, 9, 2]])
    depth = rasterise(vertices, np.array([[0, 1, 2]]), CAMERA)[2]
    points = np.array([[0, 0, 1.0], [0, 0, 2.005], [0, 0, 2.5], [0, 0, -1], [9, 0, 1], [np.nan, 0, 1]])
    assert visible_points(points, depth, CAMERA).tolist() == [True, True, False, False, False, False]

"""Frames as training and judging read them."""

import numpy as np
import pytest

from gsac.avatar.camera import Camera
from gsac.avatar.frame_files import read_alpha, read_frame, write_alpha, write_frame
from gsac.stages.train.edge_colour import unmix
from gsac.stages.train.views import View, person_crop, read_views, read_whole

WIDTH, HEIGHT = 90, 160
CAMERA = Camera((200.0, 200.0), (WIDTH / 2, HEIGHT / 2), WIDTH, HEIGHT)


@pytest.fixture
def folders(tmp_path):
    """Frames and masks of a block that moves to the right; nobody is in frame 2, and a haze without a person in frame 3."""
    noise = np.random.default_rng(0)
    for name in ("frames", "alpha"):
        (tmp_path / name).mkdir()
    for t in range(4):
        alpha = np.zeros((HEIGHT, WIDTH), np.float32)
        if t < 2:
            alpha[40:120, 20 + 10 * t:50 + 10 * t] = 1
        if t == 3:
            alpha[:] = 0.05
        write_frame(tmp_path / f"frames/{t:06d}.png", noise.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8))
        write_alpha(tmp_path / f"alpha/{t:06d}.exr", alpha)
    return tmp_path / "frames", tmp_path / "alpha"


def test_frames_to_train_on_are_held_as_crops_of_the_person_that_know_their_whole_frame(folders):
    views, empty = read_views(*folders, CAMERA, 80)
    assert empty == [2, 3] and all(view.frame.height == 80 and view.frame.width == 45 for view in views)
    for t, view in enumerate(views[:2]):
        assert view.pixels.shape[0] < 60 and view.pixels.shape[1] < 36 and view.pixels.nbytes < 45 * 80 * 4 / 2
        assert view.corner[0] + view.camera.center[0] == pytest.approx(22.5) and view.corner == (10 + 5 * t - 7, 20 - 7)
        assert (view.pixels[..., 3] > 0).sum() == 40 * 15, "nothing of the person is lost"
    assert all(views[t].pixels.nbytes == 4 for t in empty), "nobody needs no memory"


def test_a_frame_without_a_mask_shows_nobody(folders):
    (folders[1] / "000001.exr").unlink()
    assert read_views(*folders, CAMERA, 80)[1] == [1, 2, 3]


def test_a_crop_of_a_crop_is_the_same_crop(folders):
    view = read_views(*folders, CAMERA, 160)[0][1]
    again = person_crop(view)
    assert again.corner == view.corner and again.camera == view.camera and again.frame == view.frame
    assert again.pixels.base is view.pixels or again.pixels is view.pixels, "and no copy"


def test_frames_to_judge_by_are_whole_and_as_large_as_their_files_and_no_others_are_read(folders):
    (folders[0] / "000000.png").write_bytes(b"torn")
    views = read_whole(*folders, CAMERA, np.array([3, 1]))
    assert list(views) == [3, 1] and views[1].camera == views[1].frame == CAMERA
    assert views[1].pixels.shape == (HEIGHT, WIDTH, 4) and views[1].corner == (0, 0)
    assert (views[1].pixels[40:120, 30:60, 3] == 255).all() and (views[1].pixels[..., 3] > 0).sum() == 80 * 30


@pytest.mark.parametrize(("thing", "kept"), [
    (np.s_[100:, :], np.s_[40:99, 20:50]),  # furniture
    (np.s_[:, 34:38], np.s_[40:120, [*range(20, 34), *range(38, 50)]]),  # a pole takes less than a cut beside it would
    (np.s_[:, 60:80], np.s_[40:120, 20:50])])  # it stands beside the person
def test_pixels_of_furniture_before_the_person_are_not_trained_on(folders, thing, kept):
    occluder, alpha = np.zeros((HEIGHT, WIDTH)), read_alpha(folders[1] / "000000.exr")
    occluder[thing] = 1
    write_alpha(folders[1] / "000000.exr", np.where(occluder > 0, 0, alpha))
    shown = np.zeros((HEIGHT, WIDTH), bool)
    shown[kept] = True
    for view in (read_views(*folders, CAMERA, None, occluder=occluder)[0][0], read_whole(*folders, CAMERA, [0], occluder)[0]):
        assert (view.pixels[..., 3] > 0).sum() == pytest.approx(shown.sum(), rel=0.05)
        assert view.corner[1] + len(view.pixels) <= 100 or thing != np.s_[100:, :]
        assert view.corner[0] + view.camera.center[0] == pytest.approx(WIDTH / 2) and view.frame == CAMERA


@pytest.mark.parametrize("mixed", [False, True])
def test_a_cut_out_is_that_of_the_whole_frame_wherever_the_person_stands(folders, mixed):
    soft = np.zeros((HEIGHT, WIDTH), np.float32)
    soft[90:, 60:] = np.random.default_rng(1).random((70, 30)) ** 0.2
    write_alpha(folders[1] / "000000.exr", soft)
    view = read_views(*folders, CAMERA, None, mixed)[0][0]
    rgb, alpha = read_frame(folders[0] / "000000.png"), read_alpha(folders[1] / "000000.exr")
    whole = np.round(np.dstack([(rgb if mixed else unmix(rgb, alpha)) * alpha[..., None], alpha * 255])).astype(np.uint8)
    (x, y), (h, w) = view.corner, view.pixels.shape[:2]
    np.testing.assert_array_equal(view.pixels, whole[y:y + h, x:x + w])
    assert view.pixels[..., 3].sum(dtype=int) == whole[..., 3].sum(dtype=int)


def test_a_view_is_reduced_by_area_with_its_camera_and_never_enlarged():
    pixels = np.zeros((HEIGHT, WIDTH, 4), np.uint8)
    pixels[::2] = 200
    view = View(CAMERA, pixels, (0, 0))
    small = view.reduced(80)
    assert small.pixels.shape == (80, 45, 4) and (small.pixels == 100).all()
    assert small.camera == CAMERA.scaled(45, 80) == small.frame
    assert view.reduced(160) is view and view.reduced(540) is view

"""Results that end before the clip does."""

import numpy as np
import pytest

from gsac.avatar.artifacts import KEYPOINT_SHAPES, write_arrays
from gsac.avatar.frame_files import write_alpha
from gsac.stages.contract import StageError
from gsac.stages.missing_frames import pair_masks, read_keypoints
from support.artifacts import blank


@pytest.fixture
def keypoints(tmp_path):
    """A file of three frames in which every point is found at (0, 0)."""
    arrays = blank(KEYPOINT_SHAPES, T=3)
    write_arrays(tmp_path / "keypoints.npz", **arrays | {"score": np.ones_like(arrays["score"])})
    return tmp_path / "keypoints.npz"


@pytest.fixture
def alphas(tmp_path):
    """A folder with the masks of frames 0 and 2."""
    for t in (0, 2):
        write_alpha(tmp_path / f"{t:06d}.exr", np.ones((8, 6), np.float32))
    return tmp_path


def test_frames_that_the_file_lacks_have_no_points_and_are_named(keypoints):
    arrays, lacking = read_keypoints(keypoints, 5)
    assert lacking.tolist() == [False, False, False, True, True]
    assert all(len(arrays[name]) == 5 for name, shape in KEYPOINT_SHAPES.items() if shape[:1] == ("T",))
    assert (arrays["score"][:3] == 1).all() and not arrays["score"][3:].any() and not arrays["pose33"][3:].any()
    assert all(np.isnan(arrays[name][3:]).all() for name in ("xy", "world", "face_mesh"))


@pytest.mark.parametrize("frames", [3, None])
def test_a_file_of_all_frames_is_read_as_it_is(keypoints, frames):
    arrays, lacking = read_keypoints(keypoints, frames)
    assert not lacking.any() and len(lacking) == len(arrays["xy"]) == 3


def test_a_file_of_more_frames_is_another_clips(keypoints):
    with pytest.raises(StageError, match=r"keypoints.npz holds 3 frames, and the clip has 2; run keypoints again"):
        read_keypoints(keypoints, 2)


def test_a_file_of_no_frame_is_refused(tmp_path):
    write_arrays(tmp_path / "keypoints.npz", **blank(KEYPOINT_SHAPES, T=0))
    with pytest.raises(StageError, match=r"keypoints.npz holds 0 frames"):
        read_keypoints(tmp_path / "keypoints.npz", 2)


def test_each_frame_gets_the_mask_of_its_name(alphas):
    found = pair_masks(["000000", "000001", "000002"], alphas)
    assert [path and path.name for path in found] == ["000000.exr", None, "000002.exr"]


def test_a_mask_of_no_frame_is_another_clips(alphas):
    with pytest.raises(StageError, match=r"000002.exr is the mask of none of the clip's 2 frames; run segment again"):
        pair_masks(["000000", "000001"], alphas)


def test_no_mask_at_all_is_refused(tmp_path):
    with pytest.raises(StageError, match="holds no mask; run segment again"):
        pair_masks(["000000"], tmp_path)

"""Artifact files: what is damaged is named, and looking at them costs nothing before it is done."""

import subprocess
import sys

import numpy as np
import pytest

from gsac.avatar.artifacts import KEYPOINT_SHAPES, ArtifactError, check_arrays, check_keypoints, read_arrays, write_arrays
from gsac.avatar.frame_files import read_alpha, read_frame, write_alpha, write_frame
from support.artifacts import blank


@pytest.mark.parametrize("damage", ["cut", "empty", "flipped", "text"])
def test_a_damaged_npz_is_named(tmp_path, damage):
    path = tmp_path / "body.npz"
    write_arrays(path, betas=np.arange(5000, dtype=np.float32))
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 0xFF
    path.write_bytes({"cut": whole[: len(whole) // 2], "empty": b"", "flipped": whole, "text": b"hello"}[damage])
    with pytest.raises(ArtifactError, match="body.npz"):
        read_arrays(path)


def test_an_array_of_another_length_is_named_with_both(tmp_path):
    write_arrays(tmp_path / "body.npz", transl=np.zeros((3, 3)), jaw=np.zeros((4, 3)))
    with pytest.raises(ArtifactError, match=r"jaw has shape \(4, 3\), expected \(3, 3\)"):
        check_arrays(tmp_path / "body.npz", {"transl": ("T", 3), "jaw": ("T", 3)})


def test_declaring_the_stages_imports_nothing_heavy():
    script = ("import sys, importlib\n"
              "for name in 'split keypoints handgap segment face smplx train export'.split():\n"
              "    importlib.import_module('gsac.stages.' + name)\n"
              "print(*sorted({'numpy', 'cv2', 'torch', 'numba', 'scipy', 'av'} & sys.modules.keys()))")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_path_that_is_not_utf8_is_read_as_any_other(tmp_path):
    odd = tmp_path / "a\udcff.png"
    write_frame(tmp_path / "a.png", np.full((4, 5, 3), (1, 2, 3), np.uint8))
    write_alpha(tmp_path / "a.exr", np.full((4, 5), 0.5))
    (tmp_path / "a.png").rename(odd)
    (tmp_path / "a.exr").rename(odd.with_suffix(".exr"))
    assert read_frame(odd)[0, 0].tolist() == [1, 2, 3] and read_alpha(odd.with_suffix(".exr"))[0, 0] == 0.5
    for content in (b"", b"no picture"):
        odd.write_bytes(content)
        with pytest.raises(ArtifactError, match="cannot be read as an image"):
            read_frame(odd)


def test_a_point_that_lies_nowhere_counts_as_unseen(tmp_path):
    arrays = blank(KEYPOINT_SHAPES, T=2)
    path = tmp_path / "keypoints.npz"
    arrays["score"][0, 6:8] = 0.5
    for bad in (np.nan, np.inf):
        arrays["xy"][0, 7, 1] = bad
        write_arrays(path, **arrays)
        read = check_keypoints(path)
        assert np.flatnonzero(read["score"][0]).tolist() == [6] and np.isnan(read["xy"][0, 7]).all()

"""The first frames of an artifact are a whole artifact of their own."""

import json

import numpy as np
import pytest

from gsac.avatar.artifacts import BODY_SHAPES, Clip, frame_paths, read_arrays, write_arrays
from gsac.avatar.frame_files import write_alpha, write_frame
from gsac.avatar.frame_range import copy_frames, count_frames
from support.artifacts import blank


@pytest.fixture
def frames(tmp_path):
    folder = tmp_path / "frames"
    (folder / "masks").mkdir(parents=True)
    for t in range(4):
        write_frame(folder / f"{t:06d}.png", np.zeros((4, 5, 3), np.uint8))
        write_alpha(folder / "masks" / f"{t:06d}.exr", np.zeros((4, 5)))
    write_frame(folder / "plate.png", np.ones((4, 5, 3), np.uint8))
    folder.joinpath("000000.png").chmod(0o444)
    return folder


def test_the_users_masks_and_the_empty_scene_come_along_with_the_first_frames(frames, tmp_path):
    copy_frames(frames, tmp_path / "out", 2)
    assert count_frames(tmp_path / "out") == 2 and len(frame_paths(tmp_path / "out" / "masks")) == 2
    assert (tmp_path / "out" / "plate.png").read_bytes() == (frames / "plate.png").read_bytes()


def test_a_whole_copy_is_the_same_and_may_be_written_to(frames, tmp_path):
    copy_frames(frames, tmp_path / "out")
    assert count_frames(tmp_path / "out") == 4 and (tmp_path / "out" / "masks").is_dir()
    assert (tmp_path / "out" / "000000.png").stat().st_mode & 0o200


def test_arrays_with_a_row_a_frame_are_cut_and_no_others(tmp_path):
    write_arrays(tmp_path / "body.npz", **blank(BODY_SHAPES, T=55))
    copy_frames(tmp_path / "body.npz", tmp_path / "out" / "body.npz", 2)
    shapes = {name: array.shape for name, array in read_arrays(tmp_path / "out" / "body.npz").items()}
    assert shapes["joints"] == (2, 55, 3) and shapes["transl"] == (2, 3) and shapes["joint_offset"] == (55, 3)
    assert count_frames(tmp_path / "out" / "body.npz") == 2


def test_clip_json_keeps_the_times_and_repeats_of_the_frames_that_stay(tmp_path):
    Clip(10.0, [0.0, 0.1, 0.2, 0.3], 5, 4, None, "0" * 64, repeated=[1, 3]).write(tmp_path / "clip.json")
    copy_frames(tmp_path / "clip.json", tmp_path / "out" / "clip.json", 2)
    cut = json.loads((tmp_path / "out" / "clip.json").read_text())
    assert cut["timestamps_s"] == [0.0, 0.1] and cut["repeated"] == [1]
    assert count_frames(tmp_path / "out" / "clip.json") == 2

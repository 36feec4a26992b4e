"""Fixtures of the first frames replay too, and what was cut speaks of the same frames."""

import json
import shlex

import numpy as np
import pytest

from gsac.avatar.artifacts import Clip, frame_paths, read_arrays
from gsac.avatar.frame_range import count_frames

pytestmark = pytest.mark.slow
CUT = 5


@pytest.fixture(scope="module")
def cut(small_run):
    folder = small_run.root / "cut"
    done = small_run.gsac("fixtures", small_run.out, "--out", folder, "--frames", CUT, "--json")
    assert done.code == 0, done.err
    return folder


def test_cut_fixtures_are_real_files_of_the_first_frames_in_all_artifacts(small_run, cut):
    inputs = json.loads((cut / "manifest.json").read_text())["inputs"]
    assert inputs.keys() == small_run.manifest["inputs"].keys()
    assert not [path for path in cut.rglob("*") if path.is_symlink()]
    counts = {port: count_frames(cut / port) for port in inputs if port != "clip"}
    assert counts == dict.fromkeys(counts, CUT) | {"train/avatar.npz": None}
    for port in inputs:
        if port.endswith(".npz"):
            whole = read_arrays(small_run.out / port)
            for name, array in read_arrays(cut / port).items():
                np.testing.assert_array_equal(array, whole[name][:len(array)] if array.ndim else whole[name])
    assert Clip.read(cut / "split/clip.json").timestamps_s == Clip.read(small_run.out / "split/clip.json").timestamps_s[:CUT]
    assert [path.name for path in frame_paths(cut / "segment/alpha")] == [f"{t:06d}.exr" for t in range(CUT)]


@pytest.mark.parametrize("name", ["keypoints", "handgap", "segment", "face", "smplx", "train", "export"])
def test_a_stage_replays_from_cut_fixtures(small_run, cut, name):
    stages = json.loads((cut / "manifest.json").read_text())["stages"]
    assert stages[name]["outputs"] is None and stages["split"]["outputs"] is not None
    done = small_run.gsac(*shlex.split(stages[name]["command"])[1:], cwd=cut)
    assert done.code == 0 and done.statuses == {name: "ran"}, done.err


def test_more_frames_than_the_run_has_are_refused(small_run, tmp_path):
    done = small_run.gsac("fixtures", small_run.out, "--out", tmp_path / "more", "--frames", 9)
    assert done.code == 2 and "--frames 9: the run has 8 frames" in done.err and not (tmp_path / "more").exists()

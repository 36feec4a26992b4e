"""The stage with poses that the user brought: by each method, and what it says of a file that does not fit."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar.body import Body, BodyParams
from gsac.stages.contract import BadInput, Job
from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.paper import fit as paper
from gsac.stages.smplx.stage import run
from gsac.stages.smplx.warmup import FOCAL, FRAMES, TURN, write_inputs


@pytest.fixture(scope="module")
def inputs(tmp_path_factory, body: Body):
    return write_inputs(body, tmp_path_factory.mktemp("inputs"))


def poses(folder, frames=FRAMES):
    """The turning person of the inputs, as WHAM tells it."""
    pose = np.zeros((frames, 72))
    for t in range(frames):
        pose[t, :3] = np.pi * np.array([np.cos(t * TURN / 2), 0, np.sin(t * TURN / 2)])
    np.savez(folder / "poses.npz", pose=pose, trans=np.tile([0, 0, 9.0], (frames, 1)))
    return folder / "poses.npz"


def fit(inputs, folder, file, method):
    said = []
    (folder / "out").mkdir()
    run(Job(inputs, folder / "out", SmplxConfig(method=method, start="poses", focal_px=FOCAL), {"poses": file}, warn=said.append))
    return BodyParams.read(folder / "out" / "body.npz"), said


def test_brought_poses_become_body_npz_in_a_place_of_this_camera(inputs, tmp_path):
    found, said = fit(inputs, tmp_path, poses(tmp_path), "brought")
    assert np.abs(found.body_pose).max() < 1e-5
    np.testing.assert_allclose(found.transl[:, 2], 2.4, atol=0.02)
    assert not found.lost.any() and not {Code.START_DOUBTED, Code.PAPER_START} & {f.code for f in said}


def test_the_papers_fit_starts_from_brought_poses_and_no_longer_says_that_it_does_not(inputs, tmp_path, monkeypatch):
    tiny = (paper.Pass(3, 0.001, (), 1, True), paper.Pass(2, 0.001, (), 0, False))
    monkeypatch.setattr(paper.fit_clip, "__defaults__", (tiny,))
    found, said = fit(inputs, tmp_path, poses(tmp_path), "paper")
    assert np.abs(found.body_pose).max() < 0.05, "arms do not hang as in the closed form"
    assert Code.PAPER_START not in {f.code for f in said}


def test_poses_of_another_number_of_frames_are_named_with_their_parameter(inputs, tmp_path):
    with pytest.raises(BadInput, match=f"smplx.start is poses: .*holds 4 frames, but the clip has {FRAMES}"):
        fit(inputs, tmp_path, poses(tmp_path, 4), "lm")

"""What the stage says of masks that do not lie where the points have the person."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar.artifacts import check_filled_keypoints, frame_paths, write_arrays
from gsac.avatar.body import Body
from gsac.avatar.frame_files import read_alpha, write_alpha
from gsac.stages.contract import Job
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.stage import run
from gsac.stages.smplx.warmup import FOCAL, write_inputs


@pytest.fixture
def inputs(tmp_path, body: Body):
    return write_inputs(body, tmp_path)


def said(inputs, out) -> dict[Code, Finding]:
    found: list[Finding] = []
    out.mkdir()
    run(Job(inputs, out, SmplxConfig(focal_px=FOCAL), warn=found.append))
    return {finding.code: finding for finding in found}


def test_masks_that_lie_beside_the_person_are_named_and_neither_clothes_nor_things_before_it_are_blamed(inputs, tmp_path):
    assert Code.MASK_BESIDE not in said(inputs, tmp_path / "right")
    masks = frame_paths(inputs["segment/alpha"])
    for mask in masks:
        alpha = read_alpha(mask)
        write_alpha(mask, np.roll(alpha, alpha.shape[1] // 4, 1))
    found = said(inputs, tmp_path / "shifted")
    told = found[Code.MASK_BESIDE]
    assert told.frames == [[0, len(masks) - 1]] and "white where the person is" in told.message
    assert not {Code.POORLY_COVERED, Code.CLOTHES_HIDE_SHAPE, Code.PART_HIDDEN} & found.keys()


def test_what_is_left_of_a_person_who_leaves_the_picture_is_no_mask_beside(inputs, tmp_path):
    for mask in frame_paths(inputs["segment/alpha"])[4:]:
        alpha = read_alpha(mask)
        alpha[:, alpha.shape[1] // 3:] = 0
        write_alpha(mask, alpha)
    assert Code.MASK_BESIDE not in said(inputs, tmp_path / "out")


def test_of_a_frame_of_nobody_the_missing_mask_is_not_told(inputs, tmp_path):
    points = check_filled_keypoints(inputs["handgap/keypoints.npz"])
    points["score"][2] = 0
    write_arrays(inputs["handgap/keypoints.npz"], **points)
    masks = frame_paths(inputs["segment/alpha"])
    masks[2].unlink()
    assert Code.MASK_MISSING not in said(inputs, tmp_path / "nobody")
    masks[3].unlink()
    assert said(inputs, tmp_path / "somebody")[Code.MASK_MISSING].frames == [[3, 3]]

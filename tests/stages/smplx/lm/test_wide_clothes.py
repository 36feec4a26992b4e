"""Clothes that hide the figure."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from gsac.avatar.artifacts import write_alpha
from gsac.avatar.zbuffer import silhouette
from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.wide_clothes import STRANGE, fit_under_clothes, measure_strangeness
from gsac.stages.smplx.silhouette import read_outline
from gsac.stages.smplx.state import to_params
from support.turning_person import HEIGHT, WIDTH, height_of, joint_error_mm, sightings_of, turning_person

FRAMES = 8


def dressed_outlines(body, truth, folder, px):
    """Outlines of a person whose clothes hang px away from the legs, (T,) of them; 0: bare."""
    out = []
    for t in range(truth.frames):
        vertices, joints = body.posed(truth, [t])
        camera = truth.camera(WIDTH, HEIGHT)
        alpha = silhouette(vertices[0], body.faces, camera).astype(np.float32)
        hips, ankles = (camera.project(joints[0, [a, b]]).mean(0) for a, b in ((1, 2), (7, 8)))
        if px:
            skirt = np.array([hips - (px / 2, 30), hips + (px / 2, -30), ankles + (px, -60), ankles - (px, 60)])
            cv2.fillPoly(alpha, [skirt.round().astype(np.int32)], 1.0)
        write_alpha(folder / f"{t:06d}.exr", alpha)
        out.append(read_outline(folder / f"{t:06d}.exr"))
    return out


def fit_dressed(body, folder, px):
    """The fit of such a person, and its mean joint error, mm."""
    truth = turning_person(body, FRAMES)
    config = replace(SmplxConfig(), height_m=height_of(body, truth))
    with threadpool_limits(1, "blas"):
        fit = fit_under_clothes(body, sightings_of(body, truth, noise=1.0), dressed_outlines(body, truth, folder, px), config,
                                lambda *a: None)
    return fit, joint_error_mm(body, to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2])), truth).mean()


def test_a_skirt_too_wide_for_any_figure_leaves_the_joints_to_the_key_points_and_is_named(body, tmp_path):
    fit, error = fit_dressed(body, tmp_path, px=90)
    (note,) = [note for note in fit.notes if note.code is Code.CLOTHES_HIDE_SHAPE]
    assert note.figure > STRANGE > measure_strangeness(body, fit.state.betas) and error < 40


def test_a_bare_figure_is_believed(body, tmp_path):
    fit, _ = fit_dressed(body, tmp_path, px=0)
    assert Code.CLOTHES_HIDE_SHAPE not in [note.code for note in fit.notes]

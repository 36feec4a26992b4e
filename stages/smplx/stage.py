"""Reads the artifacts, fits the body, warns where the fit is not to be trusted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from gsac.avatar.artifacts import Clip, check_face, check_filled_keypoints, frame_paths
from gsac.avatar.body import LOST, Body, BodyParams
from gsac.stages.body_choice import load_body
from gsac.stages.contract import Job, StageError
from gsac.stages.findings import Code, Finding
from gsac.stages.missing_frames import pair_masks
from gsac.stages.person_seen import find_seen
from gsac.stages.smplx.config import Method, SmplxConfig
from gsac.stages.smplx.detector_errors import find_errors
from gsac.stages.smplx.expression import translate_expression, translate_rest
from gsac.stages.smplx.flame_motion import read_shared
from gsac.stages.smplx.hidden import describe_hidden, find_occluder, hide, leave_out_outside
from gsac.stages.smplx.lm.hidden_arms import describe_arms
from gsac.stages.smplx.lm.misleading_outlines import fit_unmisled
from gsac.stages.smplx.lost_frames import describe_lost_frames, find_beside, find_lost_frames, notes_that_hold, refuse_lost
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.silhouette import Outline, read_outlines
from gsac.stages.smplx.start.bring import bring_start
from gsac.stages.smplx.start.fit import take_as_fit
from gsac.stages.smplx.state import Fit, to_params
from gsac.stages.smplx.warmup import rehearse
from gsac.stages.turn_pace import pace

FitClip = Callable[[Body, Sightings, list[Outline], SmplxConfig, Callable[[int, int, str], None]], Fit]
"""Fits the clip: body, what was seen, the outlines, parameters, progress."""


def fit_as_published(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig,
                     progress: Callable[[int, int, str], None]) -> Fit:
    """The paper's fit, imported only when chosen: torch takes seconds to load."""
    from gsac.stages.smplx.paper import fit

    return fit.fit_clip(body, sightings, outlines, config, progress)


FOCAL = 0.6, 3.0
"""Focal lengths of phones' lenses over the longer side of the picture; the main ones' are 0.8 to 1.1, of three times zoom 3."""
KEPT = 0.05
"""Relative difference up to which the fit has a given focal length: its prior is 0.2 % wide."""
METHODS: dict[Method, FitClip] = {"lm": fit_unmisled, "paper": fit_as_published, "brought": take_as_fit}
"""smplx.method -> fit."""
BETAS: dict[Method, int] = {"lm": 20, "paper": 100}
"""Leading betas that a method solves: later ones have a small variance, which one clip cannot determine, and the paper's fit has as
many. `brought` takes all that the file has."""


def run(job: Job) -> None:
    """Writes body.npz."""
    clip = Clip.read(job.inputs["split/clip.json"])
    points = check_filled_keypoints(job.inputs["handgap/keypoints.npz"])
    face = check_face(job.inputs["face/face.npz"])
    body = load_body(job, "smplx")
    shared = read_shared(job, body)
    times = None if clip.timestamps_s is None else pace(np.array(clip.timestamps_s), points["world"])
    sightings = Sightings(points["xy"], points["score"], points["sigma"], points["world"], times, clip.width, clip.height,
                          clip.focal_px, find_errors(job, body, str(points["detector"])), face, points["missing"],
                          clip.principal_point, clip.longer_side)
    seen = find_seen(points["score"], points["filled"])
    if not seen.any():
        raise StageError("no frame shows four body points; the clip needs one whole person in view")
    masks = pair_masks([path.stem for path in frame_paths(job.inputs["split/frames"])], job.inputs["segment/alpha"])
    if len(masks) != len(sightings.xy):
        raise StageError(f"{len(masks)} frames but {len(sightings.xy)} of key points; run handgap again")
    if (unmasked := seen & np.array([mask is None for mask in masks])).any():
        job.warn(Finding.of(Code.MASK_MISSING, unmasked))
    outlines = read_outlines(masks, clip.height, clip.width)
    own = clip.shows_own_moment(len(outlines))
    if (beside := find_beside(outlines, points, seen & own)).any():
        job.warn(Finding.of(Code.MASK_BESIDE, beside))
    outlines = [outline if shown else replace(outline, area=0.0) for outline, shown in zip(outlines, own, strict=True)]
    sightings = replace(sightings, start=bring_start(job, body, sightings, outlines))
    sightings = leave_out_outside(sightings)
    occluder, hidden = find_occluder(sightings, outlines), []
    if occluder is not None:
        outlines = [replace(outline, hidden=occluder) for outline in outlines]
        sightings, behind = hide(sightings, occluder, outlines[0].scale)
        hidden = describe_hidden(behind)
    with threadpool_limits(1, "blas"):  # blocks of 140 x 140: threads cost more than they give
        shaped = body.leading(BETAS.get(job.config.method, body.num_betas))
        fit = METHODS[job.config.method](shaped, sightings, outlines, job.config, job.progress)
    expression, jaw, silent = translate_expression(body, fit.state.betas, face, shared)
    if silent is not None:
        job.warn(silent)
    params = to_params(body, fit.state, sightings.center, expression, fit.joint_offset)
    params.jaw_pose, params.rest_expression = jaw, translate_rest(body, face)
    params.occluder = occluder
    params.joints = body.posed_joints(params)
    params.sigma_joints = fit.sigma_joints.astype(np.float32)
    lost = find_lost_frames(fit, seen, sightings.person_height, own)
    refuse_lost(lost)
    fitted = ~np.any(list(lost.values()), axis=0)
    params.sigma_joints[~fitted] = LOST
    for finding in (*notes_that_hold((*fit.notes, *describe_arms(fit.arms, fitted), *hidden), beside, seen & own),
                    *describe_lost_frames(lost, fit, beside)):
        job.warn(finding)
    if (doubt := doubt_focal(job.config, clip, float(params.focal[0]))) is not None:
        job.warn(doubt)
    if guesses := describe_guesses(job.config, params, clip):
        job.note(guesses)
    params.write(job.out / "body.npz")


def warm(device: str) -> None:
    """Compiles and imports what a run needs, while an earlier stage is at work."""
    rehearse(run)


def doubt_focal(config: SmplxConfig, clip: Clip, believed: float) -> Finding | None:
    """A given focal length that the pictures contradict, or that no phone's lens has; None where it is plausible, or not given.

    believed: px, as the fit has it.
    """
    given = config.focal_px or clip.focal_px
    if not given:
        return None
    if abs(believed / given - 1) > KEPT:
        return Finding.of(Code.FOCAL_NOT_BELIEVED, figure=believed, given=given)
    ratio = given / clip.longer_side
    return None if FOCAL[0] <= ratio <= FOCAL[1] else Finding.of(Code.ODD_FOCAL, figure=ratio, given=given)


def describe_guesses(config: SmplxConfig, params: BodyParams, clip: Clip) -> str:
    """One sentence on what of height and focal length was guessed and how to fix it; empty where both are known."""
    found = []
    if config.height_m is None:
        found.append("the person's height from the shape prior (`--height 1.78`, smplx.height_m, fixes it, and proportions follow)")
    if not clip.focal_px and not config.focal_px:
        found.append(f"the focal length, {params.focal[0]:.0f} px, from the points (smplx.focal_px)")
    return f"Estimated: {' and '.join(found)}." if found else ""

"""Reads the artifacts, fits the body, says where the fit is not to be trusted."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from threadpoolctl import threadpool_limits

from gsac.avatar.artifacts import Clip, check_face, check_filled_keypoints, frame_paths
from gsac.avatar.body import LOST
from gsac.stages.body_choice import load_body
from gsac.stages.contract import Job, StageError
from gsac.stages.smplx.expression import mimic
from gsac.stages.smplx.fit import THREADS, Sightings, fit_clip, to_params
from gsac.stages.smplx.lost_frames import lost_frames, sentences
from gsac.stages.smplx.silhouette import read_outline
from gsac.stages.smplx.warmup import rehearse


def published(*clip):
    """The paper's fit; torch takes seconds to load, so only who asks for it does."""
    from gsac.stages.smplx.paper.fit import fit_clip as fit_as_published

    return fit_as_published(*clip)


METHODS = {"lm": fit_clip, "paper": published}
"""smplx.method -> (body, sightings, outlines, config, progress) -> Fit."""


def run(job: Job) -> None:
    clip = Clip.read(job.inputs["split/clip.json"])
    points = check_filled_keypoints(job.inputs["handgap/keypoints.npz"])
    face = check_face(job.inputs["face/face.npz"])
    body = load_body(job, "smplx")
    sightings = Sightings(points["xy"], points["score"], points["sigma"], points["world"],
                          None if clip.timestamps_s is None else np.array(clip.timestamps_s), clip.width, clip.height,
                          clip.focal_px, str(points["detector"]), face)
    seen = (points["score"][:, :17] > 0.2).sum(1) >= 4
    if not seen.any():
        raise StageError("no frame shows four body points; the clip needs one whole person in view")
    with ThreadPoolExecutor(THREADS) as pool:
        outlines = list(pool.map(read_outline, frame_paths(job.inputs["segment/alpha"])))
    if len(outlines) != len(sightings.xy):
        raise StageError(f"{len(outlines)} alpha images but {len(sightings.xy)} frames of key points")
    with threadpool_limits(1, "blas"):  # blocks of 140 x 140: threads cost more than they give
        fit = METHODS[job.config.method](body, sightings, outlines, job.config, job.progress)
    expression, jaw, silent = mimic(body, face)
    if silent:
        job.warn(silent)
    params = to_params(body, fit.state, np.array([clip.width / 2, clip.height / 2]), expression)
    params.jaw_pose = jaw
    if fit.joint_offset is not None:
        params.joint_offset = fit.joint_offset.astype(np.float32)
    params.joints = body.posed_joints(params)
    params.sigma_joints = fit.sigma_joints.astype(np.float32)
    lost = lost_frames(fit, seen, sightings.person_height)
    params.sigma_joints[np.any(list(lost.values()), axis=0)] = LOST
    for sentence in (*fit.notes, *sentences(lost, fit.iou)):
        job.warn(sentence)
    warn(job, params, clip)
    params.write(job.out / "body.npz")


def warm(device: str) -> None:
    """Called while a stage before is at work."""
    rehearse(run)


def warn(job: Job, params, clip: Clip) -> None:
    """Says what one camera left open."""
    if not clip.focal_px and not job.config.focal_px:
        job.warn(f"The clip carries no focal length; estimated {params.focal[0]:.0f} px (set smplx.focal_px to fix it).")
    if job.config.height_m is None:
        job.warn("One camera cannot see scale; the person's height comes from the shape prior (set smplx.height_m).")

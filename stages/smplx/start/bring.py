"""Reads the poses that `smplx.start` names, for the body at hand, or asks the network that it names."""

from __future__ import annotations

import zipfile
from dataclasses import replace

from gsac.avatar.artifacts import frame_paths
from gsac.avatar.body import Body
from gsac.avatar.instant_hmr import InstantHmr
from gsac.avatar.onnx_network import NetworkError
from gsac.avatar.pose_files.read import Start, read_start
from gsac.stages.body_choice import OPEN
from gsac.stages.brought_file import NONE, read_brought
from gsac.stages.contract import BadInput, Job
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.silhouette import Outline
from gsac.stages.smplx.start.network import look


def bring_start(job: Job, body: Body, sightings: Sightings, outlines: list[Outline]) -> Start | None:
    """The poses on the clip's frames; None without `smplx.start`. Raises BadInput. outlines: of the T frames.

    Fingers are added to the body's mean hands. The open body has shapes of its own and no mean hand: a file's betas are left out,
    and its fingers bend from straight ones.
    """
    if job.config.start == NONE:
        return None
    if not zipfile.is_zipfile(job.models[job.config.start]):
        return look(_open(job), body, frame_paths(job.inputs["split/frames"]), outlines, sightings, job.progress)
    own, frames = job.config.body_model == OPEN, len(outlines)
    start = read_brought(job, "smplx", "start", lambda path: read_start(path, frames, body.hand_means, body.hand_components))
    return replace(start, betas=None) if own else start


def _open(job: Job) -> InstantHmr:
    name = job.config.start
    try:
        return InstantHmr(job.models[name], name)
    except NetworkError as error:
        raise BadInput(f"smplx.start is {name}: neither a file of poses, nor InstantHMR's network: {error}") from error

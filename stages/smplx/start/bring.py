"""Reads the poses that `smplx.start` names, for the body at hand."""

from __future__ import annotations

from dataclasses import replace

from gsac.avatar.body import Body
from gsac.avatar.pose_files.read import Start, read_start
from gsac.stages.body_choice import OPEN
from gsac.stages.brought_file import NONE, read_brought
from gsac.stages.contract import Job


def bring_start(job: Job, body: Body, frames: int) -> Start | None:
    """The poses on the clip's frames, T of them; None without `smplx.start`. Raises BadInput.

    Fingers are added to the body's mean hands. The open body has shapes of its own and no mean hand: a file's betas are left out,
    and its fingers bend from straight ones.
    """
    if job.config.start == NONE:
        return None
    own = job.config.body_model == OPEN
    start = read_brought(job, "smplx", "start", lambda path: read_start(path, frames, body.hand_means, body.hand_components))
    return replace(start, betas=None) if own else start

"""The published co-registration (GSAC eq. 5-8, after ExAvatar's fitting): key points, initial values, face and regularisers,
all means, by Adam in three passes over batches of frames. It is the baseline of `lm`.

As published: the first 100 steps by the key points alone, roots and places only; both key point terms, with and without the face
offsets; betas from zero; the start's mesh at the betas of the step, so that L_init holds the pose alone. The face offsets are
dropped at the end, as GSAC drops them when it converts the fit: body.npz has none.

It deviates from the publication in this. Without `smplx.start` the start is the closed form of initial.py (the paper regresses it
by Hand4Whole). The head of the face terms is that of face.npz, FLAME's or the open body's own (head.py), and is not itself fitted
here: ExAvatar's terms of FLAME's key points, pose, shape and expression, and its warm-up of FLAME's root, are left out. So is the
neck, which the head mesh has not, and its offsets' weight of 1000. There are no offsets of the locators, which only supervise the
hips. L_face is weighted by the share of frames that show the face, as the paper says; ExAvatar's code weights it by 1. The
Laplacian's weight is the paper's 10,000, not the code's 100,000, and it goes over all neighbours of a vertex, not the first ten.
Means over key points go over those that the body carries; clothes move none of them. Every step poses all vertices twice.

The published method knows no sigma of its joints: sigma_joints comes from `lm`'s normal equations, the one import of lm/.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch

from gsac.avatar.body import Body
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.joint_sigma import estimate_sigma
from gsac.stages.smplx.paper.loss import Objective, Unknowns
from gsac.stages.smplx.paper.smooth import smooth_linear, smooth_rotations
from gsac.stages.smplx.sightings import BODY_POINTS, Sightings, focal_prior
from gsac.stages.smplx.silhouette import Outline, sample_outlines
from gsac.stages.smplx.start.begin import begin
from gsac.stages.smplx.state import Fit, State, to_params

BATCH = 64
HAND_OFFSET, HAND_OFFSET_STEPS = 10.0, 250
"""Factor on the weight of the hands' joint offsets, and the steps of the first pass that it lasts."""


@dataclass(frozen=True)
class Pass:
    """One sweep over the batches."""

    steps: int
    rate: float
    decays: tuple[int, ...]
    """Steps at which the rate falls to a tenth."""
    warm_up: int
    """Steps at first in which only roots and places move, by the key points alone."""
    shared: bool
    """Whether betas and joint offsets move."""


PASSES = (Pass(500, 0.1, (100, 250, 400), 100, True), Pass(250, 0.01, (100, 200), 0, True), Pass(250, 0.01, (100, 200), 0, False))


def fit_clip(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig,
             progress: Callable[[int, int, str], None], passes: tuple[Pass, ...] = PASSES) -> Fit:
    """Fits the clip by the published method; the focal length stays as given or guessed."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # matrices of 3 x 3: threads cost more than they give
    try:
        return _fit(body, sightings, outlines, config, progress, passes)
    finally:
        torch.set_num_threads(threads)


def _fit(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig,
         progress: Callable[[int, int, str], None], passes: tuple[Pass, ...]) -> Fit:
    center = sightings.center
    start, said = begin(body, sightings, focal_prior(sightings, config)[0], center)
    objective = Objective(body, sightings, start, center)
    unknowns = objective.unknowns(start.transl)
    frames = len(sightings.xy)
    batches = [slice(a, min(a + BATCH, frames)) for a in range(0, frames, BATCH)]
    total, done = sum(p.steps for p in passes) * len(batches), 0
    for i, sweep in enumerate(passes):
        for batch in batches:
            descend(objective, unknowns, batch, sweep, i == 0, lambda n, before=done: progress(before + n, total, "steps"))
            done += sweep.steps
    local, transl, betas, joint_offset = unknowns.read()
    if sightings.seconds is not None:
        local, transl = smooth_rotations(local), smooth_linear(transl)
    state = State(local, transl, betas, start.log_focal, np.zeros(0))
    notes = said if sightings.start is not None else (Finding.of(Code.PAPER_START),)
    if objective.head is None:
        notes += (Finding.of(Code.PAPER_NO_HEAD),)
    params = to_params(body, state, center, joint_offset=joint_offset)
    iou = sample_outlines(body, params, sightings.width, sightings.height, outlines)[1]
    return Fit(state, estimate_sigma(body, sightings, state, config, center), iou,
               measure_reprojection(objective, sightings, state, joint_offset), total, joint_offset, notes)


def descend(objective: Objective, unknowns: Unknowns, batch: slice, sweep: Pass, hold_hands: bool,
            tell: Callable[[int], None]) -> None:
    """Takes one batch through one pass. Adam starts anew after the warm-up and at each pass, as published.

    hold_hands: whether the hands' joint offsets weigh more at first; tell: called with the number of steps done.
    """
    optimiser = None
    for step in range(sweep.steps):
        if optimiser is None or step == sweep.warm_up:
            optimiser = torch.optim.Adam(list(unknowns.open_batch(batch, step < sweep.warm_up, sweep.shared)))
        optimiser.param_groups[0]["lr"] = sweep.rate * 0.1 ** sum(step >= d for d in sweep.decays)
        optimiser.zero_grad()
        hold = HAND_OFFSET if hold_hands and step < HAND_OFFSET_STEPS else 1.0
        objective.loss(unknowns, batch, hold, step < sweep.warm_up).backward()
        optimiser.step()
        tell(step + 1)


def measure_reprojection(objective: Objective, sightings: Sightings, state: State, joint_offset: np.ndarray) -> np.ndarray:
    """(T,) median distance, px, of seen and fitted body points; NaN where nothing was seen. joint_offset: (55, 3) m."""
    uv = objective.pixels(state.local, state.transl, state.betas, joint_offset)
    use = np.isin(objective.known, BODY_POINTS)
    known = objective.known[use]
    off = np.linalg.norm(uv[:, use] - sightings.xy[:, known], axis=-1)
    seen = sightings.seen[:, known]
    return np.array([np.median(o[s]) if s.any() else np.nan for o, s in zip(off, seen, strict=True)])

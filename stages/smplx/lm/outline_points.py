"""Points of the body's outline that are to meet the mask's."""

from __future__ import annotations

import numpy as np

from gsac.stages.smplx.jacobians import Pairs
from gsac.stages.smplx.lm.problem import Problem
from gsac.stages.smplx.silhouette import sample_outlines
from gsac.stages.smplx.state import State, to_params


def meet_outlines(problem: Problem, state: State) -> tuple[list[Pairs | None], np.ndarray]:
    """`sample_outlines` of the body as it is: outline points of each frame, and the IoU (T,) of body and alpha, NaN without it."""
    assert problem.person_offsets is not None  # only fingers lack them
    params = to_params(problem.body, state, problem.seen.center, joint_offset=problem.person_offsets.joint_offset(state.own))
    return sample_outlines(problem.body, params, *problem.seen.size, problem.seen.outlines)

"""The state from which a fit begins: the poses that the user brought where the pictures bear them out, else the closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gsac.avatar.body import Body
from gsac.avatar.pose_files.read import Start
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.initial import estimate_start, fill_gaps, solve_transl
from gsac.stages.smplx.jacobians import Skeleton, make_pairs, place_points
from gsac.stages.smplx.prior import BODY_JOINTS
from gsac.stages.smplx.sightings import TRUNK, Sightings
from gsac.stages.smplx.state import State

POINTS = np.arange(17)
"""Key points of the body, by which it is placed."""
FEWEST = 3
"""Seen points that place a body."""
NEAREST = 0.3
"""m; a body that is placed closer stands in the camera, or behind it."""
WORSE = 0.02
"""Share of the person's height by which the trunk's points may lie farther off than those of the closed form."""


def begin(body: Body, sightings: Sightings, focal: float, center: np.ndarray) -> tuple[State, tuple[Finding, ...]]:
    """The state, and what the user should know of it. focal: px; center: (2,) px."""
    ours = estimate_start(body, sightings, focal, center)
    if sightings.start is None:
        return ours, ()
    brought = lay_out(sightings.start, ours)
    placed = place(body, sightings, brought, focal, center)
    off, usual = (measure_trunk(body, sightings, state, focal, center) for state in (placed, ours))
    doubted = ~np.isfinite(placed.transl).all(1) | (off > usual + WORSE * sightings.person_height)
    placed.local[doubted], placed.transl[doubted] = ours.local[doubted], ours.transl[doubted]
    return placed, describe(~sightings.start.given, doubted)


def lay_out(start: Start, ours: State) -> State:
    """The brought rotations and betas, interpolated over frames that lack them; of joints that no frame has, and where there are
    no betas, ours."""
    local = ours.local.copy()
    for j in range(local.shape[1]):
        given = np.isfinite(start.rotations[:, j, 0, 0])
        if given.any():
            local[:, j] = fill_gaps([turn if known else None for turn, known in zip(start.rotations[:, j], given, strict=True)])
    betas = ours.betas.copy()
    if start.betas is not None:
        shared = min(len(betas), len(start.betas))
        betas[:shared] = start.betas[:shared]
    return replace(ours, local=local, transl=ours.transl.copy(), betas=betas)


def place(body: Body, sightings: Sightings, state: State, focal: float, center: np.ndarray) -> State:
    """The state with transl (T, 3) solved from the seen body points, for a file's own was found with a camera of its own; NaN where
    no place before the camera explains the points. Frames with few points are interpolated.

    focal: px; center: (2,) px.
    """
    points = locate(body, state)
    frames = len(points)
    transl, few = np.full((frames, 3), np.nan), np.zeros(frames, bool)
    for t in range(frames):
        use = sightings.seen[t, POINTS] & np.isfinite(points[t]).all(-1)
        few[t] = use.sum() < FEWEST
        if not few[t]:
            found = solve_transl(points[t, use], sightings.xy[t, POINTS][use], focal, center)
            if found[2] > NEAREST:
                transl[t] = found
    known = np.isfinite(transl).all(1)
    if known.any():
        for c in range(3):
            transl[few, c] = np.interp(np.flatnonzero(few), np.flatnonzero(known), transl[known, c])
    return replace(state, transl=transl)


def locate(body: Body, state: State) -> np.ndarray:
    """Body points (T, 17, 3) m of the posed body, without transl; NaN where the body has no such point."""
    chain = Skeleton(body, BODY_JOINTS).pose(state.local, state.betas)
    points = place_points(chain, make_pairs(body, body.keypoint_matrix[POINTS]), state.betas)
    return np.where(body.known_keypoints[POINTS, None], points, np.nan)


def measure_trunk(body: Body, sightings: Sightings, state: State, focal: float, center: np.ndarray) -> np.ndarray:
    """(T,) mean distance, px, of seen and projected trunk; 0 where none was seen. focal: px; center: (2,) px."""
    x = locate(body, state)[:, TRUNK] + state.transl[:, None]
    off = np.linalg.norm(focal * x[..., :2] / x[..., 2:] + center - sightings.xy[:, TRUNK], axis=-1)
    seen = sightings.seen[:, TRUNK]
    return np.where(seen, off, 0).sum(1) / np.maximum(seen.sum(1), 1)


def describe(missing: np.ndarray, doubted: np.ndarray) -> tuple[Finding, ...]:
    """What the user should know. missing: (T,) bool, frames that the file lacks; doubted: (T,) bool, those of the closed form."""
    said = ((Code.START_INTERPOLATED, missing & ~doubted), (Code.START_DOUBTED, doubted))
    return tuple(Finding.of(code, frames, figure=frames.sum()) for code, frames in said if frames.any())

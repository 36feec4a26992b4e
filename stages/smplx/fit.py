"""The Levenberg-Marquardt fit of one clip: start, body, rounds that renew outlines and what is held, fingers."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.threads import available
from gsac.avatar.wholebody import INDEX, LEFT_HAND, RIGHT_HAND
from gsac.avatar.yaw import yaw
from gsac.stages.smplx import initial
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector import Detector
from gsac.stages.smplx.jacobians import pairs_of, positions
from gsac.stages.smplx.lm.ground import Ground
from gsac.stages.smplx.lm.person_offsets import Personal
from gsac.stages.smplx.lm.problem import ROBUST, Observations, Problem, State
from gsac.stages.smplx.lm.solver import levenberg_marquardt
from gsac.stages.smplx.prior import BODY_JOINTS, FINGER_JOINTS
from gsac.stages.smplx.silhouette import Outline, outline_points

HAND_ROOTS = tuple(first + i for first in (91, 112) for i in (0, 1, 5, 9, 13, 17))
"""Hand points that no finger joint moves: they turn the wrist."""
BODY_POINTS = np.array([*range(23), *HAND_ROOTS])
FINGER_POINTS = np.array([i for hand in (LEFT_HAND, RIGHT_HAND) for i in range(hand.start, hand.stop)])
HIPS = (INDEX["left_hip"], INDEX["right_hip"])
TOGETHER = 2.0
"""What a detector gets wrong it gets wrong in many frames together: its spreads count so many times."""
DEPTH_SPREAD = 0.08
"""Metres; the detector's depth decides which way a limb points."""
DEPTH_TRUST = 0.8
"""Metres, once it has decided: its depth leans with the camera, the pictures do not."""
OUTLINE_SPREAD = 0.006
ADULT_HEIGHT = (1.72, 0.02)
"""The stated scale prior, metres and spread: one camera cannot see scale, and clothes make a free scale read people as small."""
FOCAL_GUESS = 0.95
"""Focal length when nothing is known, as a share of the picture's longer side: between a phone's main lens and a tele."""
FOCAL_SPREAD = 0.15
FAR_OFF = 5.0
"""Before the outline counts, points are believed so many times further off: an arm that starts hanging has a long way to go."""
START_STEPS = 4
"""Steps in which the body only turns and moves as a whole, before anything bends."""
VIEW = np.radians(30)
"""Yaw that makes another view of the person."""
THREADS = min(available(), 8)
"""Drawing the body lets go of Python; more threads mostly wait for what does not."""
POSED_AT_ONCE = 64
"""Frames whose vertices are held in memory together."""


@dataclass
class Sightings:
    """Detections of one clip, as `handgap` gives them."""

    xy: np.ndarray  # (T, 133, 2) px
    score: np.ndarray  # (T, 133)
    sigma: np.ndarray  # (T, 133) px
    world: np.ndarray  # (T, 133, 3) m
    seconds: np.ndarray | None
    width: int
    height: int
    focal_px: float | None
    detector: str = ""
    face: dict[str, np.ndarray] | None = None
    """Arrays of face.npz."""

    @property
    def seen(self) -> np.ndarray:
        """(T, 133) bool."""
        return (self.score > 0.2) & np.isfinite(self.xy).all(-1)

    @property
    def person_height(self) -> float:
        """Median height of the person, px, from the body points."""
        extents = [np.ptp(self.xy[t, :23, 1][seen]) for t, seen in enumerate(self.seen[:, :23]) if seen.sum() > 1]
        return float(np.median(extents)) * 1.08 if extents else self.height * 0.8


@dataclass
class Fit:
    """What the fit found."""

    state: State
    sigma_joints: np.ndarray  # (T, 55) m
    iou: np.ndarray  # (T,) body against alpha before the last round; NaN without alpha
    reprojection: np.ndarray  # (T,) median px of the body points
    steps: int
    joint_offset: np.ndarray | None = None  # (55, 3) m, where the method moves joints
    notes: tuple[str, ...] = ()
    """Sentences that the user should read."""


def fit_clip(body: Body, sightings: Sightings, outlines: list[Outline], config: SmplxConfig, progress) -> Fit:
    """Fits all frames at once. T may be 1; temporal terms need 3 frames and timestamps."""
    center = np.array([sightings.width / 2, sightings.height / 2])
    focal, spread = focal_prior(sightings, config)
    detector = Detector.measured(sightings.detector, body)
    personal = Personal.of(body, detector.own, config.joint_offsets)
    moves = np.concatenate([detector.slopes(body), personal.points], 2)
    pairs = pairs_of(body, body.keypoint_matrix[BODY_POINTS], detector.offsets[BODY_POINTS], moves[BODY_POINTS])
    seen = observations(sightings, detector, BODY_POINTS, center, (focal, spread), config, outlines)
    problem = Problem(body, pairs, HIPS, seen, BODY_JOINTS, config.smoothness, 0.0, personal)
    state = replace(starting_state(body, sightings, focal, center), own=np.zeros(len(personal.spread)))
    seen.depth *= scale_of_world(problem, state, sightings)
    seen.repeats = repeats(state.local[:, 0])
    take_off_habits(seen, sightings, detector, BODY_POINTS, state)
    problem.limit = FAR_OFF * ROBUST
    free, all_shared = np.zeros(problem.size, bool), np.zeros(state.shared, bool)
    trunk_only = free.copy()
    trunk_only[3:-3] = True
    state, trace = levenberg_marquardt(state, problem.linearise, problem.cost, problem.move, trunk_only, ~all_shared, START_STEPS)
    take_off_habits(seen, sightings, detector, BODY_POINTS, state)
    state, more = levenberg_marquardt(state, problem.linearise, problem.cost, problem.move, free, all_shared, 3 * config.iterations)
    steps, iou = trace.steps + more.steps, np.full(len(sightings.xy), np.nan)
    problem.outline_weight, problem.limit, seen.depth_spread = config.silhouette, ROBUST, DEPTH_TRUST
    for r in range(config.rounds):
        progress(r, config.rounds + 1, "rounds")
        take_off_habits(seen, sightings, detector, BODY_POINTS, state)
        if config.silhouette > 0:
            iou = renew_outlines(problem, state, sightings)
        state.held = problem.held.learn(state.local[:, problem.active], state.held)
        stand(problem, state, sightings, config)
        all_shared = np.zeros(state.shared, bool)
        state, more = levenberg_marquardt(state, problem.linearise, problem.cost, problem.move, free, all_shared, config.iterations)
        steps += more.steps
    state, more = fit_fingers(sightings, detector, problem, state, config)
    progress(config.rounds + 1, config.rounds + 1, "rounds")
    return Fit(state, joint_spread(problem, state), iou, reprojection(problem, state), steps + more.steps,
               personal.joint_offset(state.own))


def stand(problem: Problem, state: State, sightings: Sightings, config: SmplxConfig) -> None:
    """From the first round on the feet stand on a ground."""
    if problem.ground is None and config.contact > 0:
        problem.ground = Ground(problem.body, config.contact)
        problem.ground.watch(sightings.xy, sightings.seen, sightings.seconds, sightings.person_height)
        chain = problem.skeleton.pose(state.local, state.shape)
        state.level = problem.ground.level(chain, state.shape, state.transl, state.held)


def focal_prior(sightings: Sightings, config: SmplxConfig) -> tuple[float, float]:
    """Focal length px and how sure it is."""
    given = config.focal_px or sightings.focal_px
    if given:
        return given, 0.002
    return FOCAL_GUESS * max(sightings.width, sightings.height), FOCAL_SPREAD


def observations(sightings: Sightings, detector: Detector, points: np.ndarray, center: np.ndarray, focal: tuple[float, float],
                 config: SmplxConfig, outlines: list[Outline]) -> Observations:
    """The chosen points with their spreads: what the detector gets wrong, and more where it or `handgap` is unsure."""
    height = sightings.person_height
    usual = TOGETHER * height * detector.spread
    unsure = np.sqrt(np.maximum(sightings.sigma**2 - sightings.sigma.min(0) ** 2, 0))
    spread = np.hypot(usual, unsure) / np.sqrt(np.clip(sightings.score, 0.2, 1))
    spread = np.where(sightings.seen, spread, np.inf)[:, points]
    return Observations(sightings.xy[:, points].astype(np.float64), spread.astype(np.float64), depths(sightings)[:, points],
                        DEPTH_SPREAD, center, sightings.seconds, focal,
                        (config.height_m, 0.003) if config.height_m else ADULT_HEIGHT, 1.0, outlines, OUTLINE_SPREAD * height)


def depths(sightings: Sightings) -> np.ndarray:
    """(T, 133) m against the middle of the hips, as the detector scales it; NaN where it says nothing, and of hands and face."""
    depth = np.where(sightings.seen, sightings.world[..., 2], np.nan).astype(np.float64)
    depth -= sightings.world[:, HIPS, 2].mean(1)[:, None]
    depth[:, 23:] = np.nan
    return depth


def take_off_habits(seen: Observations, sightings: Sightings, detector: Detector, points: np.ndarray, state: State) -> None:
    """Frees the points of what the detector adds to a body turned as the state is."""
    error = detector.error(yaw(state.local[:, 0]))[:, points]
    seen.xy = sightings.xy[:, points] - error * sightings.person_height


def starting_state(body: Body, sightings: Sightings, focal: float, center: np.ndarray) -> State:
    frames = len(sightings.xy)
    rest = body.keypoints(body.v_template)
    pelvis = body.J_regressor[0] @ body.v_template
    turns = [initial.trunk_turn(rest, sightings.world[t], sightings.xy[t], sightings.seen[t], focal, center) for t in range(frames)]
    turns = initial.fill_gaps(turns)
    local = initial.start_rotations(frames, 55, body.joint_names)
    local[:, 0] = turns
    transl = np.full((frames, 3), np.nan)
    for t in range(frames):
        use = [i for i in initial.TRUNK if sightings.seen[t, i]]
        if len(use) >= 2:
            turned = (rest[use] - pelvis) @ turns[t].T + pelvis
            transl[t] = initial.place(turned, sightings.xy[t, use], focal, center)
    known = np.isfinite(transl).all(1) & (np.nan_to_num(transl[:, 2]) > 0.3)
    if not known.any():
        transl[:], known[:] = [0, 0, focal * 1.7 / sightings.person_height], True
    for c in range(3):
        transl[:, c] = np.interp(np.arange(frames), np.nonzero(known)[0], transl[known, c])
    return State(local, transl, np.zeros(body.num_betas), float(np.log(focal)), np.zeros(3 * len(BODY_JOINTS) + 2))


def repeats(turns: np.ndarray) -> float:
    """turns: (T, 3, 3) of the body. Frames for each different view, in yaw."""
    return len(turns) / len(np.unique(np.floor(yaw(turns) / VIEW)))


def scale_of_world(problem: Problem, state: State, sightings: Sightings) -> float:
    """How much larger the body is than the detector's metric points, by trunk and thigh lengths."""
    bones = [(5, 11), (6, 12), (11, 13), (12, 14), (5, 7), (6, 8)]
    chain = problem.skeleton.pose(state.local[:1], state.shape)
    x = positions(chain, problem.pairs, state.shape)[0]
    ratios = []
    for a, b in bones:
        length = np.linalg.norm(sightings.world[:, a] - sightings.world[:, b], axis=-1)
        if np.isfinite(length).any():
            ratios.append(np.linalg.norm(x[a] - x[b]) / np.nanmedian(length))
    return float(np.median(ratios)) if ratios else 1.0


def renew_outlines(problem: Problem, state: State, sightings: Sightings) -> np.ndarray:
    """Takes new outline points from the posed body; returns each frame's IoU with the alpha."""
    params = to_params(problem.body, state, problem.seen.center)
    params.joint_offset = problem.personal.joint_offset(state.own).astype(np.float32)
    camera = params.camera(sightings.width, sightings.height)
    iou = np.full(len(state.local), np.nan)

    def renew(t: int, vertices: np.ndarray) -> None:
        outline, problem.outline_pairs[t] = problem.seen.outlines[t], None
        if outline.area > 0:
            points, iou[t] = outline_points(problem.body, vertices, camera, outline, t)
            problem.outline_pairs[t] = points if points.count else None

    with ThreadPoolExecutor(THREADS) as pool:
        for first in range(0, len(iou), POSED_AT_ONCE):
            frames = range(first, min(first + POSED_AT_ONCE, len(iou)))
            list(pool.map(renew, frames, problem.body.posed(params, list(frames))[0]))
    return iou


def fit_fingers(sightings: Sightings, detector: Detector, problem: Problem, state: State, config: SmplxConfig):
    """Bends the fingers on the fitted wrists; nothing else moves."""
    body = problem.body
    pairs = pairs_of(body, body.keypoint_matrix[FINGER_POINTS], detector.offsets[FINGER_POINTS])
    seen = observations(sightings, detector, FINGER_POINTS, problem.seen.center, problem.seen.focal_prior, config, [])
    fingers = Problem(body, pairs, (0, 0), seen, FINGER_JOINTS, config.smoothness, 0.0, problem.personal)
    state = replace(state, local=state.local.copy(), held=np.zeros(0), level=np.zeros(0))
    state.local[:, FINGER_JOINTS] = rotation.exp(fingers.mean)
    frozen = np.zeros(fingers.size, bool)
    frozen[-3:] = True
    return levenberg_marquardt(state, fingers.linearise, fingers.cost, fingers.move, frozen,
                               np.ones(state.shared, bool), config.iterations)


def joint_spread(problem: Problem, state: State) -> np.ndarray:
    """(T, 55) m: how far each joint may be off by what its frame shows alone, each unknown by itself."""
    chain = problem.skeleton.pose(state.local, state.shape)
    system = problem.of_each_frame(state, chain)
    n = problem.size
    information = system.band[:, np.arange(n), np.arange(n)]
    angle = 1 / np.sqrt(np.maximum(information[:, :-3].reshape(len(state.local), -1, 3).min(-1), 1e-6))
    place = np.sqrt(1 / np.maximum(information[:, -3:-1].min(-1), 1e-6))
    out = np.zeros(chain.place.shape[:2])
    index = {int(j): i for i, j in enumerate(problem.active)}
    for j, p in enumerate(problem.skeleton.parents):
        if p < 0:
            out[:, j] = place
            continue
        bone = np.linalg.norm(chain.place[:, j] - chain.place[:, p], axis=-1)
        turn = angle[:, index[p]] if p in index else 0.2
        out[:, j] = np.hypot(out[:, p], bone * turn)
    return out


def reprojection(problem: Problem, state: State) -> np.ndarray:
    """(T,) median distance px between seen and fitted body points; NaN where nothing was seen."""
    out = np.full(len(state.local), np.nan)
    for t, x in enumerate(problem.points(problem.skeleton.pose(state.local, state.shape), state)):
        off = np.linalg.norm(problem.project(state, x) - problem.seen.xy[t], axis=-1)[np.isfinite(problem.seen.spread[t])]
        out[t] = np.median(off) if len(off) else np.nan
    return out


def to_params(body: Body, state: State, center: np.ndarray, expression: np.ndarray | None = None) -> BodyParams:
    """The state in the shape of body.npz."""
    frames = len(state.local)
    size = body.exprdirs.shape[2]
    if expression is None:
        expression = np.zeros((frames, size))
    return BodyParams.from_pose(rotation.log(state.local), state.transl, state.betas, expression, np.exp(state.log_focal),
                                center, model=body.digest)

"""Reads every face that keypoints found again, more closely, fits the facial actions and writes face.npz."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import Clip, frame_paths, write_arrays
from gsac.avatar.facemesh import POINTS
from gsac.avatar.frame_files import read_frame
from gsac.avatar.resting_face import find_resting_face
from gsac.avatar.threads import available_cores
from gsac.avatar.wholebody import FACE, INDEX
from gsac.stages.contract import Job
from gsac.stages.face.actions import Actions, fill_unseen, smooth, smoothing_sigma, solve
from gsac.stages.face.config import ENCODER
from gsac.stages.face.deca import EXPRESSION, JAW, SHAPE, DecaEncoder
from gsac.stages.face.flame import FlameHead
from gsac.stages.face.head import HeadModel
from gsac.stages.face.landmarks import TwoMeshes, align, read_averaged
from gsac.stages.findings import Code, Finding
from gsac.stages.missing_frames import read_keypoints

NOSE, EARS = INDEX["nose"], [INDEX["left_ear"], INDEX["right_ear"]]
DOUBT = 0.1
"""Cosine by which the body's head points may be wrong."""
MOST_THREADS = 8
"""Each holds networks of its own."""


def run(job: Job) -> None:
    clip = Clip.read(job.inputs["split/clip.json"])
    paths = frame_paths(job.inputs["split/frames"])
    keypoints, _ = read_keypoints(job.inputs["keypoints/keypoints.npz"], len(paths))
    actions, flame = Actions.load(), FlameHead.of(job)
    landmarks, points, direction = read_clip(job, paths, keypoints, actions)
    valid = np.isfinite(landmarks[:, 0, 0])
    times = None if clip.timestamps_s is None else np.array(clip.timestamps_s)
    config = job.config
    if valid.any():
        seen = None if times is None else times[valid]
        c, own = solve(points[valid], direction[valid], actions, config.sparsity, config.doubt, seen, config.smooth_brow)
        if seen is not None:
            apart = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
            c = smooth(c, seen, smoothing_sigma(actions.names, config.smooth_lids, config.smooth, config.smooth_slow, apart))
    else:
        c, own = np.zeros((0, len(actions.names))), np.zeros((POINTS, 3))
        if keypoints["score"][:, FACE].any():  # else keypoints has said so
            job.warn(Finding.of(Code.FACE_AT_REST))
    expression = fill_unseen(c, valid, times, config.rest_time)
    seen_only = {}
    if valid.any():
        rest = find_resting_face(c, direction[valid][:, 2])
        head = fit_head(actions, flame, own, expression)
        if flame and config.method == "deca":
            head = encode_head(flame, DecaEncoder(job.models[ENCODER]), paths, landmarks, times, config.rest_time)
        seen_only = {**head, "rest_expression": rest.astype(np.float32)}
    write_arrays(job.out / "face.npz", valid=valid, expression=expression.astype(np.float32),
                 jaw=np.zeros((len(paths), 3), np.float32), shape=own.ravel().astype(np.float32),
                 landmarks=landmarks.astype(np.float32), **seen_only)


def warm(device: str) -> None:
    """Called while a stage before is at work: importing the body model's modules takes longest."""
    HeadModel.of_open_body(Actions.load())


def fit_head(actions: Actions, flame: FlameHead | None, own: np.ndarray, expression: np.ndarray) -> dict[str, np.ndarray]:
    """own: (468, 3) m, the person's resting points less the average ones; expression: (T, E).

    Returns the arrays of face.npz for the person's head.
    """
    rest = actions.neutral + own
    if flame:
        return flame.arrays(rest, actions, expression)
    model = HeadModel.of_open_body(actions)
    return model.arrays(model.fit_shape(rest)[0])


def encode_head(flame: FlameHead, encoder: DecaEncoder, paths: list[Path], landmarks: np.ndarray, times: np.ndarray | None,
                rest_time: float) -> dict[str, np.ndarray]:
    """The arrays of face.npz for the person's head by DECA: one shape, the mean of all frames with a face, and each frame's
    expression and jaw.

    landmarks: (T, 468, 3) px, NaN without a face; times: (T,) s, None for photos; rest_time: s.
    """
    valid = np.isfinite(landmarks[:, 0, 0])
    codes = np.stack([encoder.read(read_frame(paths[t]), landmarks[t]) for t in np.flatnonzero(valid)])
    moved = fill_unseen(np.concatenate([codes[:, EXPRESSION], codes[:, JAW]], 1), valid, times, rest_time)
    return flame.encoded(codes[:, SHAPE].mean(0), moved[:, :-3], moved[:, -3:])


def read_clip(job: Job, paths: list[Path], keypoints: dict[str, np.ndarray], actions: Actions) -> tuple[np.ndarray, ...]:
    """keypoints: arrays of keypoints.npz by name, face_mesh (T, 468, 3) and world (T, 133, 3) among them.

    Returns landmarks (T, 468, 3) px, NaN where the face is turned away or too uncertain, and for the other frames the aligned
    points (T, 468, 3) m and where the face looks (T, 3); zeros elsewhere.
    """
    network = TwoMeshes(job.models)
    T = len(paths)
    landmarks = np.full((T, POINTS, 3), np.nan)
    points, direction = np.zeros((T, POINTS, 3)), np.zeros((T, 3))
    least = -np.cos(np.radians(job.config.angle))

    def frame(t: int) -> None:
        seen = keypoints["face_mesh"][t]
        if np.isfinite(seen[0, 0]) and not turned_away(keypoints["world"][t], least):
            face = read_averaged(network, read_frame(paths[t]), seen, actions.mirror)
            aligned, toward = align(face.points, actions.neutral, face.facing())
            if face.presence >= job.config.threshold and toward[2] >= least:
                landmarks[t], points[t], direction[t] = face.points, aligned, toward

    with ThreadPoolExecutor(min(available_cores(), MOST_THREADS)) as pool:
        for done, _ in enumerate(pool.map(frame, range(T)), 1):
            job.progress(done, T, "frames")
    return landmarks, points, direction


def turned_away(world: np.ndarray, least: float) -> bool:
    """world: (133, 3) m or NaN; least: cosine between the face's direction and the way to the camera.

    Whether the face looks away from the camera by the body's head points, by more than their error `DOUBT`: the face network finds
    frontal faces in profiles too.
    """
    forward = world[NOSE] - world[EARS].mean(axis=0)
    toward = -forward[2] / max(np.hypot(forward[0], forward[2]), 1e-9)
    return bool(np.isfinite(toward) and toward < least - DOUBT)

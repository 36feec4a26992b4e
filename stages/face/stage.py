"""Looks again at every face that keypoints found, closely, and fits the facial actions; writes face.npz."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from gsac.avatar.artifacts import Clip, frame_paths, read_arrays, read_frame, write_arrays
from gsac.avatar.facemesh import POINTS, FaceMesh
from gsac.avatar.threads import available_cores
from gsac.avatar.wholebody import INDEX
from gsac.stages.contract import Job, StageError
from gsac.stages.face.actions import Actions, fill, pace, smooth, solve
from gsac.stages.face.flame import FlameHead
from gsac.stages.face.head import HeadModel
from gsac.stages.face.landmarks import align, look

NOSE, EARS = INDEX["nose"], [INDEX["left_ear"], INDEX["right_ear"]]
DOUBT = 0.1
MOST = 8
"""Frames looked at side by side: each thread holds networks of its own."""


def run(job: Job) -> None:
    clip = Clip.read(job.inputs["split/clip.json"])
    paths = frame_paths(job.inputs["split/frames"])
    keypoints = read_arrays(job.inputs["keypoints/keypoints.npz"])
    if len(keypoints["score"]) != len(paths):
        raise StageError(f"keypoints.npz has {len(keypoints['score'])} frames but split has {len(paths)}; "
                         "run keypoints again")
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
            c = smooth(c, seen, pace(actions.names, config.smooth_lids, config.smooth, config.smooth_slow, apart))
    else:
        c, own = np.zeros((0, len(actions.names))), np.zeros((POINTS, 3))
        job.warn("The face was never seen from the front; the avatar's face stays at rest.")
    expression = fill(c, valid, times, config.rest_time)
    head = head_of(actions, flame, own, expression) if valid.any() else {}
    write_arrays(job.out / "face.npz", valid=valid, expression=expression.astype(np.float32),
                 jaw=np.zeros((len(paths), 3), np.float32), shape=own.ravel().astype(np.float32),
                 landmarks=landmarks.astype(np.float32), **head)


def warm(device: str) -> None:
    """Called while a stage before is at work: what reads a body takes longest to import."""
    HeadModel.of_open_body(Actions.load())


def head_of(actions: Actions, flame: FlameHead | None, own: np.ndarray, expression: np.ndarray) -> dict[str, np.ndarray]:
    """own: (468, 3) m, the person's resting points less everybody's. What face.npz holds of the person's head."""
    rest = actions.neutral + own
    if flame:
        return flame.arrays(rest, actions, expression)
    model = HeadModel.of_open_body(actions)
    return model.arrays(model.shape_of(rest)[0])


def read_clip(job: Job, paths: list, keypoints: dict, actions: Actions) -> tuple[np.ndarray, ...]:
    """Returns landmarks (T, 468, 3) px, NaN where the face is turned away or not believed, and of those frames, aligned
    points (T, 468, 3) m and where the face looks (T, 3); zeros elsewhere."""
    mesh = FaceMesh(job.models, threads=1)
    T = len(paths)
    landmarks = np.full((T, POINTS, 3), np.nan)
    points, direction = np.zeros((T, POINTS, 3)), np.zeros((T, 3))
    least = -np.cos(np.radians(job.config.angle))

    def frame(t: int) -> None:
        seen = keypoints["face_mesh"][t]
        if np.isfinite(seen[0, 0]) and not turned_away(keypoints["world"][t], least):
            face = look(mesh, read_frame(paths[t]), seen, actions.mirror)
            aligned, looks = align(face.points, actions.neutral, face.facing())
            if face.presence >= job.config.threshold and looks[2] >= least:
                landmarks[t], points[t], direction[t] = face.points, aligned, looks

    with ThreadPoolExecutor(min(available_cores(), MOST)) as pool:
        for done, _ in enumerate(pool.map(frame, range(T)), 1):
            job.progress(done, T, "frames")
    return landmarks, points, direction


def turned_away(world: np.ndarray, least: float) -> bool:
    """world: (133, 3) m or NaN. Whether the body's own head points say that the face looks away from the camera: the face
    network alone sees frontal faces in profiles. `DOUBT` allows for what those points are worth."""
    forward = world[NOSE] - world[EARS].mean(axis=0)
    toward = -forward[2] / max(np.hypot(forward[0], forward[2]), 1e-9)
    return bool(np.isfinite(toward) and toward < least - DOUBT)

"""Runs the detector over the clip, writes keypoints.npz and warns of what was not seen.

The person is followed frame by frame; the rest of a frame is found in threads, several frames at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from gsac.avatar.artifacts import KEYPOINT_SHAPES, frame_paths, read_frame, write_arrays
from gsac.avatar.threads import available_cores, prefetch
from gsac.avatar.wholebody import FACE, HANDS
from gsac.stages.contract import BadInput, Job
from gsac.stages.frame_names import name_frames
from gsac.stages.keypoints.config import DetectorName
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.detector import Detector
from gsac.stages.keypoints.mediapipe import Mediapipe
from gsac.stages.keypoints.simcc import Wholebody

DETECTORS: dict[DetectorName, type[Detector]] = {"mediapipe": Mediapipe, "onnx-wholebody": Wholebody}
"""keypoints.detector -> its class."""
MOST_THREADS = 8
"""Each holds networks of its own, some 40 MB."""
EDGE = 0.004
"""Width of the rim of the frame, as a part of its longer side, that counts as touching it."""

FLICKER = 0.25
"""Share of the frames below which what looks like a person, but shows neither face nor hand in any of them, is none."""
ADVICE = "film one whole person, upright, at least a third of the frame high, in good light"


def run(job: Job) -> None:
    paths = frame_paths(job.inputs["split/frames"])
    detector = DETECTORS[job.config.detector](job.models, job.config)
    frames, at_edge = [], []
    threads = min(available_cores(), MOST_THREADS)
    with ThreadPoolExecutor(threads + 1) as pool:
        started = ((detector.start(image), *image.shape[:2]) for image in prefetch(pool, read_frame, paths, 2))
        for frame, edge in prefetch(pool, _finish, started, threads):
            frames.append(frame)
            at_edge.append(edge)
            job.progress(len(frames), len(paths), "frames")
    report(job, frames, at_edge)
    arrays = {name: np.array([getattr(f, name) for f in frames], np.float32) for name in KEYPOINT_SHAPES if name != "detector"}
    write_arrays(job.out / "keypoints.npz", detector=np.array(job.config.detector), **arrays)


def _finish(started: tuple[Callable[[], Frame], int, int]) -> tuple[Frame, bool]:
    """started: what `Detector.start` returned, height and width px. Returns the frame, and whether the person touches its edge."""
    finish, height, width = started
    frame = finish()
    return frame, frame.seen and touches_edge(frame, width, height)


def touches_edge(frame: Frame, width: int, height: int) -> bool:
    """Whether a body point, or the crown extrapolated above the eyes, lies on the frame's rim or outside of it. Sizes in px."""
    xy = frame.pose33[:, :2] if frame.pose33.any() else frame.xy[:23][frame.score[:23] > 0]
    if frame.pose33.any():
        eyes, mouth = xy[[2, 5]].mean(axis=0), xy[[9, 10]].mean(axis=0)
        xy = np.vstack([xy, eyes + 1.6 * (eyes - mouth)])
    rim = EDGE * max(width, height)
    return bool((xy < rim).any() or (xy[:, 0] > width - rim).any() or (xy[:, 1] > height - rim).any())


def report(job: Job, frames: list[Frame], at_edge: list[bool]) -> None:
    """Warns of what was not seen; that nobody was seen in any frame is an error. at_edge: one for each frame."""
    seen = np.array([f.seen for f in frames])
    if not seen.any():
        raise BadInput(f"No person was found in any of the clip's {len(frames)} frames; {ADVICE}")
    if seen.mean() < FLICKER and not any(f.score[points].any() for f in frames for points in (FACE, *HANDS.values())):
        raise BadInput(f"No person was found: something like one shows in {name_frames(seen)} only, and never a face or a hand; "
                       f"{ADVICE}")
    if not seen.all():
        job.warn(f"No person was found in {name_frames(~seen)}; these frames carry no points.")
    second = np.array([f.second_person for f in frames])
    if second.any():
        job.warn(f"A second person was seen in {name_frames(second)}; only the first one is followed. "
                 "Keep others out of the picture or cut these frames.")
    if any(at_edge):
        job.warn(f"The person touches the edge of the picture in {name_frames(np.array(at_edge))}; "
                 "parts outside of it are guessed.")
    for side, points in HANDS.items():
        if not any(f.score[points].any() for f in frames):
            job.warn(f"The {side} hand was never seen; its fingers stay at rest.")
    if not any(f.score[FACE].any() for f in frames):
        job.warn("The face was never seen from the front; it stays without expression.")

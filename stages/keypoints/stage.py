"""Runs the detector over the clip, writes keypoints.npz and warns of what was not seen.

The person is followed frame by frame; the rest of a frame is found in threads, several frames at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from gsac.avatar.artifacts import KEYPOINT_SHAPES, frame_paths, write_arrays
from gsac.avatar.frame_files import read_frame
from gsac.avatar.region import Region
from gsac.avatar.threads import available_cores, prefetch
from gsac.avatar.wholebody import FACE, HANDS
from gsac.stages.contract import BadInput, Job
from gsac.stages.counting import counted
from gsac.stages.findings import Code, Finding
from gsac.stages.first_look import FirstLook
from gsac.stages.frame_names import name_frames
from gsac.stages.keypoints.config import DetectorName
from gsac.stages.keypoints.cut_off import Cut, find_cuts, name_cuts
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.detector import Detector
from gsac.stages.keypoints.lying import find_lying
from gsac.stages.keypoints.mediapipe import Mediapipe
from gsac.stages.keypoints.mmpose_points import MmposePoints
from gsac.stages.keypoints.second_look import look_again
from gsac.stages.keypoints.second_person import name_followed
from gsac.stages.keypoints.simcc import Wholebody

DETECTORS: dict[DetectorName, type[Detector]] = {"mediapipe": Mediapipe, "onnx-wholebody": Wholebody,
                                               "mmpose-json": MmposePoints}
"""keypoints.detector -> its class."""
MOST_THREADS = 8
"""Each holds networks of its own, some 40 MB."""
FLICKER = 0.25
"""Share of the frames below which what looks like a person, but shows neither face nor hand in any of them, is none."""
HARDLY = 0.1
"""Share of the frames below which a person in them makes no avatar."""
LEAST_TALL = 300
"""px, of a person from whom an avatar has a face."""
MOSTLY = 0.5
"""Share of the person's frames of which more must show them from head to feet for their size to be judged."""
ADVICE = "film one whole person from head to feet, upright, at least a third of the frame high, in good light"


def run(job: Job) -> None:
    paths = frame_paths(job.inputs["split/frames"])
    detector = DETECTORS[job.config.detector](job.models, job.config)
    frames, cuts = [], []
    threads = min(available_cores(), MOST_THREADS)
    with ThreadPoolExecutor(threads + 1) as pool:
        started = ((detector.start(image), *image.shape[:2]) for image in prefetch(pool, read_frame, paths, 2))
        for frame, cut in prefetch(pool, _finish, started, threads):
            frames.append(frame)
            cuts.append(cut)
            job.progress(len(frames), len(paths), "frames")
    look_again(frames, cuts, lambda t, region: _look(detector, read_frame(paths[t]), region))
    detector.settle(frames)
    arrays = {name: np.array([getattr(f, name) for f in frames], np.float32) for name in KEYPOINT_SHAPES if name != "detector"}
    report(job, frames, cuts)
    judge_size(job, arrays, cuts)
    write_arrays(job.out / "keypoints.npz", detector=np.array(job.config.detector), **arrays)


def _finish(started: tuple[Callable[[], Frame], int, int]) -> tuple[Frame, set[Cut]]:
    """started: what `Detector.start` returned, height and width px. Returns the frame, and what its edge cuts off the person."""
    finish, height, width = started
    frame = finish()
    return frame, find_cuts(frame, width, height) if frame.seen else set()


def _look(detector: Detector, image: np.ndarray, region: Region) -> tuple[Frame, set[Cut]] | None:
    """image: (H, W, 3) uint8. What is found in the region, and what the image's edge cuts off of it."""
    frame = detector.look(image, region)
    return None if frame is None else (frame, find_cuts(frame, image.shape[1], image.shape[0]))


def report(job: Job, frames: list[Frame], cuts: list[set[Cut]]) -> None:
    """Warns of what was not seen; that nobody was seen in any frame is an error. cuts: one for each frame."""
    seen = np.array([f.seen for f in frames])
    if not seen.any():
        raise BadInput(f"No person was found in any of the clip's {counted(len(frames), 'frame')}; {ADVICE}")
    if seen.mean() < FLICKER and not any(f.score[points].any() for f in frames for points in (FACE, *HANDS.values())):
        raise BadInput(f"No person was found: something like one shows in {name_frames(seen)} only, and never a face or a hand; "
                       f"{ADVICE}")
    if seen.mean() < HARDLY:
        job.warn(Finding.of(Code.HARDLY_ANY_PERSON, ~seen, figure=seen.sum(), given=len(seen)))
    elif not seen.all():
        job.warn(Finding.of(Code.NO_PERSON, ~seen))
    if (lying := find_lying(frames)).any():
        job.warn(Finding.of(Code.LIES_ON_SIDE, lying))
    second = np.array([bool(f.others) for f in frames])
    if second.any():
        job.warn(Finding.of(Code.SECOND_PERSON, second, followed=name_followed(frames)))
    if any(cuts):
        job.warn(Finding.of(Code.CUT_OFF, np.array([bool(cut) for cut in cuts]), parts=name_cuts(cuts)))
    for side, points in HANDS.items():
        if not any(f.score[points].any() for f in frames):
            job.warn(Finding.of(Code.HAND_NEVER_DETECTED, side=side))
    if not any(f.score[FACE].any() for f in frames):
        job.warn(Finding.of(Code.FACE_NEVER_DETECTED))


def judge_size(job: Job, points: dict[str, np.ndarray], cuts: list[set[Cut]]) -> None:
    """Tells what was seen, and warns of a person who is too small for detail; not of one who mostly is cut off above or below: what
    shows tells no height, and to come closer would cut off more.

    points: arrays of keypoints.npz, (T, ...); cuts: one for each frame.
    """
    job.note(FirstLook.of(points).sentence)
    seen = points["score"].any(1)
    whole = seen & np.array([cut <= {Cut.SIDE} for cut in cuts])
    if whole.sum() <= MOSTLY * seen.sum():
        return
    height = FirstLook.of({name: points[name][whole] for name in ("xy", "score", "world")}).height_px
    if height < LEAST_TALL:
        job.warn(Finding.of(Code.SMALL_PERSON, figure=height))

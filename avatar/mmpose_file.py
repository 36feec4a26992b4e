"""Reads key points that mmpose's inferencer or demo scripts wrote as JSON: one file of all frames, or a folder with one a frame.

A frame is a list of persons, each with `keypoints` [[x, y], ...] and `keypoint_scores` [...]. In a file of many frames the list is
called `instances` and stands beside a `frame_id`, which counts from 0 or 1; all may lie under `instance_info` or `predictions`. In
a folder each file is called as its frame, `000000.json`. mmpose counts pixels from the middle of the first, gsac from its corner.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from gsac.avatar.artifacts import ArtifactError

POINTS = 133
MOST_BYTES = 512 << 20
"""Of a file: the key points of a clip have far less."""


def read_mmpose(path: Path) -> dict[int, np.ndarray]:
    """Number of a frame -> its persons (P, 133, 3): x, y px and mmpose's score. Raises ArtifactError that names file and frame."""
    if path.is_dir():
        files = sorted(path.iterdir())
        odd = [file.name for file in files if not file.stem.isdecimal()]
        if odd:
            raise ArtifactError(f"{path}: {odd[0]} is not called as a frame is (000000.json); run mmpose on a run's split/frames")
        return {int(file.stem): _persons(_load(file), f"{path}: {file.name}") for file in files}
    content = _load(path)
    if all(isinstance(frame, dict) and isinstance(frame.get("frame_id"), int) for frame in content):
        frames = {frame["frame_id"]: _persons(frame.get("instances"), f"{path}: frame_id {frame['frame_id']}") for frame in content}
        return frames if 0 in frames else {t - 1: persons for t, persons in frames.items()}
    if all(isinstance(frame, list) for frame in content):
        return {t: _persons(frame, f"{path}: frame {t}") for t, frame in enumerate(content)}
    return {0: _persons(content, str(path))}


def _load(file: Path) -> list:
    size = file.stat().st_size
    if size > MOST_BYTES:
        raise ArtifactError(f"{file}: has {size} bytes; key points of a clip have at most {MOST_BYTES}")
    try:
        content = json.loads(file.read_bytes())
    except (ValueError, RecursionError) as error:
        raise ArtifactError(f"{file}: not readable as JSON ({error})") from error
    if isinstance(content, dict):
        content = content.get("instance_info", content.get("predictions"))
    if not isinstance(content, list):
        raise ArtifactError(f"{file}: not mmpose's key points; expected a list of frames or persons, or one as instance_info or "
                            "predictions")
    return content


def _persons(given: Any, where: str) -> np.ndarray:
    """Persons (P, 133, 3) of a list of mmpose's instances; a list of one such list counts as it."""
    if isinstance(given, list) and len(given) == 1 and isinstance(given[0], list):
        given = given[0]
    try:
        persons = [np.column_stack([np.asarray(one["keypoints"], float) + 0.5, np.asarray(one["keypoint_scores"], float)])
                   for one in given]
    except (TypeError, KeyError, ValueError) as error:
        raise ArtifactError(f"{where}: not a list of persons with keypoints and keypoint_scores ({error!r})") from error
    for person in persons:
        if person.shape != (POINTS, 3) or not np.isfinite(person).all():
            raise ArtifactError(f"{where} has a person of {len(person)} points and {person.shape[1] - 1} coordinates, or a number "
                                f"that is none; expected COCO-WholeBody's {POINTS} points, x and y")
    return np.stack(persons) if persons else np.zeros((0, POINTS, 3))

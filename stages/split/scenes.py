"""Clips that are cut together of several scenes: one of them is used, the longest that shows a person.

A body, a room and a light are sought that hold for all frames; of two scenes they would be neither's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gsac.avatar.frame_files import read_frame
from gsac.stages.split.crop import SIDES, Extent
from gsac.stages.split.people import People
from gsac.stages.split.pick import pick_evenly
from gsac.stages.split.picture_quality import find_scene_cuts

LOOKS = 6
"""Frames of a scene in which a person is looked for."""
IN_PART = 0.3
"""Worth of a frame whose edge cuts off much of the person, against one that shows the whole; a frame without a person has none."""
BEYOND = 0.1
"""Share of the person's height that may lie outside the picture of a whole person."""


@dataclass(frozen=True)
class Scene:
    """A part of the clip without a cut."""

    first: int
    """Place of its first frame among the video's."""
    last: int


def divide(scene: Scene, places: np.ndarray, blocks: Sequence[np.ndarray]) -> list[tuple[Scene, np.ndarray]]:
    """The scenes that a part of the clip falls into, each with its kept frames, (k,) of T.

    places: (T,) of the kept frames among the video's, rising; blocks: T of (h, w, 3), 0..255, fewer where frames are missing. What
    lies between the last kept frame of a scene and the first of the next belongs to neither: somewhere there the picture changes.
    """
    cuts = np.flatnonzero(find_scene_cuts(np.stack(blocks))) if len(blocks) == len(places) > 0 else np.zeros(0, int)
    firsts, lasts = [scene.first, *places[cuts].tolist()], [*places[cuts - 1].tolist(), scene.last]
    kept = np.split(np.arange(len(places)), cuts)
    return [(Scene(first, last), own) for first, last, own in zip(firsts, lasts, kept, strict=True)]


def choose_scene(parts: Sequence[tuple[Scene, np.ndarray]], times: np.ndarray, frames: list[Path], people: People | None) -> Scene:
    """The scene that shows a whole person for longest; the longest where nobody is looked for or found.

    parts: scenes with their kept frames; times: (N,) s, of the video's frames; frames: T files.
    """
    seconds = np.array([times[scene.last] - times[scene.first] for scene, _ in parts])
    worth = np.array([1.0 if people is None else measure_presence(people, [frames[t] for t in kept]) for _, kept in parts])
    return parts[int(np.argmax(seconds * worth if (seconds * worth).any() else seconds))][0]


def measure_presence(people: People, frames: list[Path]) -> float:
    """How much of a person the frames of a scene show, 0 to 1."""
    people.start_anew()
    pictures = [read_frame(frames[i]) for i in pick_evenly(len(frames), LOOKS)]
    return float(np.mean([_worth(people.look(picture), *picture.shape[:2]) for picture in pictures]))


def _worth(person: Extent | None, height: int, width: int) -> float:
    if person is None:
        return 0.0
    inside = SIDES * person.box <= SIDES * np.array([0, 0, width, height]) + BEYOND * person.tall
    return 1.0 if inside.all() else IN_PART

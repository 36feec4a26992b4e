"""Judges a clip by a few of its frames: what would come of it, and what to film again."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from gsac.avatar.artifacts import Clip, check_keypoints, frame_paths, read_frame
from gsac.avatar.camera_motion import View, find_moved, make_view, measure_sway
from gsac.avatar.threads import available_cores
from gsac.pipeline.outcomes import ExitCode
from gsac.stages.findings import Code, Finding
from gsac.stages.first_look import LEAST_TURN, FirstLook
from gsac.stages.severity import Severity

MOST = 6
"""Most stretches of time that are named."""
FRAMES = 32
"""Looked at; a video's are spread evenly."""
MARGIN = 0.15
"""Room about the person's points, as a share of their extent, for hair and clothes."""


class Prospect(Enum):
    """What would come of a clip."""

    GOOD = "good"
    POORER = "poorer"
    HOPELESS = "hopeless"

    @property
    def sentence(self) -> str:
        return _PROSPECTS[self][0]

    @property
    def exit_code(self) -> ExitCode:
        return _PROSPECTS[self][1]


_PROSPECTS = {
    Prospect.GOOD: ("Good: nothing speaks against an avatar from this clip.", ExitCode.OK),
    Prospect.POORER: ("Something can come of this clip, but filmed again it would be better.", ExitCode.FAILED),
    Prospect.HOPELESS: ("Nothing can come of this clip: film it again.", ExitCode.USAGE),
}


@dataclass(frozen=True)
class ClipCheck:
    """What a few frames tell."""

    look: FirstLook
    times: list[float] | None
    """Of these frames, s; None for photos."""
    findings: list[tuple[str, dict[str, Any]]]
    """Sentences with their entries of `--json`, whose frames count among those that were looked at."""

    @property
    def prospect(self) -> Prospect:
        """By the worst finding."""
        found = {entry["severity"] for _, entry in self.findings} - {Severity.NEWS.value}
        return Prospect.HOPELESS if Severity.HOPELESS.value in found else Prospect.POORER if found else Prospect.GOOD

    @property
    def lines(self) -> list[str]:
        """What people read: the verdict, what was seen, each finding with its times; of a clip without hope only why it is so."""
        told = [(message, entry) for message, entry in self.findings
                if self.prospect is not Prospect.HOPELESS or entry["severity"] == Severity.HOPELESS.value]
        length = f" The clip lasts {self.times[-1] - self.times[0]:.1f} s." if self.times else ""
        return [self.prospect.sentence, f"{self.look.sentence}{length}",
                *(f"- {message}{self._when(entry)}" for message, entry in told)]

    def to_json(self) -> dict[str, Any]:
        """The object of `--json`, but for the stages."""
        return {"prospect": self.prospect.value, "seen": asdict(self.look), "times_s": self.times,
                "findings": [{"message": message, **entry} for message, entry in self.findings]}

    def _when(self, entry: dict[str, Any]) -> str:
        runs = entry["frames"]
        if not self.times or not runs or sum(last - first + 1 for first, last in runs) == len(self.times):
            return ""
        spans = [" to ".join(f"{self.times[t]:.1f}" for t in sorted({first, last})) for first, last in runs[:MOST]]
        return f" (at {', '.join(spans)}{', ...' if len(runs) > MOST else ''} s)"


def check_clip(frames: Path, clip: Path, keypoints: Path, findings: list[tuple[str, dict[str, Any]]]) -> ClipCheck:
    """The check by outputs of split and keypoints, and by what these stages found: sentences with their entries."""
    times, points, found = Clip.read(clip).timestamps_s, check_keypoints(keypoints), []
    look = FirstLook.of(points)
    turn = look.turn * look.frames / max(look.frames - 1, 1)  # the clip shows what lies between those frames, too
    if look.frames > 1 and turn < LEAST_TURN:
        found.append(Finding.of(Code.PART_OF_TURN, figure=turn))
    if times is not None:
        sway = measure_sway(backgrounds(frames, points["xy"], points["score"]))
        longer = max(read_frame(frame_paths(frames)[0]).shape)
        if (moved := find_moved(sway, longer)).any():
            found.append(Finding.of(Code.CAMERA_MOVES, moved, figure=np.nanmax(sway)))
    return ClipCheck(look, times, [*findings, *((finding.message, finding.to_json()) for finding in found)])


def backgrounds(frames: Path, xy: np.ndarray, score: np.ndarray) -> Iterator[View]:
    """Yields each frame without the box about the person's points. xy: (T, 133, 2) px; score: (T, 133)."""
    paths = frame_paths(frames)

    def view(t: int) -> View:
        image = read_frame(paths[t])
        person, seen = np.zeros(image.shape[:2], np.float32), xy[t, score[t] > 0]
        if len(seen):
            room = MARGIN * np.ptp(seen, axis=0).max()
            (left, top), (right, bottom) = np.maximum(seen.min(0) - room, 0).astype(int), (seen.max(0) + room).astype(int)
            person[top:bottom, left:right] = 1
        return make_view(image, person)

    with ThreadPoolExecutor(available_cores()) as pool:
        yield from pool.map(view, range(len(paths)))

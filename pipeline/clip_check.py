"""Judges a clip by a few of its frames: what would come of it, and what to film again."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from gsac.avatar.artifacts import Clip, check_keypoints
from gsac.pipeline.outcomes import ExitCode
from gsac.stages.findings import Code, Finding
from gsac.stages.first_look import LEAST_TURN, FirstLook
from gsac.stages.severity import Severity

MOST = 6
"""Most stretches of time that are named."""
FRAMES = 32
"""Looked at; a video's are spread evenly."""
LAST = "smplx"
"""The stage up to which they are looked at: only a body shows an arm that no pose explains."""
PARAMS: dict[str, dict[str, Any]] = {"split": {"count": FRAMES, "quick": True}, "segment": {"use_plate": False, "iterations": 0}}
"""Stage -> parameters. To learn the empty scene and to refine outlines take two thirds of segment's time, and the network's own
outline serves: on 32 made-up clips, a real one and photos the same is found with either."""

SPARSE_S = 0.35
"""Between frames, beyond which a hand that moves, as in squats, looks lost or misplaced against its neighbours."""
BY_NEIGHBOURS = (Code.HAND_MISPLACED.word, Code.HAND_HIDDEN.word)


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


def check_clip(clip: Path, keypoints: Path, findings: list[tuple[str, dict[str, Any]]]) -> ClipCheck:
    """The check by outputs of split and keypoints, and by what the stages up to LAST found: sentences with their entries."""
    times, look = Clip.read(clip).timestamps_s, FirstLook.of(check_keypoints(keypoints))
    sparse = times is not None and len(times) > 1 and (times[-1] - times[0]) / (len(times) - 1) > SPARSE_S
    empty = set().union(*(list_frames(entry) for _, entry in findings if entry["code"] == Code.NO_PERSON.word))
    found = [(message, entry) for message, entry in findings if not (
        sparse and entry["code"] in BY_NEIGHBOURS or entry["code"] == Code.NOT_FITTED.word and list_frames(entry) <= empty)]
    turn = look.turn if times is None else look.turn * look.frames / max(look.frames - 1, 1)  # a video shows what lies between, too
    if look.frames > 1 and turn < LEAST_TURN:
        part = Finding.of(Code.PART_OF_TURN, figure=turn)
        found.append((part.message, part.to_json()))
    return ClipCheck(look, times, found)


def list_frames(entry: dict[str, Any]) -> set[int]:
    """Those that an entry of `--json` names."""
    return {t for first, last in entry["frames"] for t in range(first, last + 1)}

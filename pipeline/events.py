"""What happens in runs and batches, one type an event: the one source of progress, logs, counters and traces.

A `Journal` tells events as they happen. The terminal, the file of events, batch.json, batch.prom, `--events` and OpenTelemetry
listen to it. As text an event is a JSON object on a line of its own: `event` is its kind, and what is empty is left out.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, get_args, get_type_hints

LONGEST = 2000
"""Characters of a text in an event; what is longer is cut."""
KINDS: dict[str, type[Event]] = {}
"""Kind -> type, in the order of this file."""


@dataclass(frozen=True, kw_only=True)
class Event:
    """What every event says."""

    time: float = 0.0
    """When it happened, s, Unix time."""
    batch: str = ""
    """Of the batch, 16 hexadecimal digits; empty outside of one."""
    run: str = ""
    """Of the run, that is of one process that runs one clip, 16 hexadecimal digits; empty where the batch itself tells."""
    clip: str = ""
    """Name of the clip's file, with its folder's name where clips of a batch have the same."""
    attempt: int = 1
    """Which run of the clip in its batch: one that a signal ended is tried once more."""
    kind: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        cls.kind = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in cls.__name__).removeprefix("_")
        KINDS[cls.kind] = cls

    def to_line(self) -> str:
        """JSON on one line, with its end."""
        told = {name: _short(value) for name, default in _defaults(type(self)) if (value := getattr(self, name)) != default}
        return json.dumps({"event": self.kind} | told, separators=(",", ":")) + "\n"


@dataclass(frozen=True, kw_only=True)
class BatchStarted(Event):
    """A batch has planned its clips and begins to run them."""

    clips: int = 0
    """All of its clips."""
    due: int = 0
    """Those of which something has to run."""
    executor: str = ""


@dataclass(frozen=True, kw_only=True)
class BatchEnded(Event):
    """A batch has come to its end, or was stopped; one that was killed says none."""

    seconds: float = 0.0
    """By the clock."""
    failed: int = 0
    """Clips."""


@dataclass(frozen=True, kw_only=True)
class ClipPlanned(Event):
    """A batch knows what a clip needs."""

    digest: str = ""
    """Of the clip; empty where it cannot be read."""
    due: list[str] = field(default_factory=list)
    """Stages that would run; none: all results are in the cache."""
    seconds: float = 0.0
    """That they may take by the clock."""


@dataclass(frozen=True, kw_only=True)
class ClipKept(Event):
    """A clip is left as the batch before has left it."""

    status: str = ""
    """What it counts as."""


@dataclass(frozen=True, kw_only=True)
class ClipStarted(Event):
    """A run has begun with its clip."""


@dataclass(frozen=True, kw_only=True)
class ClipEnded(Event):
    """A run, or the last of a batch's runs of a clip, has ended."""

    status: str = ""
    """`done`, `unchanged` or `failed`."""
    code: int = 0
    """Exit code of the run."""
    seconds: float = 0.0
    """By the clock."""
    error: str = ""
    """The sentence that the user reads."""
    killed: int = 0
    """How often a signal ended its run."""
    stages: int = 0
    """That the run has judged."""
    ran: int = 0
    """Stages that were computed."""
    warnings: int = 0
    metrics: dict[str, Any] = field(default_factory=dict)
    """Figures of the avatar, as in metrics.json."""


@dataclass(frozen=True, kw_only=True)
class StageEvent(Event):
    """What every event of a stage says."""

    stage: str = ""
    place: str = ""
    """Which of the run's stages, as `7/8`."""


@dataclass(frozen=True, kw_only=True)
class StagePlanned(StageEvent):
    """A stage of the run at hand has to be computed, or may have to."""

    key: str = ""
    """Of the cache; empty where it hangs on a stage that has to run first."""
    reason: str = ""
    """Why, as in run.json."""
    seconds: float = 0.0
    """That it may take by the clock; 0 where nobody knows."""


@dataclass(frozen=True, kw_only=True)
class StageHit(StageEvent):
    """A stage's result was in the cache."""

    key: str = ""
    seconds: float = 0.0
    """Of the run that computed it."""
    cpu_seconds: float = 0.0
    """The same."""
    bytes: int = 0
    """Of its outputs."""


@dataclass(frozen=True, kw_only=True)
class StageStarted(StageEvent):
    """A stage begins to read its inputs."""

    key: str = ""
    reason: str = ""
    """Why it has to run, in words."""
    device: str = ""
    """`cpu` or `cuda`."""


@dataclass(frozen=True, kw_only=True)
class StageProgress(StageEvent):
    """How far a stage is."""

    done: int = 0
    total: int = 0
    """0 where nobody knows."""
    unit: str = ""
    """Of both; another unit is another phase of the stage."""
    rate: float | None = None
    """Units/s in the last seconds; null until it has settled."""
    run_left: float | None = None
    """s, to the end of the run; null where nobody knows."""


@dataclass(frozen=True, kw_only=True)
class StageWarning(StageEvent):
    """A stage has found a fault of the clip, or what it takes from the avatar."""

    message: str = ""
    code: str = ""
    """Of the finding; empty where a stage gave none."""
    severity: str = ""
    """Of the finding."""


@dataclass(frozen=True, kw_only=True)
class StageNote(StageEvent):
    """A stage tells what holds for nearly every clip."""

    message: str = ""


@dataclass(frozen=True, kw_only=True)
class StageLine(StageEvent):
    """A line that a stage printed into its log."""

    line: str = ""


@dataclass(frozen=True, kw_only=True)
class StageFinished(StageEvent):
    """A stage was computed, checked and published."""

    key: str = ""
    seconds: float = 0.0
    """By the clock."""
    cpu_seconds: float = 0.0
    peak_rss_mb: float = 0.0
    bytes: int = 0
    """Of its outputs."""
    device: str = ""
    """`cpu` or `cuda`."""


@dataclass(frozen=True, kw_only=True)
class StageFailed(StageEvent):
    """A stage gave no result."""

    key: str = ""
    error: str = ""
    killed: str = ""
    """Name of the signal that ended its process."""


@dataclass(frozen=True, kw_only=True)
class Note(Event):
    """A line for people that is of no stage."""

    message: str = ""
    result: bool = False
    """Whether the command was run for it."""


def read_event(line: str) -> Event | None:
    """The event of a line; None where it is none, as a line that a kill cut off or one of a later version's kinds."""
    try:
        told = json.loads(line)
        kind = KINDS[told.pop("event")]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    types = _types(kind)
    told: dict[str, Any] = {name: float(value) if float in types[name] and type(value) is int else value
                            for name, value in told.items() if name in types}
    return kind(**told) if all(isinstance(value, types[name]) for name, value in told.items()) else None


def _short(value: Any) -> Any:
    return f"{value[:LONGEST - 1]}…" if isinstance(value, str) and len(value) > LONGEST else value


def _defaults(kind: type[Event]) -> list[tuple[str, Any]]:
    """Name and default of each field, in order."""
    if kind not in _DEFAULTS:
        bare = kind()
        _DEFAULTS[kind] = [(one.name, getattr(bare, one.name)) for one in fields(kind)]
    return _DEFAULTS[kind]


def _types(kind: type[Event]) -> dict[str, tuple[type, ...]]:
    """Field -> types that its value may have."""
    if kind not in _TYPES:
        hints = get_type_hints(kind)
        names = [one.name for one in fields(kind)]
        _TYPES[kind] = {name: tuple(getattr(part, "__origin__", part) for part in _parts(hints[name])) for name in names}
    return _TYPES[kind]


def _parts(hint: Any) -> tuple[Any, ...]:
    """Of `float | None` both; of others the one."""
    return get_args(hint) if type(None) in get_args(hint) else (hint,)


_DEFAULTS: dict[type[Event], list[tuple[str, Any]]] = {}
_TYPES: dict[type[Event], dict[str, tuple[type, ...]]] = {}
del KINDS["stage_event"]

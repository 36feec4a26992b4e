"""The action record: the key's parts, the outputs and the figures of one run, written once and never changed.

The first line of a record's file holds the sha256 of all lines after it; the whole is one JSON object.
"""

from __future__ import annotations

import functools
import hashlib
import json
import re
from collections.abc import Collection, Iterable
from dataclasses import asdict, dataclass, field, fields
from typing import Any, TypeVar

from gsac.cache.errors import CacheError
from gsac.cache.key import KeyParts

RECORD_VERSION = 2
UNSIGNED_VERSION = 1
"""Its records had no checksum."""
DIGEST = re.compile(r"[0-9a-f]{64}")
FIRST_LINE = '{{"sha256": "{}",'
PLAIN = {"str": str, "int": int, "float": (int, float)}

Kind = TypeVar("Kind")


@dataclass
class RunInfo:
    """Time, memory, metrics, warnings and notes of the run that made the outputs; a cached stage reports these."""

    started: str = ""
    """ISO 8601, UTC."""
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    peak_rss_mb: float = 0.0
    device: str = "cpu"
    metrics: dict[str, Any] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    findings: list[dict[str, Any]] = field(default_factory=list)
    """Code, severity, frames and figure of each warning, in their order; none in records made before there were codes."""
    notes: list[str] = field(default_factory=list)
    log_tail: str = ""
    timings: dict[str, Any] = field(default_factory=dict)
    """Figures that another run of the key would not repeat, which for that reason are in no output."""


@dataclass(frozen=True)
class Footprint:
    """File count, size, names and times of an object; where they differ from those recorded, the object is hashed again."""

    files: int
    bytes: int
    stamp: str
    """Digest of each file's name, size, mtime_ns and ctime_ns."""


@dataclass
class Record:
    """One finished, published run of a stage."""

    key: str
    parts: KeyParts
    outputs: dict[str, str]
    """Output's relative path -> tree digest."""
    info: RunInfo
    footprints: dict[str, Footprint] = field(default_factory=dict)

    @property
    def bytes(self) -> int:
        """Size of all outputs."""
        return sum(f.bytes for f in self.footprints.values())

    def to_json(self) -> str:
        """The text of the record's file."""
        content = json.dumps({"version": RECORD_VERSION, **asdict(self)}, indent=1, sort_keys=True).removeprefix("{\n") + "\n"
        return f"{FIRST_LINE.format(_checksum(content))}\n{content}"

    @classmethod
    def from_json(cls, text: str, outputs: Collection[str] | None = None) -> Record | None:
        """The record of a file's text; None unless it is as it was written, of this version, and its parts give its key.

        outputs: those that the stage declares, where the caller knows the stage; a record of others is none.
        """
        try:
            raw = json.loads(text) if _is_whole(text) else {}
            if raw.get("version") != RECORD_VERSION:
                return None
            record = cls(
                key=raw["key"],
                parts=_typed(KeyParts, raw["parts"]),
                outputs=dict(raw["outputs"]),
                info=_typed(RunInfo, raw["info"]),
                footprints={name: _typed(Footprint, footprint) for name, footprint in raw["footprints"].items()},
            )
            sound = record.parts.key == record.key and record.footprints.keys() == record.outputs.keys()
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError, CacheError):
            return None
        sound = sound and all(map(is_inside, record.outputs)) and all(map(is_digest, record.outputs.values()))
        return record if sound and (outputs is None or record.outputs.keys() == set(outputs)) else None


def is_of_other_version(text: str) -> bool:
    """Whether a record's file is one of an earlier or later version of gsac, which is no damage."""
    try:
        version = json.loads(text)["version"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return False
    return version == UNSIGNED_VERSION or isinstance(version, int) and version != RECORD_VERSION and _is_whole(text)


def is_inside(output: str) -> bool:
    """Whether an output's name is a plain relative path, which leads out of no folder."""
    return "\0" not in output and not {"", ".", ".."} & set(output.split("/"))


def is_digest(text: object) -> bool:
    """Whether it is a sha256 in lower-case hex."""
    return isinstance(text, str) and DIGEST.fullmatch(text) is not None


def _is_whole(text: str) -> bool:
    first, _, content = text.partition("\n")
    return first == FIRST_LINE.format(_checksum(content))


def _checksum(content: str) -> str:
    return hashlib.sha256(content.encode()).hexdigest()


def _typed(kind: type[Kind], raw: dict[str, Any]) -> Kind:
    """A dataclass of parsed JSON; TypeError where a field is of another type than its hint."""
    made = kind(**raw)
    for name, hint in _hints(kind):
        if not _fits(hint, getattr(made, name)):
            raise TypeError(f"{name} is not {hint}")
    return made


@functools.cache
def _hints(kind: type) -> list[tuple[str, str]]:
    """Name and hint of each field of a dataclass."""
    return [(one.name, str(one.type)) for one in fields(kind)]


def _fits(hint: str, value: Any) -> bool:
    if hint.startswith("dict[str, "):
        return isinstance(value, dict) and _fit_all(hint[len("dict[str, "):-1], value.values())
    if hint.startswith("list["):
        return isinstance(value, list) and _fit_all(hint[len("list["):-1], value)
    if isinstance(value, bool):  # which Python counts among the integers
        return hint not in PLAIN
    return isinstance(value, PLAIN.get(hint, object))


def _fit_all(hint: str, values: Iterable[Any]) -> bool:
    if hint == "str":  # hundreds a record: files and their digests
        return all(type(value) is str for value in values)
    return all(_fits(hint, value) for value in values)

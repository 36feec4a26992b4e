"""The action record: the key's parts, the outputs and the figures of one run, written once and never changed."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import Any

from gsac.cache.key import KeyParts

RECORD_VERSION = 1


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
    timings: dict[str, Any] = field(default_factory=dict)
    """Figures that another run of the key would not repeat, which for that reason are in no output."""
    warnings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    log_tail: str = ""


@dataclass(frozen=True)
class Footprint:
    """File count, size and times of an object; where they differ from those recorded, the object is hashed again."""

    files: int
    bytes: int
    stamp: int
    """Sum of the files' mtime_ns."""


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
        return json.dumps({"version": RECORD_VERSION, **asdict(self)}, indent=1, sort_keys=True) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Record | None:
        """The record of a file's text; None unless it is whole, of this version, and its parts give its key."""
        try:
            raw = json.loads(text)
            if raw.pop("version") != RECORD_VERSION:
                return None
            record = cls(
                key=raw["key"],
                parts=KeyParts(**raw["parts"]),
                outputs=raw["outputs"],
                info=RunInfo(**raw["info"]),
                footprints={name: Footprint(**f) for name, f in raw["footprints"].items()},
            )
            sound = record.parts.key == record.key and record.footprints.keys() == record.outputs.keys()
        except (ValueError, KeyError, TypeError, AttributeError):
            return None
        return record if sound else None

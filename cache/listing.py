"""Lists the results in the store, one row each."""

from __future__ import annotations

import time
from dataclasses import dataclass

from gsac.cache.objects import object_name
from gsac.cache.store import Store


@dataclass(frozen=True)
class Row:
    """One result."""

    stage: str
    key: str
    bytes: int
    age_s: float
    """s since it was last used."""
    seconds: float
    """Of the run that computed it."""
    objects: list[str]
    """Names of its outputs in the store."""


def ls(store: Store) -> list[Row]:
    """Every result, the last used first."""
    now, rows = time.time(), []
    for file in store.record_files():
        record = store.read(file)
        if record is not None:
            age = max(0.0, now - file.stat().st_mtime)
            names = [object_name(digest, output) for output, digest in record.outputs.items()]
            rows.append(Row(record.parts.stage, record.key, record.bytes, age, record.info.seconds, names))
    return sorted(rows, key=lambda row: row.age_s)

"""What a report was drawn from, kept in its head: it tells whether the page still speaks of what lies in the folder."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from gsac.cache.digest import typed_digest
from gsac.pipeline.report.results import Results

HEAD_BYTES = 4096
"""The first part of the page, which holds the marks."""
MARKS = {name: re.compile(f'<meta name="gsac-{name}" content="([^"]*)">') for name in ("drawn-from", "shows", "verdict", "grade")}
ROW_PARTS = ("name", "key", "seconds", "cpu_seconds", "peak_rss_mb", "timings", "inputs", "outputs", "warnings", "findings",
             "notes", "error", "stale_reason")
"""What a row of run.json gives to the page beside its status, which belongs to the last command: a run with nothing to do draws
nothing."""


@dataclass(frozen=True)
class Origin:
    """The marks of a page."""

    digest: str
    stages: tuple[str, ...]
    """Those whose results it shows."""
    verdict: str
    """The verdict in one line; empty without an avatar."""
    grade: str
    """Name of the verdict's `Grade`; empty without an avatar, and in pages that were written before it was kept."""


def drawn_from(results: Results) -> str:
    """Digest of all that a page shows of a folder: the results and what is said of them, the clip's name, the report's own code."""
    rows = [[row.get(part) for part in ROW_PARTS]
            for name, row in results.rows.items() for row in filter(None, (row, results.result(name)))]
    told = json.dumps([rows, results.clip_name, results.has_run, results.run.get("quality"), _own_code()], sort_keys=True)
    return typed_digest("report 1", told.encode())


def shown_stages(results: Results) -> list[str]:
    """Stages whose results a page of this folder shows."""
    return [name for name in results.rows if results.holds(name)]


def read_origin(page: Path) -> Origin | None:
    """The marks of a page; None where there is no page or it bears none."""
    try:
        with page.open("rb") as file:
            head = file.read(HEAD_BYTES).decode(errors="replace")
    except OSError:
        return None
    found = {name: mark[1] for name, pattern in MARKS.items() if (mark := pattern.search(head)) is not None}
    if not MARKS.keys() - {"grade"} <= found.keys():
        return None
    return Origin(found["drawn-from"], tuple(found["shows"].split()), found["verdict"], found.get("grade", ""))


@cache
def _own_code() -> str:
    """Digest of this package's files."""
    files = sorted(path for path in Path(__file__).parent.iterdir() if path.suffix in (".py", ".jinja"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()

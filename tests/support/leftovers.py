"""What killed commands may leave behind: in a store, in the folder of a run or a batch, among the system's temporary files."""

from __future__ import annotations

from pathlib import Path

PRIVATE = ("tmp", "leases", "partial")
"""Folders of a store that hold nothing while nobody is at work."""


def find_leftovers(store: Path, out: Path, temporary: Path) -> list[str]:
    """Paths of all that should not be there once a command has ended and nobody is at work."""
    found = [path for name in PRIVATE for path in (store / name).iterdir()]
    found += [path for path in (store / "models").rglob("*") if path.name.startswith((".", "pull-", "add-"))]
    found += [path for path in out.rglob(".*") if path.name != ".placed.json"]
    found += list(out.rglob("*kept*")) + list(out.rglob("logs/*.next"))
    return sorted(map(str, [*found, *temporary.iterdir()]))

"""Garbage collection: removes old results and left-overs of dead runs, never what a run in progress uses, nor unless it is forced
what the folder of a run shows.

gc holds the store's lock alone while it marks its victims and moves them aside, so no publish is half-way; it deletes them after.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from gsac.cache import objects
from gsac.cache.errors import from_os_error
from gsac.cache.lease import live_names
from gsac.cache.lock import if_free, shared
from gsac.cache.record import Record
from gsac.cache.roots import Root, find_roots, gone
from gsac.cache.store import Store

GRACE_S = 3600.0
"""A result used within this time stays, lease or not."""
QUARANTINE_S = 7 * 86400.0
"""Damaged objects are kept this long."""
PARTIAL_S = 86400.0
"""The partial work of a stopped run is kept this long for the next run."""


@dataclass
class GcReport:
    """Everything removed, or that would be on a dry run."""

    records: list[str] = field(default_factory=list)
    """`<stage>/<key>`"""
    objects: list[str] = field(default_factory=list)
    temps: list[str] = field(default_factory=list)
    quarantined: list[str] = field(default_factory=list)
    partial: list[str] = field(default_factory=list)
    """Keys of stopped runs whose partial work no run has taken up."""
    recent: list[str] = field(default_factory=list)
    """`<stage>/<key>` of those that a bound would take, had they not been used just now."""
    in_use: list[str] = field(default_factory=list)
    """Likewise, of those that a run in progress uses."""
    kept: dict[str, list[str]] = field(default_factory=dict)
    """Folder -> its links, of those that stay because the folder shows them."""
    lost: dict[str, list[str]] = field(default_factory=dict)
    """Folder -> its links that lead to nothing after a forced collection."""
    freed_bytes: int = 0
    kept_bytes: int = 0
    dry_run: bool = False


@dataclass
class _Entry:
    file: Path
    record: Record
    used: float
    live: bool
    """Whether a run in progress uses it."""
    recent: bool
    shown: bool
    """Whether the folder of a run shows an output."""
    doomed: bool = False
    spared: bool = False
    """Whether a bound would take it, and something keeps it."""

    @property
    def names(self) -> set[str]:
        return _names(self.record)

    @property
    def title(self) -> str:
        return f"{self.record.parts.stage}/{self.record.key}"

    def doom(self) -> bool:
        """Marks it; returns whether it may go."""
        self.spared = self.live or self.recent or self.shown
        self.doomed = not self.spared
        return self.doomed


def collect(
    store: Store,
    keep_days: float | None = None,
    max_bytes: int | None = None,
    dry_run: bool = False,
    grace_s: float = GRACE_S,
    force: bool = False,
) -> GcReport:
    """Removes results not used for `keep_days`, then the longest unused until the rest fits into `max_bytes`, then all rubbish.

    Rubbish: objects of no record, folders of dead runs, old quarantine, old partial work of stopped runs. Results used within
    `grace_s` stay, and what a folder shows stays with its record. dry_run: only reports; force: takes also what folders show.
    """
    report = GcReport(dry_run=dry_run)
    try:
        with store.private("gc") as aside, shared(store.root / "lock", alone=True), contextlib.ExitStack() as locks:
            roots = find_roots(store)
            shown: set[str] = set() if force else {name for root in roots for name in root.links.values()}
            entries, broken = _entries(store, grace_s, shown)
            stored = {path.name: path for path in (store.root / "objects").glob("*/*")}
            _choose(entries, {name: _bytes(path) for name, path in stored.items()}, keep_days, max_bytes)
            doomed = [entry for entry in entries if entry.doomed]
            named = {name for entry in entries if not entry.doomed for name in entry.names}
            wanted = named | shown | live_names(store)
            rubbish = [path for name, path in stored.items() if name not in wanted]
            temps = _orphans(store, locks)
            left = _abandoned(store, {entry.record.key for entry in entries})
            damaged = [path for path in (store.root / "quarantine").iterdir() if _age(path) > QUARANTINE_S]
            report.records = sorted(entry.title for entry in doomed)
            report.in_use = sorted(entry.title for entry in entries if entry.spared and entry.live)
            report.recent = sorted(entry.title for entry in entries if entry.spared and entry.recent and not entry.live)
            held = {name for entry in entries if entry.spared and not (entry.live or entry.recent) for name in entry.names}
            report.kept = _links(roots, (held | shown - named) & shown & stored.keys())
            report.lost = _links(roots, {path.name for path in rubbish})
            report.objects = sorted(path.name for path in rubbish)
            report.temps = sorted(path.name for path in temps)
            report.quarantined = sorted(path.name for path in damaged)
            report.partial = sorted(path.name for path in left)
            report.freed_bytes = sum(map(_bytes, [*rubbish, *temps, *left, *damaged]))
            report.kept_bytes = sum(_bytes(path) for name, path in stored.items() if name in wanted)
            if not dry_run:
                for file in [*broken, *(entry.file for entry in doomed), *gone(store)]:
                    store.drop(file)
                for number, path in enumerate([*rubbish, *temps, *left, *damaged]):
                    objects.unseal_folders(path)
                    os.rename(path, aside / str(number))
    except OSError as error:
        raise from_os_error(error, store.root) from error
    return report


def sweep_store(store: Store) -> None:
    """Removes what killed processes left: private folders, leases, and partial work that no run will take up."""
    with contextlib.suppress(OSError), contextlib.ExitStack() as locks:
        for path in _orphans(store, locks):
            objects.remove(path)
        with if_free(store.root / "lock") as free:  # no run then takes up any of it
            if free:
                for path in _abandoned(store, {file.stem for file in store.record_files()} if _has_partial(store) else set()):
                    objects.remove(path)


def _has_partial(store: Store) -> bool:
    return any((store.root / "partial").iterdir())


def _entries(store: Store, grace_s: float, shown: set[str]) -> tuple[list[_Entry], list[Path]]:
    """Sound records, the longest unused first, and the files of records that are not sound."""
    live, now = live_names(store), time.time()
    entries, broken = [], []
    for file in store.record_files():
        record, used = store.read(file), file.lstat().st_mtime
        if record is None:
            broken.append(file)
        else:
            is_shown = not shown.isdisjoint(_names(record))
            is_live = not live.isdisjoint({record.key, *_names(record)})
            entries.append(_Entry(file, record, used, is_live, now - used < grace_s, is_shown))
    return sorted(entries, key=lambda entry: entry.used), broken


def _choose(entries: list[_Entry], sizes: dict[str, int], keep_days: float | None, max_bytes: int | None) -> None:
    """Marks as doomed the results that are too old, then the longest unused until the rest fits; shared objects count once."""
    if keep_days is not None:
        oldest = time.time() - keep_days * 86400
        for entry in entries:
            if entry.used < oldest:
                entry.doom()
    if max_bytes is None:
        return
    users = Counter(name for entry in entries if not entry.doomed for name in entry.names)
    total = sum(sizes.get(name, 0) for name in users)
    for entry in entries:
        if total <= max_bytes:
            break
        if not entry.doomed and entry.doom():
            users.subtract(entry.names)
            total -= sum(sizes.get(name, 0) for name in entry.names if users[name] == 0)


def _links(roots: list[Root], names: set[str]) -> dict[str, list[str]]:
    """Folder -> its links to these objects; folders without one are left out."""
    found = {str(root.folder): [path for path, name in root.links.items() if name in names] for root in roots}
    return {folder: paths for folder, paths in found.items() if paths}


def _names(record: Record) -> set[str]:
    return {objects.object_name(digest, output) for output, digest in record.outputs.items()}


def _orphans(store: Store, held: contextlib.ExitStack) -> list[Path]:
    """Folders and lock files in tmp/ whose owner is dead; their locks are held until they have been moved.

    A run that has just made its lock file and not locked it yet then waits for us, and makes another.
    """
    orphans = []
    for name in sorted({path.stem for path in (store.root / "tmp").iterdir()}):
        folder = store.root / "tmp" / name
        if held.enter_context(if_free(folder.with_suffix(".lock"))) is not False:
            orphans += [path for path in (folder, folder.with_suffix(".lock")) if path.exists()]
    return orphans


def _abandoned(store: Store, done: set[str]) -> list[Path]:
    """Folders of partial/ that no living run uses and that are old, or whose key has its result."""
    live = live_names(store)
    return [path for path in (store.root / "partial").iterdir()
            if path.name not in live and (path.name in done or _age(path) > PARTIAL_S)]


def _age(path: Path) -> float:
    """Seconds since the file or folder was put where it is."""
    return time.time() - path.lstat().st_ctime


def _bytes(path: Path) -> int:
    footprint = objects.measure(path)
    return footprint.bytes if footprint else 0

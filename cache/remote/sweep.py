"""Removes from the shared results what nobody needs: old ones, objects of no record, left claims and files half written.

Ages are by the server's clock, and nothing younger than the grace period goes. Who is just pushing a result puts its objects first:
one of them that was there already, and unused for longer than that, may go in between. The result is then none: it is computed and
pushed anew.
"""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field
from datetime import timedelta

from gsac.cache.record import Record, is_digest
from gsac.cache.remote.bucket import Bucket, Entry
from gsac.cache.remote.results import ACTIONS, LEASES, OBJECTS
from gsac.cache.store import LARGEST

GRACE_S = 86400.0


@dataclass
class SweepReport:
    """Everything removed, or that would be on a dry run."""

    records: list[str] = field(default_factory=list)
    """`<stage>/<key>`, of old ones and of those that are not as they were written."""
    objects: list[str] = field(default_factory=list)
    """Digests."""
    claims: list[str] = field(default_factory=list)
    """Keys."""
    unfinished: list[str] = field(default_factory=list)
    """Files of a shared folder whose writer died."""
    freed_bytes: int = 0
    kept_bytes: int = 0
    dry_run: bool = False


def sweep_remote(bucket: Bucket, keep_days: float | None = None, dry_run: bool = False, grace_s: float = GRACE_S) -> SweepReport:
    """Removes results that were put there more than `keep_days` ago, then all rubbish older than `grace_s`.

    dry_run: only reports. Raises RemoteError.
    """
    report, now = SweepReport(dry_run=dry_run), bucket.now()
    kept_s = None if keep_days is None else keep_days * 86400.0

    def is_older(entry: Entry, seconds: float) -> bool:
        return now - entry.modified > timedelta(seconds=max(seconds, grace_s))

    packs = list(bucket.list(OBJECTS))  # before the records: what is pushed in between is named by one
    youngest: dict[str, Entry] = {}
    for entry in packs:
        pack = _pack_of(entry)
        youngest[pack] = max(youngest.get(pack, entry), entry, key=lambda one: one.modified)
    doomed: list[str] = []
    named: set[str] = set()
    for entry in bucket.list(ACTIONS):
        record = _read(bucket, entry)
        if is_older(entry, 0.0) and (record is None or (kept_s is not None and is_older(entry, kept_s))):
            report.records.append(entry.name.removeprefix(f"{ACTIONS}/").removesuffix(".json"))
            report.freed_bytes += entry.bytes
            doomed.append(entry.name)
        elif record is not None:
            named.update(record.outputs.values())
    rubbish = {pack for pack, entry in youngest.items() if pack not in named and is_older(entry, 0.0)}
    report.objects = sorted(rubbish)
    sizes: Counter[bool] = Counter()
    for entry in packs:
        sizes[_pack_of(entry) in rubbish] += entry.bytes
    report.freed_bytes, report.kept_bytes = report.freed_bytes + sizes[True], sizes[False]
    for entry in bucket.list(LEASES):
        if is_older(entry, 0.0):
            report.claims.append(entry.name.removeprefix(f"{LEASES}/").removesuffix(".json"))
            doomed.append(entry.name)
    left = [file for file in bucket.unfinished() if time.time() - file.lstat().st_mtime > grace_s]
    report.unfinished = [str(file) for file in left]
    report.freed_bytes += sum(file.lstat().st_size for file in left)
    if not dry_run:
        bucket.delete(doomed)
        # Last parts first: who pushes takes an object for whole whose last part is there.
        bucket.delete([entry.name for entry in reversed(packs) if _pack_of(entry) in rubbish])
        for file in left:
            file.unlink(missing_ok=True)
    return report


def _pack_of(entry: Entry) -> str:
    """The digest that a part belongs to; its own name where it is no part."""
    parts = entry.name.split("/")
    return parts[2] if len(parts) == 4 and is_digest(parts[2]) else entry.name


def _read(bucket: Bucket, entry: Entry) -> Record | None:
    found = bucket.read(entry.name, LARGEST) if entry.bytes <= LARGEST else None
    record = Record.from_json(found.data.decode(errors="replace")) if found is not None else None
    return record if record is not None and entry.name == f"{ACTIONS}/{record.parts.stage}/{record.key}.json" else None

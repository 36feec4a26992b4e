"""Publishes a result: it appears in the store whole or not at all, whenever the process dies.

The steps run in the order of STEPS. Nobody can find a result before its action record, which is written last. An object
without a record is rubbish that gc removes.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from gsac.cache import objects
from gsac.cache.digest import tree_digest
from gsac.cache.errors import CacheError, IntegrityError, from_os_error
from gsac.cache.key import KeyParts
from gsac.cache.lock import shared
from gsac.cache.record import Record, RunInfo
from gsac.cache.store import Store, read_text

STEPS = (
    "started",
    "hashed",
    "sealed",
    "synced",
    "placed",
    "places synced",
    "record written",
    "recorded",
    "record synced",
)
"""`placed` occurs once an output. A test kills the process right after each step."""


def publish(
    store: Store,
    parts: KeyParts,
    folder: Path,
    outputs: tuple[str, ...],
    info: RunInfo,
    replace: bool = False,
    step: Callable[[str], None] = lambda name: None,
) -> Record:
    """Moves `folder/<output>` into the store and writes the record; an equal key that is published already wins.

    replace: the new result takes the place of a published one (a forced run), whose record stays beside it until gc
    finds it unused; step: called after each of STEPS. Returns the record that is valid now.
    Raises CacheReadOnlyError, CacheFullError or CacheError; no lookup then sees any change.
    """
    needed = None
    try:
        step("started")
        digests, footprints = {}, {}
        for output in outputs:
            objects.require_plain(folder / output, output)
            digests[output] = tree_digest(folder / output, objects.NO_MEMO)[0]
            footprints[output] = objects.measure(folder / output)
        needed = sum(f.bytes for f in footprints.values())
        step("hashed")
        for output in outputs:
            objects.seal_files(folder / output)
        step("sealed")
        for output in outputs:
            objects.sync(folder / output)
        step("synced")
        with shared(store.root / "lock"):
            for output in outputs:
                footprints[output] = _place(store, folder / output, digests[output], output)
                step("placed")
            for place in {objects.object_path(store.root, d, o).parent for o, d in digests.items()}:
                objects.sync_one(place)
            objects.sync_one(store.root / "objects")
            step("places synced")
            return _record(store, Record(parts.key, parts, digests, info, footprints), replace, step)
    except OSError as error:
        raise from_os_error(error, store.root, needed) from error


def _place(store: Store, source: Path, digest: str, output: str) -> objects.Footprint:
    target = objects.object_path(store.root, digest, output)
    objects.make_folder(target.parent)
    if os.path.lexists(target) and not objects.is_sound(target, digest):
        store.quarantine(target, digest)
        if os.path.lexists(target) and not objects.is_sound(target, digest):
            raise IntegrityError(f"the cached object {target} is damaged and cannot be moved away by you; its owner can, "
                                 "by `gsac cache verify`")
    if not target.exists():
        try:
            os.rename(source, target)
        except OSError:
            if not target.exists():  # else another publisher was first with the same content
                raise
        objects.seal_folders(target)
    footprint = objects.measure(target)
    if footprint is None:
        raise IntegrityError(f"output {output} could not be placed at {target}")
    store.saw_whole(target)
    return footprint


def _record(store: Store, record: Record, replace: bool, step: Callable[[str], None]) -> Record:
    final = store.record_path(record.parts.stage, record.key)
    text = record.to_json()
    if Record.from_json(text, record.outputs) is None:
        raise CacheError(f"a record of {record.parts.stage} with the outputs {', '.join(record.outputs)} would not be believed")
    objects.make_folder(final.parent)
    with store.private(record.parts.stage) as folder:
        temp = folder / "record.json"
        temp.write_text(text)
        objects.seal_files(temp)
        objects.sync_one(temp)
        step("record written")
        for _ in range(3):
            with store.record_change(record.key):
                if replace:
                    _set_aside(store, final, folder)
                if replace or not os.path.lexists(final):
                    os.replace(temp, final)
                    break
            first = store.lookup(record.key, record.outputs)  # removes a record that is not whole
            if first is not None:
                return first
        else:
            raise CacheError(f"the record {final} is neither whole nor can it be replaced")
    step("recorded")
    objects.sync_one(final.parent)
    step("record synced")
    return record


def _set_aside(store: Store, record: Path, folder: Path) -> None:
    """Keeps a record under a second name, made in the private folder: runs in progress may be using its outputs."""
    if store.read(record) is None:
        if os.path.lexists(record):
            store.drop(record)
        return
    copy, stat = folder / "before.json", record.stat()
    copy.write_text(read_text(record))
    objects.seal_files(copy)
    os.utime(copy, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    os.replace(copy, record.with_suffix(f".{time.time_ns()}.json"))

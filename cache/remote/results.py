"""Fetches results of the shared store into this one, and pushes those of this one there."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from enum import Enum

from gsac.cache.errors import CacheFullError, from_os_error
from gsac.cache.publish import publish
from gsac.cache.record import Record, is_of_other_version
from gsac.cache.remote.bucket import Bucket
from gsac.cache.remote.pack import PART, WrongBytesError, count_parts, pack_parts, unpack
from gsac.cache.store import LARGEST, Store

ACTIONS, OBJECTS, LEASES = "actions", "objects", "leases"
SPARE = 64 << 20
"""Bytes that a fetched result leaves free on the disk."""


class Pushed(Enum):
    """What became of a result that was to be pushed; the value is the word of --json."""

    NEW = "pushed"
    THERE = "there"

    @property
    def sentence(self) -> str:
        return {Pushed.NEW: "put into the shared store", Pushed.THERE: "the shared store has a result of that key"}[self]


class Results:
    """The results in one bucket, by stage and key."""

    def __init__(self, bucket: Bucket) -> None:
        self.bucket = bucket
        self.wrong: set[str] = set()
        """Keys whose result there was found to be not as recorded: theirs is written over."""

    def fetch(self, store: Store, stage: str, key: str, outputs: Collection[str] | None = None) -> Record | None:
        """The shared result of a key, put into `store`; None where there is none, or where a byte of it is not as recorded.

        outputs: those that the stage declares, as `Store.lookup` takes them. Raises RemoteError, or CacheError as `publish` does.
        """
        found = self.bucket.read(record_name(stage, key), LARGEST) if key not in self.wrong else None
        if found is None:
            return None
        text = found.data.decode(errors="replace")
        record = store.sound(store.record_path(stage, key), text, outputs)
        try:
            if record is None:
                if is_of_other_version(text):
                    return None
                raise WrongBytesError("its record is not as it was written, or is another's")
            return self._publish(store, record)
        except WrongBytesError as error:
            self.wrong.add(key)
            store.say(f"{stage}: the result {key[:12]} in {self.bucket.url} is not used: {error}")
            return None

    def push(self, store: Store, record: Record, force: bool = False) -> Pushed:
        """Puts a result there, its objects first; one of its key that is there stays, unless `force` or found wrong.

        Raises RemoteError, or IntegrityError where an object here is damaged.
        """
        name = record_name(record.parts.stage, record.key)
        over = force or record.key in self.wrong
        if not over and self.bucket.has(name):
            return Pushed.THERE
        for output, digest in record.outputs.items():
            path = store.path(record, output)
            last = part_name(digest, count_parts(path, digest) - 1)
            if over or not self.bucket.has(last):
                for number, part in enumerate(pack_parts(path, digest)):
                    self._put(part_name(digest, number), part, over)
        new = self._put(name, record.to_json().encode(), over)
        self.wrong.discard(record.key)
        return Pushed.NEW if new else Pushed.THERE

    def keys(self) -> Iterator[tuple[str, str]]:
        """Stage and key of every record there."""
        for entry in self.bucket.list(ACTIONS):
            table, stage, file = [*entry.name.split("/"), "", ""][:3]
            if table == ACTIONS and file.endswith(".json"):
                yield stage, file.removesuffix(".json")

    def _publish(self, store: Store, record: Record) -> Record:
        free = os.statvfs(store.root)
        if any(footprint.bytes < 0 for footprint in record.footprints.values()):
            raise WrongBytesError("its record names a size below zero")
        if record.bytes + SPARE > free.f_bavail * free.f_frsize:
            raise CacheFullError(f"no room in the cache folder {store.root} for a shared result of {record.bytes:,} bytes")
        with store.private(record.parts.stage) as folder:
            try:
                for output, digest in record.outputs.items():
                    target = folder / output
                    target.parent.mkdir(parents=True, exist_ok=True)
                    unpack(self._parts(digest), digest, record.footprints[output], target)
            except OSError as error:
                raise from_os_error(error, store.root, record.bytes) from error
            return publish(store, record.parts, folder, tuple(record.outputs), record.info)

    def _parts(self, digest: str) -> Iterator[bytes]:
        number = 0
        while True:
            part = self.bucket.read(part_name(digest, number), PART, large=True)
            if part is None:
                return
            yield part.data
            number += 1

    def _put(self, name: str, data: bytes, over: bool) -> bool:
        """Whether it was put: over one that is there, or where none is."""
        if not over:
            return self.bucket.put_new(name, data)
        self.bucket.put(name, data)
        return True


def record_name(stage: str, key: str) -> str:
    """Where the record of a key lies."""
    return f"{ACTIONS}/{stage}/{key}.json"


def part_name(digest: str, number: int) -> str:
    """Where a part of the pack of a digest lies."""
    return f"{OBJECTS}/{digest[:2]}/{digest}/{number:06d}"

"""The store: a folder of objects named by content, and of action records, which name the run that made them.

objects/ab/<digest>[suffix]      outputs, files or folders, read-only
actions/<stage>/<key>.json       records; a result counts from the moment its record is there
actions/<stage>/<key>.<ns>.json  records of results that a forced run has replaced
tmp/ leases/ quarantine/         work in progress, locks, what was found damaged
partial/<key>/                   work of a stopped run, for the next run of the same key
models/<sha256>/<name>           model files, which gc leaves alone
roots/                           folders that show results, which gc keeps
memo.sqlite lock                 stat memo; lock held by publishers together, by gc alone
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from gsac.cache import objects
from gsac.cache.errors import from_os_error
from gsac.cache.key import KeyParts
from gsac.cache.lock import exclusive
from gsac.cache.memo import Memo, memo_in
from gsac.cache.record import Record
from gsac.cache.root import default_root

FOLDERS = ("objects", "actions", "tmp", "leases", "quarantine", "partial", "models", "roots")
USED_AGAIN_S = 3600
"""s: a hit renews the record's time, by which gc decides, at most this often."""


class Store:
    """Results by key. say: called with a sentence about each damaged object.

    below: a store to read from where this one has no result, such as a shared one that is read-only.
    """

    def __init__(self, root: Path, say: Callable[[str], None] = lambda message: None, below: Store | None = None) -> None:
        self.root = Path(root).absolute()
        self.say = say
        self.below = below
        with contextlib.suppress(OSError):  # a read-only store can still be read; writing to it raises
            for name in FOLDERS:
                (self.root / name).mkdir(parents=True, exist_ok=True)

    @classmethod
    def open(cls, root: Path | None = None, say: Callable[[str], None] = lambda message: None) -> Store:
        """The store at `root`, else $GSAC_CACHE, else ~/.cache/gsac."""
        return cls(root or default_root(), say)

    @property
    def memo(self) -> Memo:
        """The memo of file digests beside the store's objects."""
        return memo_in(self.root)

    @property
    def writable(self) -> bool:
        """Whether results can be published here."""
        return os.access(self.root / "tmp", os.W_OK) and os.access(self.root / "actions", os.W_OK)

    def record_path(self, stage: str, key: str) -> Path:
        """Where the record of a key lies."""
        return self.root / "actions" / stage / f"{key}.json"

    def record_files(self, stage: str = "*") -> list[Path]:
        """Files of all records, or of one stage's."""
        return list((self.root / "actions").glob(f"{stage}/*.json"))

    def path(self, record: Record, output: str) -> Path:
        """The output's file or folder in the store; read-only."""
        path = objects.object_path(self.root, record.outputs[output], output)
        return self.below.path(record, output) if self.below is not None and not path.exists() else path

    def lookup(self, key: str, deep: bool = False) -> Record | None:
        """The record of a finished run, if all its outputs are there and unchanged.

        An output whose size or time is not as recorded is hashed again; deep: every byte is read. A damaged output goes to
        quarantine, its record is dropped, and the answer is None: a miss, not an error.
        """
        for file in (self.root / "actions").glob(f"*/{key}.json"):
            text = _read(file)
            record = Record.from_json(text)
            if record is not None and all([self._holds(record, output, deep) for output in record.outputs]):
                self._used(file)
                return record
            with contextlib.suppress(OSError), self.record_change(key):
                if _read(file) == text:  # else a sound one has taken its place
                    file.unlink(missing_ok=True)
        return self.below.lookup(key, deep) if self.below is not None else None

    def read(self, file: Path) -> Record | None:
        """The record in a file; None if it is torn or of another version."""
        return Record.from_json(_read(file))

    def record_change(self, key: str) -> contextlib.AbstractContextManager:
        """Held while a record that is there already is replaced or dropped."""
        return exclusive(self.root / "leases" / f"{key}.record")

    @contextlib.contextmanager
    def private(self, stage: str) -> Iterator[Path]:
        """An empty private folder on the store's filesystem, removed at the end, or by gc if its owner died."""
        folder = self.root / "tmp" / f"{stage}-{os.getpid()}-{os.urandom(6).hex()}"
        try:
            lock = contextlib.ExitStack()
            lock.enter_context(exclusive(folder.with_suffix(".lock")))
            folder.mkdir()
        except OSError as error:
            lock.close()
            raise from_os_error(error, self.root) from error
        with lock:
            try:
                yield folder
            finally:
                objects.remove(folder)

    def partial(self, key: str) -> Path:
        """Folder that a run of the key may make and, unlike `private`, leave behind; only the run that holds the key touches it."""
        return self.root / "partial" / key

    def previous(self, stage: str, like: KeyParts) -> Record | None:
        """The record of the stage that differs least from `like` (the newest of equals), to explain a new key."""
        newest = sorted(self.record_files(stage), key=_mtime, reverse=True)[:200]
        records = [record for record in map(self.read, newest) if record is not None]
        if self.below is not None:
            records += filter(None, [self.below.previous(stage, like)])
        return min(records, key=lambda record: len(record.parts.diff(like)), default=None)

    def usual_seconds(self, stage: str) -> float | None:
        """s, of the stage's run that was used last; None without one."""
        newest = max(self.record_files(stage), key=_mtime, default=None)
        record = self.read(newest) if newest is not None else None
        return record.info.seconds if record is not None else self.below.usual_seconds(stage) if self.below is not None else None

    def quarantine(self, path: Path, digest: str) -> None:
        """Moves a damaged object to quarantine/, unless another process has put a sound one in its place."""
        with contextlib.suppress(OSError), exclusive(self.root / "leases" / f"{path.name}.quarantine"):
            if path.exists() and not objects.is_sound(path, digest):
                target = self.root / "quarantine" / f"{path.name}.{time.time_ns()}"
                objects.unseal_folders(path)
                os.rename(path, target)
                self.say(f"the cached object {path.name} was damaged: moved to {target}, to be computed again")

    def _holds(self, record: Record, output: str, deep: bool) -> bool:
        digest = record.outputs[output]
        path = objects.object_path(self.root, digest, output)
        seen = objects.measure(path)
        if seen is not None and not deep and seen == record.footprints[output]:
            return True
        if seen is not None and objects.is_sound(path, digest, None if deep else self.memo):
            return True
        if path.exists():
            self.quarantine(path, digest)
        return False

    def _used(self, file: Path) -> None:
        with contextlib.suppress(OSError):
            if time.time() - _mtime(file) > USED_AGAIN_S:
                os.utime(file)


def _read(file: Path) -> str:
    try:
        return file.read_text()
    except (OSError, UnicodeDecodeError):
        return ""


def _mtime(file: Path) -> float:
    try:
        return file.stat().st_mtime
    except OSError:
        return 0.0

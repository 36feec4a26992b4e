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
import itertools
import os
import stat as modes
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from gsac.cache import objects
from gsac.cache.errors import CacheError, from_os_error
from gsac.cache.key import KeyParts
from gsac.cache.lock import exclusive
from gsac.cache.memo import Memo, memo_in
from gsac.cache.record import Record
from gsac.cache.root import default_root, make_root

FOLDERS = ("objects", "actions", "tmp", "leases", "quarantine", "partial", "models", "roots")
NEEDED = ("objects", "actions", "tmp", "leases", "partial")
"""Those that a run writes to."""
LARGEST = 16 << 20
"""Bytes of a record at most."""
DIGITS = 64
USED_AGAIN_S = 3600
"""s: a hit renews the record's time, by which gc decides, at most this often."""


class Store:
    """Results by key. say: called with a sentence about each damaged object.

    below: a store to read from where this one has no result, such as a shared one that is read-only. make: its folders are made
    where they are not there.
    """

    def __init__(
        self, root: Path, say: Callable[[str], None] = lambda message: None, below: Store | None = None, make: bool = True,
    ) -> None:
        self.root = Path(root).absolute()
        self.say = say
        self.below = below
        self._read: dict[Path, objects.Footprint] = {}
        self._damaged: set[Path] = set()
        if make:
            with contextlib.suppress(OSError):  # a read-only store can still be read; writing to it raises
                self._make()

    @classmethod
    def open(cls, root: Path | None = None, say: Callable[[str], None] = lambda message: None, make: bool = True) -> Store:
        """The store at `root`, else $GSAC_CACHE, else ~/.cache/gsac."""
        return cls(root or default_root(), say, make=make)

    @property
    def memo(self) -> Memo:
        """The memo of file digests beside the store's objects."""
        return memo_in(self.root)

    @property
    def writable(self) -> bool:
        """Whether results can be published here."""
        return all((self.root / name).is_dir() and os.access(self.root / name, os.W_OK) for name in NEEDED)

    def record_path(self, stage: str, key: str) -> Path:
        """Where the record of a key lies."""
        return self.root / "actions" / stage / f"{key}.json"

    def record_files(self, stage: str = "*") -> list[Path]:
        """Files of all records, or of one stage's."""
        return list((self.root / "actions").glob(f"{stage}/*.json"))

    def path(self, record: Record, output: str) -> Path:
        """The output's file or folder in the store; read-only."""
        return self.where(record.outputs[output], output)

    def where(self, digest: str, output: str) -> Path:
        """Where the object of a digest lies; output: its relative path, or its port."""
        path = objects.object_path(self.root, digest, output)
        return self.below.where(digest, output) if self.below is not None and not path.exists() else path

    def lookup(self, key: str, outputs: Collection[str] | None = None, deep: bool = False) -> Record | None:
        """The record of a finished run, if it is whole and all its outputs are there and unchanged.

        outputs: those that the stage declares, where the caller knows the stage; a record of others does not count. An output
        whose footprint is not as recorded is hashed again; deep: every byte is read. A damaged output goes to quarantine, its
        record is dropped, and the answer is None: a miss, not an error.
        """
        for file in self._places(key):
            text = read_text(file)
            record = self.sound(file, text, outputs)
            if record is not None and all([self._holds(record, output, deep) for output in record.outputs]):
                self._used(file, text)
                return record
            self.drop_unchanged(file, text)
        return self.below.lookup(key, outputs, deep) if self.below is not None else None

    def read(self, file: Path) -> Record | None:
        """The record in a file; None if it is not whole, of another version, or of another key than its file's name says."""
        return self.sound(file, read_text(file))

    def sound(self, file: Path, text: str, outputs: Collection[str] | None = None) -> Record | None:
        """The record in the text of a file, as `read` gives it."""
        record = Record.from_json(text, outputs)
        place = (file.parent.name, file.name.partition(".")[0])
        return record if record is not None and place == (record.parts.stage, record.key) else None

    def drop(self, file: Path) -> None:
        """Removes a record that does not count; a folder in its place goes to quarantine."""
        if file.is_dir() and not file.is_symlink():
            self.set_aside(file)
        else:
            file.unlink(missing_ok=True)

    def drop_unchanged(self, file: Path, text: str) -> None:
        """Removes a record that was read and does not count, unless a sound one has taken its place."""
        with contextlib.suppress(OSError), self.record_change(file.name.partition(".")[0]):
            if read_text(file) == text:
                self.drop(file)

    def is_whole(self, path: Path) -> bool:
        """Whether every byte of an object is as published; read once, as long as its footprint stays. A damaged one goes to
        quarantine, or is not used any more where the store can only be read."""
        seen = objects.measure(path)
        if seen is None or self._read.get(path) != seen:
            if not objects.is_sound(path, path.name[:DIGITS]):
                holder = self.below if self.below is not None and not path.is_relative_to(self.root) else self
                holder.quarantine(path, path.name[:DIGITS])
                return False
            self.saw_whole(path)
        return True

    def saw_whole(self, path: Path) -> None:
        """Notes that this process has just read, or written, every byte of an object."""
        seen = objects.measure(path)
        if seen is not None:
            self._read[path] = seen

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
        folder = self.root / "partial" / key
        if folder.is_symlink():  # not of gsac's making, and what is written there lands elsewhere
            folder.unlink()
        return folder

    def previous(self, stage: str, like: KeyParts) -> Record | None:
        """The record of the stage that differs least from `like` (the newest of equals), to explain a new key."""
        newest = sorted(self.record_files(stage), key=_mtime, reverse=True)[:200]
        records = [record for record in map(self.read, newest) if record is not None]
        if self.below is not None:
            records += filter(None, [self.below.previous(stage, like)])
        return min(records, key=lambda record: len(record.parts.diff(like)), default=None)

    def recent(self, stage: str, most: int) -> list[Record]:
        """Records of the stage's runs, those that were used last first."""
        newest = sorted(self.record_files(stage), key=_mtime, reverse=True)
        found = list(itertools.islice((record for record in map(self.read, newest) if record is not None), most))
        more = most - len(found)
        return found + (self.below.recent(stage, more) if self.below is not None and more else [])

    def quarantine(self, path: Path, digest: str) -> None:
        """Moves a damaged object to quarantine/, unless another process has put a sound one in its place."""
        self._damaged.add(path)
        with contextlib.suppress(OSError), exclusive(self.root / "leases" / f"{path.name}.quarantine"):
            if os.path.lexists(path) and not objects.is_sound(path, digest):
                target = self.set_aside(path)
                self.say(f"the cached object {path.name} was damaged: moved to {target}, to be computed again")
            self._damaged.discard(path)

    def set_aside(self, path: Path) -> Path:
        """Moves what does not belong into the store to quarantine/, and returns where it lies now."""
        target = self.root / "quarantine" / f"{path.name}.{time.time_ns()}"
        objects.unseal_folders(path)
        os.rename(path, target)
        return target

    def _make(self) -> None:
        make_root(self.root)
        for name in FOLDERS:
            folder = self.root / name
            if folder.is_file() and not folder.is_symlink():
                aside = self.root / f"{name}-{time.time_ns()}"
                folder.rename(aside)
                self.say(f"gsac: warning: {folder} was a file where the cache needs a folder; it is kept as {aside}")
            objects.make_folder(folder)

    def _places(self, key: str) -> list[Path]:
        """Files of a key's records, and whatever else lies in their place."""
        with contextlib.suppress(OSError), os.scandir(self.root / "actions") as stages:
            files = [os.path.join(stage.path, f"{key}.json") for stage in stages]
            return [Path(file) for file in files if os.path.lexists(file)]
        return []

    def _holds(self, record: Record, output: str, deep: bool) -> bool:
        digest = record.outputs[output]
        path = objects.object_path(self.root, digest, output)
        if path in self._damaged:
            return False
        seen = objects.measure(path)
        if seen is not None and not deep and seen == record.footprints[output]:
            return True
        if seen is not None and objects.is_sound(path, digest, None if deep else self.memo):
            return True
        if os.path.lexists(path):
            self.quarantine(path, digest)
        return False

    def _used(self, file: Path, text: str) -> None:
        """Renews the time of a record; where the file is another user's, by a copy in its place."""
        with contextlib.suppress(OSError, CacheError):
            if time.time() - _mtime(file) <= USED_AGAIN_S:
                return
            try:
                os.utime(file)
            except PermissionError:
                with self.private("used") as folder, self.record_change(file.stem):
                    (folder / file.name).write_text(text)
                    objects.seal_files(folder / file.name)
                    if read_text(file) == text:
                        os.replace(folder / file.name, file)


def read_text(file: Path) -> str:
    """The text of a record's file; empty where it is no file, cannot be read, or is larger than any record."""
    try:
        stat = file.lstat()
        return file.read_bytes().decode() if modes.S_ISREG(stat.st_mode) and stat.st_size <= LARGEST else ""
    except (OSError, UnicodeDecodeError):
        return ""


def _mtime(file: Path) -> float:
    try:
        return file.stat().st_mtime
    except OSError:
        return 0.0

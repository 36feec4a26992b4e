"""Remembers facts about a file while its stat stays the same: its digest, or a module's digest and imports.

One small SQLite file in the store, safe under many processes. It only saves time: if it is unreadable, locked or
lost, files are hashed again. A file touched within the last two seconds is never memoised, since it could change
again within the clock's grain and keep its stat.
"""

from __future__ import annotations

import os
import sqlite3
import time
from _thread import get_ident
from functools import lru_cache
from pathlib import Path

from gsac.cache.root import make_root

SETTLED_NS = 2_000_000_000
"""A file touched more recently may change again and keep its stat."""
SCHEMA = """create table if not exists memo (
    kind text, device int, inode int, size int, mtime_ns int, ctime_ns int, value text,
    primary key (kind, device, inode)) without rowid"""


def is_settled(stat: os.stat_result) -> bool:
    """Whether the file was last touched long enough ago, and not in the future, for its stat to identify its content."""
    return time.time_ns() - max(stat.st_mtime_ns, stat.st_ctime_ns) > SETTLED_NS


class Memo:
    """Values by kind and stat. `put` is buffered; `flush` writes."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self._pending: list[tuple] = []
        self._connection = self._open()

    def get(self, kind: str, stat: os.stat_result) -> str | None:
        """The value of this kind, None where it is not known."""
        if self._connection is None:
            return None
        try:
            row = self._connection.execute(
                "select value from memo where kind=? and device=? and inode=? and size=? and mtime_ns=? and ctime_ns=?",
                (kind, *identity(stat)),
            ).fetchone()
        except sqlite3.Error:
            return None
        return row[0] if row else None

    def put(self, kind: str, stat: os.stat_result, value: str, sealed: bool = False) -> None:
        """Remembers a value; not of a file that was touched just now, unless it is sealed, the store's own that nobody changes."""
        if sealed or is_settled(stat):
            self._pending.append((kind, *identity(stat), value))

    def flush(self) -> None:
        """Writes the values that `put` has buffered."""
        rows, self._pending = self._pending, []
        if not rows or self._connection is None:
            return
        try:
            with self._connection:
                self._connection.executemany("insert or replace into memo values (?,?,?,?,?,?,?)", rows)
        except sqlite3.Error:
            pass  # locked, full or read-only: the next run hashes again

    def _open(self) -> sqlite3.Connection | None:
        for _ in range(2):
            try:
                make_root(self.file.parent)
                is_new = not self.file.exists()
                connection = sqlite3.connect(self.file, timeout=2)
                connection.execute(SCHEMA)
                if is_new:  # for all users of the store, whatever the umask
                    self.file.chmod(self.file.parent.stat().st_mode & 0o666)
                return connection
            except (OSError, sqlite3.OperationalError):
                return self._open_read_only()
            except sqlite3.DatabaseError:
                self.file.unlink(missing_ok=True)  # not a database any more
        return None

    def _open_read_only(self) -> sqlite3.Connection | None:
        try:
            connection = sqlite3.connect(f"{self.file.absolute().as_uri()}?mode=ro", uri=True, timeout=2)
            connection.execute("select 1 from memo limit 1")
            return connection
        except sqlite3.Error:
            return None


def memo_in(root: Path) -> Memo:
    """The memo of the store at `root`; one a process and thread, since SQLite connections must not be carried along."""
    return _memo(root, os.getpid(), get_ident())


@lru_cache(maxsize=16)
def _memo(root: Path, pid: int, thread: int) -> Memo:
    return Memo(root / "memo.sqlite")


def identity(stat: os.stat_result) -> tuple[int, int, int, int, int]:
    """The fields of a stat that identify the content; not the access time, which reading changes."""
    inode = stat.st_ino if stat.st_ino < 2**63 else stat.st_ino - 2**64  # SQLite integers are signed
    return stat.st_dev, inode, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns

"""Places a stage's outputs before the user: as links into the store, those of `export` as real files that are the user's own.

What stands in the way is replaced only where it is a link into a store, or was placed here and is unchanged since. All else is
moved to a free name beside it.
"""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import os
import shutil
from pathlib import Path

from gsac.cache import objects
from gsac.cache.digest import tree_digest, tree_files
from gsac.cache.errors import CacheError, IntegrityError
from gsac.cache.record import Record, is_inside
from gsac.cache.roots import object_of
from gsac.cache.store import Store

OWNED = "export"
"""The stage whose outputs belong to the user."""
FICLONE = 0x40049409
"""Linux's ioctl that makes a file share another's blocks until one of them is written to."""


def place(store: Store, record: Record, folder: Path, placed: dict[str, str]) -> dict[str, str]:
    """Shows the outputs of a record in a folder, and tells through the store what had to be moved aside.

    placed: port -> tree digest of the real files placed there so far. Returns the same as it is now.
    """
    placed = dict(placed)
    for output, digest in record.outputs.items():
        if not is_inside(output):
            raise IntegrityError(f"the record of {record.parts.stage} names the output {output!r}, which leads out of {folder}")
        port, path, source = f"{record.parts.stage}/{output}", folder / output, store.path(record, output)
        owned = record.parts.stage == OWNED
        if not owned and is_link_to(path, source):
            continue
        if os.path.lexists(path) and object_of(path) is None:
            found = None if path.is_symlink() else content(path, store)
            if found == digest:
                placed[port] = digest
                continue
            if found is None or found != placed.get(port):
                aside = move_aside(path)
                store.say(f"gsac: warning: {path} was edited or is not of gsac's making; it is kept as {aside}")
        if owned:
            copy(source, path)
        else:
            link(source, path)
        if path.is_symlink():
            placed.pop(port, None)
        else:
            placed[port] = digest
    return placed


def is_link_to(path: Path, target: Path) -> bool:
    """Whether `path` is a link with exactly this target."""
    return path.is_symlink() and os.readlink(path) == str(target)


def content(path: Path, store: Store) -> str | None:
    """Tree digest of a file or folder; None where it holds what no output holds, such as links to folders."""
    with contextlib.suppress(CacheError, OSError):
        return tree_digest(path, store.memo)[0]
    return None


def move_aside(path: Path) -> Path:
    """Renames a file or folder to a free name beside it, which is returned."""
    for number in itertools.count(1):
        aside = path.with_name(f"{path.stem}-kept{f'-{number}' if number > 1 else ''}{path.suffix}")
        if not os.path.lexists(aside):
            path.rename(aside)
            return aside
    raise AssertionError("numbers do not end")


def link(target: Path, path: Path) -> None:
    """Makes `path` a link to `target`, or a copy where the file system has no links; replaces a link, file or folder."""
    if is_link_to(path, target):
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    temp = _temp(path)
    try:
        temp.symlink_to(target)
    except (OSError, NotImplementedError):
        copy(target, path)
    else:
        _replace(temp, path)


def copy(source: Path, path: Path) -> None:
    """Makes `path` a writable copy of a file or folder, which shares blocks where the file system can; replaces what was there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temp = _temp(path)
    try:
        for name, file in tree_files(source).items():
            target = temp / name if name else temp
            target.parent.mkdir(parents=True, exist_ok=True)
            _copy_file(file, target)
        if source.is_dir():
            temp.mkdir(exist_ok=True)
        _replace(temp, path)
    except BaseException:
        objects.remove(temp)
        raise


def _copy_file(source: Path, target: Path) -> None:
    with source.open("rb") as reading, target.open("wb") as writing:
        try:
            fcntl.ioctl(writing, FICLONE, reading.fileno())
        except OSError:
            shutil.copyfileobj(reading, writing, 1 << 20)


def _replace(temp: Path, path: Path) -> None:
    """Puts a finished file, folder or link in its place."""
    old = path.with_name(f".{path.name}-{os.getpid()}-old")
    if os.path.lexists(path) and any(one.is_dir() and not one.is_symlink() for one in (temp, path)):
        path.rename(old)  # a folder takes no file's place, nor a file a folder's
    os.replace(temp, path)
    objects.remove(old)


def _temp(path: Path) -> Path:
    """A hidden name beside `path` for what is being made; what a dead process of the same number left there is removed."""
    temp = path.with_name(f".{path.name}-{os.getpid()}")
    objects.remove(temp)
    return temp

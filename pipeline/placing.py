"""Places a stage's outputs before the user: as links into the store, or as real files; those of `export` are the user's own.

What stands in the way is replaced only where it is a link into a store, or was placed here and is unchanged since. All else is
moved to a free name beside it.
"""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import os
import shutil
from collections.abc import Callable
from pathlib import Path

from gsac.cache.digest import tree_digest, tree_files
from gsac.cache.errors import CacheError, IntegrityError
from gsac.cache.half_made import half_made
from gsac.cache.record import Record, is_inside
from gsac.cache.roots import object_of
from gsac.cache.store import Store

OWNED = "export"
"""The stage whose outputs belong to the user."""
COPIES = "GSAC_COPY"
"""Environment variable: if it is not empty, the outputs of all stages are real files, for a folder that outlives its store."""
FICLONE = 0x40049409
"""Linux's ioctl that makes a file share another's blocks until one of them is written to."""


def place(store: Store, record: Record, folder: Path, placed: dict[str, str]) -> dict[str, str]:
    """Shows the outputs of a record in a folder, and tells through the store what had to be moved aside.

    placed: port -> tree digests, in one text, of the real files that may have been placed there so far. Returns the same as it is
    now.
    """
    placed = dict(placed)
    for output, digest in record.outputs.items():
        if not is_inside(output):
            raise IntegrityError(f"the record of {record.parts.stage} names the output {output!r}, which leads out of {folder}")
        port, path, source = f"{record.parts.stage}/{output}", folder / output, store.path(record, output)
        real = are_real(record.parts.stage)
        if not real and is_link_to(path, source):
            continue
        if os.path.lexists(path) and object_of(path) is None:
            found = content(path, store)
            if found == digest:
                placed[port] = digest
                continue
            if not is_known(found, placed.get(port)):
                keep_aside(path, store.say)
        if real:
            copy(source, path)
        else:
            link(source, path)
        if path.is_symlink():
            placed.pop(port, None)
        else:
            placed[port] = digest
    return placed


def are_real(stage: str) -> bool:
    """Whether a stage's outputs are placed as real files."""
    return stage == OWNED or bool(os.environ.get(COPIES))


def is_known(digest: str | None, placed: str | None) -> bool:
    """Whether what has this digest is one of those that were placed. placed: their digests in one text."""
    return digest is not None and digest in (placed or "").split()


def stands_in_the_way(record: Record, folder: Path, store: Store, placed: dict[str, str]) -> bool:
    """Whether the folder holds something that is not of gsac's making where an output of the record goes."""
    paths = {f"{record.parts.stage}/{output}": folder / output for output in record.outputs}
    return any(os.path.lexists(path) and object_of(path) is None and not is_known(content(path, store), placed.get(port))
               for port, path in paths.items())


def is_link_to(path: Path, target: Path) -> bool:
    """Whether `path` is a link with exactly this target."""
    return path.is_symlink() and os.readlink(path) == str(target)


def content(path: Path, store: Store) -> str | None:
    """Tree digest of a file or folder; None for a link, and where it holds what no output holds, such as links to folders."""
    if path.is_symlink():
        return None
    with contextlib.suppress(CacheError, OSError):
        return tree_digest(path, store.memo)[0]
    return None


def keep_aside(path: Path, say: Callable[[str], None]) -> None:
    """Moves what is not of gsac's making out of the way and tells where it is."""
    aside = move_aside(path)
    say(f"gsac: warning: {path} was edited or is not of gsac's making; it is kept as {aside}")


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
    with half_made(path.parent) as (folder, _):
        try:
            (folder / path.name).symlink_to(target)
        except (OSError, NotImplementedError):
            copy(target, path)
        else:
            _replace(folder, path)


def copy(source: Path, path: Path) -> None:
    """Makes `path` a writable copy of a file or folder, which shares blocks where the file system can; replaces what was there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with half_made(path.parent) as (folder, _):
        temp = folder / path.name
        for name, file in tree_files(source).items():
            target = temp / name if name else temp
            target.parent.mkdir(parents=True, exist_ok=True)
            _copy_file(file, target)
        if source.is_dir():
            temp.mkdir(exist_ok=True)
        _replace(folder, path)


def _copy_file(source: Path, target: Path) -> None:
    with source.open("rb") as reading, target.open("wb") as writing:
        try:
            fcntl.ioctl(writing, FICLONE, reading.fileno())
        except OSError:
            shutil.copyfileobj(reading, writing, 1 << 20)


def _replace(folder: Path, path: Path) -> None:
    """Puts what was made in `folder` under the name of `path` in its place. What was there goes with the folder."""
    made = folder / path.name
    if os.path.lexists(path) and any(one.is_dir() and not one.is_symlink() for one in (made, path)):
        path.rename(folder / "replaced")  # a folder takes no file's place, nor a file a folder's
    os.replace(made, path)

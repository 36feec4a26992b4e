"""Folders for what is being made, each of one process alone and removed by it; those of killed processes, by the next that comes.

.gsac-<16 hex>/           lies beside what is made in it, locked by its owner
.gsac-<16 hex>/gsac-made  tells it from a folder of the user's, and names its owner where the file system refuses locks
"""

from __future__ import annotations

import contextlib
import os
import re
import secrets
from collections.abc import Iterator
from pathlib import Path

from gsac.cache import objects
from gsac.cache.folder_lock import is_open_at, try_lock
from gsac.cache.owner import is_dead, this_process

NAME = re.compile(r"\.gsac-[0-9a-f]{16}")
MARK = "gsac-made"


def temporary_folder() -> Path:
    """The system's folder for temporary files. `tempfile` tries its by writing a file, which a kill leaves there."""
    named = [os.environ[name] for name in ("TMPDIR", "TEMP", "TMP") if os.environ.get(name)]
    return next((Path(name).absolute() for name in (*named, "/tmp", "/var/tmp") if os.access(name, os.W_OK | os.X_OK)), Path.cwd())


@contextlib.contextmanager
def half_made(parent: Path) -> Iterator[tuple[Path, int]]:
    """An empty folder in `parent`, removed at the end, and its descriptor, whose lock a child process may inherit.

    What killed processes left in `parent` is removed first. Raises OSError.
    """
    sweep(parent)
    while True:
        folder = parent / f".gsac-{secrets.token_hex(8)}"
        try:
            folder.mkdir(mode=0o700)
        except OSError as error:  # of `parent`: nobody knows the name of this one
            raise OSError(error.errno, error.strerror, str(parent)) from error
        try:
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        except FileNotFoundError:  # swept before it was locked
            continue
        if try_lock(descriptor) is not False and is_open_at(folder, descriptor):
            break
        os.close(descriptor)
    try:
        (folder / MARK).write_text(this_process())
        yield folder, descriptor
    finally:
        _clear(folder)
        os.close(descriptor)


def sweep(parent: Path) -> None:
    """Removes what killed processes of this user left in a folder; never what another process is making."""
    with contextlib.suppress(OSError), os.scandir(parent) as entries:
        found = [Path(entry.path) for entry in entries if NAME.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False)
                 and entry.stat(follow_symlinks=False).st_uid == os.geteuid()]
        for folder in found:
            with contextlib.suppress(OSError):
                _remove_if_free(folder)


def _remove_if_free(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        free = try_lock(descriptor)
        if free is None:
            free = is_dead((folder / MARK).read_text())
        if free and (not os.listdir(descriptor) or (folder / MARK).is_file()):
            _clear(folder)
    finally:
        os.close(descriptor)


def _clear(folder: Path) -> None:
    """Removes the folder, its mark last: a folder half removed is still known as one of these."""
    with contextlib.suppress(OSError):
        for entry in list(folder.iterdir()):
            if entry.name != MARK:
                objects.remove(entry)
        (folder / MARK).unlink(missing_ok=True)
        folder.rmdir()

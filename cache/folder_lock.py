"""One process at a time works in a folder. The lock is on the folder itself, so it leaves nothing behind and dies with its holder.

Where the file system refuses to lock a folder, a file in it names the holder.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from gsac.cache.lock import REFUSED
from gsac.cache.owner import is_dead, this_process

HOLDER = ".gsac-lock"
POLL_S = 0.2


@contextlib.contextmanager
def alone_in(folder: Path, waiting: Callable[[], None]) -> Iterator[None]:
    """Makes the folder where it is missing and works in it alone; `waiting` is called once where another process does."""
    said = False
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            free = try_lock(descriptor)
            if free is None:
                with _named_holder(folder / HOLDER, waiting):
                    yield
                return
            if not free:
                if not said:
                    waiting()
                said = True
                fcntl.flock(descriptor, fcntl.LOCK_EX)
            if is_open_at(folder, descriptor):  # else the holder before us removed the folder
                yield
                return
        finally:
            os.close(descriptor)


def try_lock(descriptor: int) -> bool | None:
    """Locks an open folder; False where another holds it, None where the file system refuses."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            return False
        if error.errno in REFUSED:
            return None
        raise
    return True


def is_open_at(path: Path, descriptor: int) -> bool:
    """Whether the open file or folder is still the one at `path`."""
    try:
        return os.path.samestat(os.stat(path), os.fstat(descriptor))
    except (FileNotFoundError, NotADirectoryError):
        return False


@contextlib.contextmanager
def _named_holder(file: Path, waiting: Callable[[], None]) -> Iterator[None]:
    said = False
    while True:
        try:
            descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
            break
        except FileExistsError:
            with contextlib.suppress(OSError):
                if is_dead(file.read_text()):
                    file.unlink()
                    continue
        except OSError as error:
            if error.errno not in (errno.EROFS, errno.EACCES, errno.EPERM):
                raise
            yield  # a folder that can only be read here is only read
            return
        if not said:
            waiting()
        said = True
        time.sleep(POLL_S)
    with contextlib.suppress(OSError):
        os.write(descriptor, this_process().encode())
    os.close(descriptor)
    try:
        yield
    finally:
        file.unlink(missing_ok=True)

"""Lock files under flock: the kernel frees them when their holder dies.

Where the file system of a lock file refuses flock, a stand-in among this machine's temporary files is locked for it. That keeps
apart the processes of this machine, not those of another one that sees the same file system.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import os
import stat as modes
import time
from collections.abc import Callable, Iterator
from pathlib import Path

REFUSED = (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EPERM, errno.EINVAL, errno.EBADF)
"""errno of flock on a file system that has no locks; EBADF is NFS's answer to a descriptor that may only read."""

without_locks: set[Path] = set()
"""Folders whose file system has refused a lock of this process."""


@contextlib.contextmanager
def exclusive(path: Path, waiting: Callable[[], None] = lambda: None) -> Iterator[int]:
    """Locks the file `path` alone, gives its descriptor, and removes the file at the end; `waiting` is called once if it blocks."""
    held = _take(path, fcntl.LOCK_EX, waiting)
    try:
        yield held.descriptor
    finally:
        held.remove(*held.files)
        held.close()


@contextlib.contextmanager
def shared(path: Path, alone: bool = False) -> Iterator[None]:
    """Locks the lock file `path`, which stays, together with others or alone."""
    held = _take(path, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
    try:
        yield
    finally:
        held.close()


@contextlib.contextmanager
def if_free(path: Path) -> Iterator[bool]:
    """True, with `path` locked alone, where no living process holds it; else False at once."""
    if not os.path.lexists(path):
        yield True
        return
    held = _Held(path, fcntl.LOCK_EX, blocking=False)
    try:
        yield held.locked and held.stands
    finally:
        if held.locked:
            held.remove(*held.files.keys() - {path})
        held.close()


class _Held:
    """A lock file that is open, and locked by itself or by its stand-in."""

    def __init__(self, path: Path, mode: int, waiting: Callable[[], None] = lambda: None, blocking: bool = True) -> None:
        self.files = {path: _open(path)}
        try:
            try:
                self.locked = _lock(self.descriptor, mode, waiting, blocking)
            except OSError as error:
                if error.errno not in REFUSED:
                    raise
                without_locks.add(path.parent)
                instead = _stand_in(path)
                self.files[instead] = _open(instead)
                self.locked = _lock(self.files[instead], mode, waiting, blocking)
        except BaseException:
            self.close()
            raise

    @property
    def descriptor(self) -> int:
        """Of the lock file itself."""
        return next(iter(self.files.values()))

    @property
    def stands(self) -> bool:
        """Whether what was locked is what lies there now."""
        return all(_is(path, descriptor) for path, descriptor in self.files.items())

    def remove(self, *files: Path) -> None:
        """Removes files that are locked."""
        for path in files:
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)

    def close(self) -> None:
        """Frees the lock, also for children that inherited the descriptors."""
        for descriptor in self.files.values():
            with contextlib.suppress(OSError):
                fcntl.flock(descriptor, fcntl.LOCK_UN)
            os.close(descriptor)


def _take(path: Path, mode: int, waiting: Callable[[], None] = lambda: None) -> _Held:
    told: list[None] = []

    def wait() -> None:
        if not told:
            told.append(waiting())

    while True:
        held = _Held(path, mode, wait)
        if held.stands:
            return held
        held.close()  # the holder before us removed the file that we waited on


def _open(path: Path) -> int:
    """A descriptor of a lock file, made where it is not there; whoever may use its folder may lock it.

    A link or an empty folder in its place is removed, and any other folder moved aside: a lock is a file.
    """
    while True:
        try:
            return os.open(path, os.O_RDWR | os.O_NOFOLLOW)
        except PermissionError:
            with contextlib.suppress(FileNotFoundError):
                return os.open(path, os.O_RDONLY | os.O_NOFOLLOW)  # another user's
        except FileNotFoundError:
            with contextlib.suppress(FileExistsError):
                descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
                with contextlib.suppress(OSError):
                    os.fchmod(descriptor, modes.S_IMODE(path.parent.stat().st_mode) & 0o666)
                return descriptor
        except OSError as error:
            if error.errno == errno.ELOOP:
                path.unlink(missing_ok=True)
            elif error.errno == errno.EISDIR:
                _clear(path)
            else:
                raise


def _stand_in(path: Path) -> Path:
    import tempfile  # only where it is needed: it is slow to import

    name = hashlib.sha256(os.fsencode(os.path.realpath(path))).hexdigest()
    return Path(tempfile.gettempdir(), f".gsac-lock-{name}")


def _clear(folder: Path) -> None:
    try:
        folder.rmdir()
    except OSError:
        folder.rename(folder.with_name(f".{folder.name}-{time.time_ns()}"))


def _lock(descriptor: int, mode: int, waiting: Callable[[], None], blocking: bool) -> bool:
    try:
        fcntl.flock(descriptor, mode | fcntl.LOCK_NB)
        return True
    except OSError as error:
        if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
            raise
    if blocking:
        waiting()
        fcntl.flock(descriptor, mode)
    return blocking


def _is(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(os.lstat(path), os.fstat(descriptor))
    except FileNotFoundError:
        return False

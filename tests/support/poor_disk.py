"""Refuses this process what exFAT, SMB, NFS without locks, and many file systems of user space cannot do."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from typing import NoReturn


def make_poor(folder: Path, errno_of: int, names: tuple[str, ...]) -> None:
    """names: of `flock` for files below the folder, `link`, `chmod`, and `fsync` of folders, those that fail from now on."""
    flock, fsync = fcntl.flock, os.fsync

    def refuse(*_: object, **__: object) -> NoReturn:
        raise OSError(errno_of, os.strerror(errno_of))

    def path_of(descriptor: int) -> str:
        return os.readlink(f"/proc/self/fd/{descriptor}")

    if "flock" in names:
        fcntl.flock = lambda descriptor, mode: (refuse if path_of(descriptor).startswith(str(folder)) else flock)(descriptor, mode)
    if "link" in names:
        os.link = refuse
    if "chmod" in names:
        os.chmod = os.fchmod = refuse
    if "fsync" in names:
        os.fsync = lambda descriptor: (refuse if os.path.isdir(path_of(descriptor)) else fsync)(descriptor)

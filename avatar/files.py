"""Writes files so that a full disk never leaves a cut one unnoticed: encoders get memory, not a name, since OpenCV for one does not
look at what becomes of its last buffer."""

from __future__ import annotations

import errno
import os
from pathlib import Path

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""errno of a disk, a quota or a largest size of files that is used up."""


def write_file(path: Path, content: bytes) -> None:
    """Writes a file and compares its length. Raises OSError with the file's name."""
    try:
        path.write_bytes(content)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    written = path.stat().st_size
    if written != len(content):
        raise OSError(errno.EIO, f"{written:,} of {len(content):,} bytes were written", str(path))


def told_no_room(words: str, path: Path) -> OSError | None:
    """The OSError at a path that a library or program tells in words only; None where they are not of a lack of room."""
    return next((OSError(number, os.strerror(number), str(path)) for number in NO_ROOM if os.strerror(number) in words), None)

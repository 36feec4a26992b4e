"""Errors of the store; each names the folder and the remedy."""

from __future__ import annotations

import errno
from pathlib import Path

READ_ONLY = "runs may go on without keeping their results, or set GSAC_CACHE to a folder that you may write"
FULL = "nothing that was kept before is lost; free space, run `gsac cache gc`, or set GSAC_CACHE to a larger disk"
LARGEST = "nothing that was kept before is lost; raise `ulimit -f`, or set GSAC_CACHE to a disk that takes larger files"


class CacheError(Exception):
    """An operation on the store failed; `hint` tells the user what to do."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(f"{message}; {hint}" if hint else message)


class CacheFolderError(CacheError):
    """What was named as the store's folder is none."""


class CacheSetupError(CacheError):
    """The place that several stores share cannot be used as it is named or set up."""


class CacheReadOnlyError(CacheError):
    """The store's folder may be read but not written."""


class CacheFullError(CacheError):
    """The disk or the quota of the store's folder is full."""


class IntegrityError(CacheError):
    """An object in the store is not what was put there."""


def from_os_error(error: OSError, folder: Path, needed: int | None = None) -> CacheError:
    """The CacheError that an OSError under `folder` means; needed: bytes that were to be written, if known."""
    if error.errno in (errno.EROFS, errno.EACCES, errno.EPERM) or not folder.is_dir():
        return CacheReadOnlyError(f"the cache folder {folder} cannot be written ({error.strerror})", READ_ONLY)
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return no_room(error.errno, folder, "" if needed is None else f" for a result of {needed:,} bytes")
    return CacheError(f"the cache folder {folder} failed: {error}")


def no_room(number: int, folder: Path, more: str) -> CacheFullError:
    """The error of a disk or quota that is full, or of a largest size of files. number: errno; more: put behind the folder."""
    if number == errno.EFBIG:
        return CacheFullError(f"no room in the cache folder {folder} for a file of that size{more}", LARGEST)
    return CacheFullError(f"no room left in the cache folder {folder}{more}", FULL)

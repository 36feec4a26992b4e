"""Objects: files and folders under objects/ab/<digest>[suffix], named by the digest of their content.

The suffix is that of the output's name, since readers and browsers rely on it; the digest is of the content alone.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import stat as modes
from pathlib import Path, PurePosixPath

from gsac.cache.digest import canonical, manifest_digest, tree_digest, tree_files, typed_digest
from gsac.cache.errors import CacheError
from gsac.cache.memo import Memo
from gsac.cache.record import Footprint

UNKNOWN = (errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS)
"""errno of what a file system does not know how to do."""
SYNCED_AT_ONCE = 8
"""Files of a tree."""


def object_name(digest: str, output: str) -> str:
    """File or folder name of an object. output: the output's relative path."""
    return digest + _suffix(output)


@functools.lru_cache
def _suffix(output: str) -> str:
    return PurePosixPath(output).suffix


def object_path(root: Path, digest: str, output: str) -> Path:
    """Where an object lies in the store at `root`."""
    return Path(root, f"objects/{digest[:2]}/{object_name(digest, output)}")


def measure(path: Path) -> Footprint | None:
    """Number of files, size, names and times of an object, without reading it; None where it is missing, or holds a link or what
    else is no plain file."""
    found: list[list] = []
    try:
        stat = path.lstat()
        if modes.S_ISREG(stat.st_mode):
            found.append(_glance("", stat))
        folders = [("", str(path))] if modes.S_ISDIR(stat.st_mode) else []
        while folders:
            prefix, folder = folders.pop()
            with os.scandir(folder) as entries:
                for entry in entries:
                    if entry.is_dir(follow_symlinks=False):
                        folders.append((f"{prefix}{entry.name}/", entry.path))
                    elif entry.is_file(follow_symlinks=False):
                        found.append(_glance(prefix + entry.name, entry.stat(follow_symlinks=False)))
                    else:
                        return None
    except OSError:
        return None
    if not found and not modes.S_ISDIR(stat.st_mode):
        return None
    return Footprint(len(found), sum(size for _, size, *_ in found), typed_digest("footprint 1", canonical(sorted(found))))


def _glance(name: str, stat: os.stat_result) -> list:
    """Of a plain file, all that shows a change of it without reading it."""
    return [name, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns]


def is_sound(path: Path, digest: str, memo: Memo | None = None) -> bool:
    """Whether it is an object of this digest, of plain files. Without a memo every byte is read."""
    before = measure(path)
    if before is None:
        return False
    try:
        found = tree_digest(path, memo)[0] if memo else manifest_digest(read_manifest(path))
    except (OSError, CacheError):
        return False
    return found == digest and measure(path) == before


def read_manifest(path: Path) -> dict[str, list]:
    """The manifest by reading every byte, without the memo."""
    return tree_digest(path, NO_MEMO)[1]


def require_plain(path: Path, output: str) -> None:
    """Raises CacheError unless `path` is a file or folder of plain files: a link would point out of the store."""
    if not path.exists():
        raise CacheError(f"output {output} was not written")
    for file in (path, *path.rglob("*")) if path.is_dir() else (path,):
        if file.is_symlink():
            raise CacheError(f"output {output} holds the link {file.name}; write a file instead")


def sync(path: Path) -> None:
    """fsync of every file and folder of a tree; several at once, so that one commit of the file system's journal serves them."""
    if not path.is_dir():
        sync_one(path)
        return
    from concurrent.futures import ThreadPoolExecutor  # only where a tree is published: it is slow to import

    with ThreadPoolExecutor(SYNCED_AT_ONCE) as pool:
        list(pool.map(sync_one, (Path(folder, name) for folder, _, files in os.walk(path) for name in [*files, ""])))


def sync_one(path: Path) -> None:
    """fsync of one file or folder; of a folder only where its file system can."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in UNKNOWN or not path.is_dir():
            raise
    finally:
        os.close(descriptor)


def seal_files(path: Path) -> None:
    """Makes every file of a tree read-only, where the file system can."""
    for file in tree_files(path).values():
        _set_mode(file, 0o444)


def seal_folders(path: Path) -> None:
    """Makes every folder of a tree read-only; after the rename, since a read-only folder cannot be moved."""
    if path.is_dir():
        for folder, _, _ in os.walk(path, topdown=False):
            _set_mode(Path(folder), 0o555)


def unseal_folders(path: Path) -> None:
    """Makes the folders of a tree writable again; links are not followed."""
    if path.is_dir() and not path.is_symlink():
        _set_mode(path, 0o755)
        for folder, folders, _ in os.walk(path):
            for inner in (Path(folder, name) for name in folders):
                if not inner.is_symlink():
                    _set_mode(inner, 0o755)


def make_folder(path: Path) -> None:
    """Makes a folder of the store, for those who may use the folder that it lies in, whatever the umask."""
    try:
        path.mkdir()
    except FileExistsError:
        if not path.is_dir():
            raise
    else:
        _set_mode(path, modes.S_IMODE(path.parent.stat().st_mode))


def _set_mode(path: Path, mode: int) -> None:
    try:
        path.chmod(mode)
    except OSError as error:
        if error.errno not in (errno.EPERM, *UNKNOWN):  # exFAT, SMB, or another user's
            raise


def remove(path: Path) -> None:
    """Removes a file or folder, sealed or not; what cannot be removed is left to the next gc."""
    with contextlib.suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            import shutil  # only where something is removed: it is slow to import

            unseal_folders(path)
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


class _NoMemo(Memo):
    def __init__(self) -> None:
        self._pending, self._connection = [], None

    def put(self, kind: str, stat: os.stat_result, value: str, sealed: bool = False) -> None:
        pass


NO_MEMO = _NoMemo()

"""Objects: files and folders under objects/ab/<digest>[suffix], named by the digest of their content.

The suffix is that of the output's name, since readers and browsers rely on it; the digest is of the content alone.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path, PurePosixPath

from gsac.cache.digest import manifest_digest, tree_digest, tree_files
from gsac.cache.errors import CacheError
from gsac.cache.memo import Memo
from gsac.cache.record import Footprint


def object_name(digest: str, output: str) -> str:
    """File or folder name of an object. output: the output's relative path."""
    return digest + PurePosixPath(output).suffix


def object_path(root: Path, digest: str, output: str) -> Path:
    """Where an object lies in the store at `root`."""
    return root / "objects" / digest[:2] / object_name(digest, output)


def measure(path: Path) -> Footprint | None:
    """Number of files, size and times of an object, without reading it; None where it is missing."""
    files = size = stamp = 0
    folders = [str(path)]
    try:
        if path.is_file():
            stat = path.stat()
            return Footprint(1, stat.st_size, stat.st_mtime_ns)
        while folders:
            with os.scandir(folders.pop()) as entries:
                for entry in entries:
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(entry.path)
                    else:
                        stat = entry.stat(follow_symlinks=False)
                        files, size, stamp = files + 1, size + stat.st_size, stamp + stat.st_mtime_ns
    except OSError:
        return None
    return Footprint(files, size, stamp)


def is_sound(path: Path, digest: str, memo: Memo | None = None) -> bool:
    """Whether the content has this digest. Without a memo every byte is read."""
    try:
        found = tree_digest(path, memo)[0] if memo else manifest_digest(read_manifest(path))
    except (OSError, CacheError):
        return False
    return found == digest


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
    """fsync of every file and folder of a tree."""
    if not path.is_dir():
        sync_one(path)
    for folder, _, files in os.walk(path):
        for name in [*files, ""]:
            sync_one(Path(folder, name))


def sync_one(path: Path) -> None:
    """fsync of one file or folder."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def seal_files(path: Path) -> None:
    """Makes every file of a tree read-only."""
    for file in tree_files(path).values():
        file.chmod(0o444)


def seal_folders(path: Path) -> None:
    """Makes every folder of a tree read-only; after the rename, since a read-only folder cannot be moved."""
    if path.is_dir():
        for folder, _, _ in os.walk(path, topdown=False):
            os.chmod(folder, 0o555)


def unseal_folders(path: Path) -> None:
    """Makes the folders of a tree writable again."""
    if path.is_dir() and not path.is_symlink():
        os.chmod(path, 0o755)
        for folder, folders, _ in os.walk(path):
            for name in folders:
                os.chmod(Path(folder, name), 0o755)


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

    def put(self, kind: str, stat: os.stat_result, value: str) -> None:
        pass


NO_MEMO = _NoMemo()

"""Digests of files, trees and text: sha256 in hex. `key` specifies what is hashed."""

from __future__ import annotations

import hashlib
import json
import os
import stat as modes
from pathlib import Path
from typing import Any

from gsac.cache.errors import CacheError
from gsac.cache.memo import Memo, identity, memo_in
from gsac.cache.root import default_root

Manifest = dict[str, list]
"""Relative path with `/` -> [sha256 of the content, size in bytes]; a single file is the one entry ''."""
_CANONICAL = json.JSONEncoder(sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def typed_digest(kind: str, payload: bytes) -> str:
    """sha256 of a payload behind its kind, so that two kinds never share a pre-image."""
    return hashlib.sha256(f"gsac {kind}\n".encode() + payload).hexdigest()


def canonical(value: Any) -> bytes:
    """The canonical JSON of a value: sorted keys, no spaces, ASCII, floats by repr. ValueError for NaN or infinity."""
    return _CANONICAL.encode(value).encode()


def file_digest(path: Path, memo: Memo | None = None) -> str:
    """Plain sha256 of a file's content, remembered by its stat (in the default store unless a memo is given)."""
    memo = memo or memo_in(default_root())
    digest = content_digest(Path(path), memo)
    memo.flush()
    return digest


def tree_digest(path: Path, memo: Memo | None = None) -> tuple[str, Manifest]:
    """Digest and manifest of a file or folder; the name of the file or folder itself does not count.

    Links to files are followed; links to folders and special files raise CacheError. Empty folders do not count.
    """
    memo = memo or memo_in(default_root())
    manifest = {name: list(_digest_and_size(file, memo)) for name, file in sorted(tree_files(Path(path)).items())}
    memo.flush()
    return manifest_digest(manifest), manifest


def plain_digest(path: Path, memo: Memo | None = None) -> str:
    """Plain sha256 of a file, tree digest of a folder: what a model is kept under."""
    return tree_digest(path, memo)[0] if Path(path).is_dir() else file_digest(path, memo)


def manifest_digest(manifest: Manifest) -> str:
    """Tree digest of a manifest."""
    return typed_digest("tree 1", canonical(manifest))


def tree_files(path: Path) -> dict[str, Path]:
    """Relative name -> file; {'': path} for a file."""
    if path.is_file():
        return {"": path}
    files: dict[str, Path] = {}
    folders = [("", str(path))]
    while folders:
        prefix, folder = folders.pop()
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    folders.append((f"{prefix}{entry.name}/", entry.path))
                elif entry.is_file():
                    files[prefix + entry.name] = Path(entry.path)
                else:
                    raise CacheError(f"{entry.path} is neither a file nor a folder (a link to nothing or to a folder?)")
    return files


def content_digest(path: Path, memo: Memo) -> str:
    """As `file_digest`, for callers that flush the memo themselves once they have asked for many files."""
    return _digest_and_size(path, memo)[0]


def _digest_and_size(path: Path, memo: Memo) -> tuple[str, int]:
    before = os.stat(path)
    known = memo.get("file", before)
    if known is not None:
        return known, before.st_size
    with path.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        after = os.fstat(stream.fileno())
    if modes.S_ISREG(after.st_mode) and identity(after) == identity(before):
        memo.put("file", before, digest)
    return digest, after.st_size

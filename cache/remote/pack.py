"""A pack: a file or folder as one stream of bytes that proves itself, cut into parts.

    gsac pack 1 <bytes of the manifest, 19 digits>\\n
    the canonical manifest {relative path: [sha256, size]}          its digest is the tree digest, and so the pack's name
    the contents of the files, in the manifest's order

Parts have PART bytes, the last one fewer. A part is one request, so that a cut costs little, and no more than one is in memory.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from gsac.cache.digest import Manifest, canonical, manifest_digest, tree_files, typed_digest
from gsac.cache.errors import CacheError, IntegrityError
from gsac.cache.objects import read_manifest
from gsac.cache.record import Footprint, is_digest, is_inside

PART = 16 << 20
"""Part of the format: two machines must cut alike, since a part that is there is not put again."""
LARGEST_MANIFEST = 64 << 20
HEAD = b"gsac pack 1 %019d\n"
HEAD_BYTES = 32
READ_HEAD = re.compile(rb"gsac pack 1 (\d{19})\n")
CHUNK = 1 << 20


class WrongBytesError(CacheError):
    """What was read is not what its name or its record says."""


def pack_parts(path: Path, digest: str) -> Iterator[bytes]:
    """The parts of the pack of an object of this digest. IntegrityError where it is damaged, before the first part."""
    manifest = read_manifest(path)
    if manifest_digest(manifest) != digest:
        raise IntegrityError(f"the cached object {path} is damaged; `gsac cache verify` puts it away")
    part = bytearray()
    for piece in _pieces(path, manifest):
        part += piece
        while len(part) >= PART:
            yield bytes(part[:PART])
            del part[:PART]
    if part:
        yield bytes(part)


def count_parts(path: Path, digest: str) -> int:
    """How many parts `pack_parts` gives, without reading contents twice: by sizes alone. digest: for its manifest's length only."""
    sizes = {name: file.stat().st_size for name, file in tree_files(path).items()}
    length = HEAD_BYTES + len(canonical({name: [digest, size] for name, size in sizes.items()})) + sum(sizes.values())
    return -(-length // PART)


def unpack(parts: Iterable[bytes], digest: str, expected: Footprint, target: Path) -> None:
    """Writes the file or folder of a pack to `target`, which is not there yet. expected: its number of files and bytes.

    WrongBytesError where a byte is not as the digest says; `target` is then to be thrown away.
    """
    stream = _Stream(parts)
    head = READ_HEAD.fullmatch(stream.take(HEAD_BYTES))
    if head is None or int(head[1]) > LARGEST_MANIFEST:
        raise WrongBytesError("no pack, or one with too many files")
    text = stream.take(int(head[1]))
    if typed_digest("tree 1", text) != digest:
        raise WrongBytesError("the list of its files has another digest")
    manifest = read_names(text)
    if len(manifest) != expected.files or sum(size for _, size in manifest.values()) != expected.bytes:
        raise WrongBytesError("it has another size than its record says")
    if "" not in manifest:
        target.mkdir()
    for name, (wanted, size) in manifest.items():
        _write(stream, target / name if name else target, name, wanted, size)
    if not stream.ended:
        raise WrongBytesError("it goes on behind its last file")


def read_names(text: bytes) -> Manifest:
    """The manifest of a text. WrongBytesError unless all its names are those of plain files inside one folder, or of one file."""
    try:
        manifest = json.loads(text)
        entries = [(name, *entry) for name, entry in manifest.items()]
        sound = all(is_digest(digest) and type(size) is int and size >= 0 for _, digest, size in entries)
        names = set(manifest)
        folders = {"/".join(name.split("/")[:depth]) for name in names for depth in range(1, name.count("/") + 1)}
        sound = sound and (names == {""} or all(map(is_inside, names))) and names.isdisjoint(folders)
        for name in names:
            os.fsencode(name)
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise WrongBytesError("the list of its files cannot be read") from error
    if not sound:
        raise WrongBytesError("the list of its files names what is no plain file inside one folder")
    return dict(sorted(manifest.items()))


def _pieces(path: Path, manifest: Manifest) -> Iterator[bytes]:
    text = canonical(manifest)
    yield HEAD % len(text) + text
    for name in sorted(manifest):
        with (path / name if name else path).open("rb") as file:
            while piece := file.read(CHUNK):
                yield piece


def _write(stream: _Stream, file: Path, name: str, wanted: str, size: int) -> None:
    found, left = hashlib.sha256(), size
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("xb") as out:
        while left:
            piece = stream.take(min(left, CHUNK))
            found.update(piece)
            out.write(piece)
            left -= len(piece)
    if found.hexdigest() != wanted:
        raise WrongBytesError(f"{name or 'its file'} has another digest")


class _Stream:
    """Bytes of parts, taken in pieces of any size."""

    def __init__(self, parts: Iterable[bytes]) -> None:
        self._parts = iter(parts)
        self._rest = memoryview(b"")

    def take(self, count: int) -> bytes:
        """The next `count` bytes. WrongBytesError where there are fewer."""
        pieces = []
        while count:
            if not self._rest:
                self._rest = memoryview(next(self._parts, b""))
                if not self._rest:
                    raise WrongBytesError("it ends too early")
            pieces.append(bytes(self._rest[:count]))
            self._rest = self._rest[count:]
            count -= len(pieces[-1])
        return b"".join(pieces)

    @property
    def ended(self) -> bool:
        """Whether nothing of the last part that was read is left."""
        return not self._rest

"""A bundle: the results of one clip as one file, a tar of plain members, its manifest first.

    manifest.json                    {"gsac bundle": 1, "clip": digest, "members": [[name, sha256, bytes], ...]}, in the tar's order
    actions/<stage>/<key>.json       records
    lineage.json papers/<kind>/<name>  what goes along: where the results come from, licences, the consent of the person shown
    objects/<digest>                 an output as a pack (see `remote.pack`)

Whoever reads one believes no byte of it before its digest is right, and publishes nothing before all are.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import tarfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from gsac.cache.errors import CacheError, CacheFullError, from_os_error
from gsac.cache.half_made import half_made
from gsac.cache.publish import publish
from gsac.cache.record import Footprint, Record, is_digest
from gsac.cache.remote.pack import CHUNK, LARGEST_MANIFEST, WrongBytesError, pack_parts, unpack
from gsac.cache.store import LARGEST, Store

MANIFEST, LINEAGE, PAPERS = "manifest.json", "lineage.json", "papers"
VERSION_KEY, VERSION = "gsac bundle", 1
BLOCK = tarfile.BLOCKSIZE
LARGEST_PAPER = 64 << 20
MOST_MEMBERS = 10000
LONGEST_NAME = 99
"""Bytes of a member's name: longer ones need headers that are not read."""
ZIP = b"PK"
"""First bytes of a zip."""
RECORD = re.compile(r"actions/([\w.-]{1,40})/([0-9a-f]{64})\.json")
OBJECT = re.compile(r"objects/([0-9a-f]{64})")
PAPER = re.compile(r"papers/(consent|licences)/[^/\0]{1,80}")


class BundleError(CacheError):
    """A file is no bundle, or is not as it was written."""


@dataclass(frozen=True)
class Member:
    """One entry of the manifest."""

    name: str
    sha256: str
    bytes: int


@dataclass
class Bundle:
    """What came out of a file."""

    clip: str
    """Tree digest of the clip that the results are of."""
    records: list[Record] = field(default_factory=list)
    papers: list[Path] = field(default_factory=list)
    """Where licences and consent lie now."""
    bytes: int = 0


def write_bundle(file: Path, store: Store, records: Iterable[Record], clip: str, texts: Mapping[str, bytes]) -> int:
    """Writes a bundle of results, whole or not at all; returns its size. Equal results give equal bytes.

    clip: tree digest; texts: lineage and papers, by member name. IntegrityError where an object is damaged, CacheError where a name
    of `texts` cannot be one.
    """
    known = {record.key: record for record in records}
    small = dict(texts)
    small |= {f"actions/{record.parts.stage}/{record.key}.json": record.to_json().encode() for record in known.values()}
    paths = {f"objects/{digest}": (store.path(record, output), digest)
             for record in known.values() for output, digest in record.outputs.items()}
    for name in texts:
        if not (name == LINEAGE or PAPER.fullmatch(name)) or len(name.encode()) > LONGEST_NAME:
            raise CacheError(f"{name.rpartition('/')[2]}: a paper's name must be plain and short; expected at most 80 characters")
        if len(small[name]) > LARGEST_PAPER:
            raise CacheError(f"{name.rpartition('/')[2]} has {len(small[name]):,} bytes; expected at most {LARGEST_PAPER:,}")
    members = [Member(name, hashlib.sha256(small[name]).hexdigest(), len(small[name])) for name in sorted(small)]
    members += [_measure(name, pack_parts(*paths[name])) for name in sorted(paths)]
    with half_made(file.parent) as (folder, _):
        with (folder / file.name).open("wb") as out:
            manifest = {VERSION_KEY: VERSION, "clip": clip, "members": [[one.name, one.sha256, one.bytes] for one in members]}
            text = json.dumps(manifest, indent=1).encode()
            _write(out, MANIFEST, len(text), [text])
            for member in members:
                _write(out, member.name, member.bytes,
                       [small[member.name]] if member.name in small else pack_parts(*paths[member.name]))
            out.write(bytes(2 * BLOCK))
            out.flush()
            os.fsync(out.fileno())
        os.replace(folder / file.name, file)
    return file.stat().st_size


def read_bundle(file: Path, store: Store) -> Bundle:
    """Puts the results of a bundle into the store, and its papers into papers/<clip>/ there.

    BundleError names what is not as it was written; then nothing is in the store that was not before.
    """
    try:
        with store.private("bundle") as folder, file.open("rb") as stream:
            bundle, small, members = _read_head(stream)
            room = os.statvfs(store.root)
            needed = sum(footprint.bytes for record in bundle.records for footprint in record.footprints.values())
            if needed > room.f_bavail * room.f_frsize:
                raise CacheFullError(f"no room in the cache folder {store.root} for a bundle of {needed:,} bytes")
            sizes = {digest: record.footprints[output] for record in bundle.records for output, digest in record.outputs.items()}
            for member in members:
                _take_object(stream, member, sizes, folder)
            if stream.read(2 * BLOCK) != bytes(2 * BLOCK) or stream.read(1):
                raise BundleError("it goes on, or stops short, behind its last member")
            bundle.bytes = stream.tell()
            uses = Counter(digest for record in bundle.records for digest in record.outputs.values())
            for record in bundle.records:
                _publish(store, record, folder, uses)
            _keep_papers(store, bundle, small)
            return bundle
    except (BundleError, WrongBytesError) as error:
        why = "it is a zip, as `gsac pack` makes it" if _begins(file, ZIP) else error
        raise BundleError(f"{file} is no bundle that can be trusted: {why}; nothing of it was taken") from error
    except OSError as error:
        if error.filename == str(file):
            raise
        raise from_os_error(error, store.root) from error


def _begins(file: Path, mark: bytes) -> bool:
    """Whether these are a file's first bytes: a bundle that is cut may well end as a zip, since results hold some."""
    with file.open("rb") as stream:
        return stream.read(len(mark)) == mark


def papers_of(store: Store, clip: str) -> dict[str, Path]:
    """Member name -> file, of licences and consent that the store keeps for a clip."""
    folder = store.root / PAPERS / clip
    found = {f"{PAPERS}/{file.parent.name}/{file.name}": file for file in sorted(folder.glob("*/*")) if not file.is_symlink()}
    return {name: file for name, file in found.items() if PAPER.fullmatch(name)}


def _read_head(stream: BinaryIO) -> tuple[Bundle, dict[str, bytes], list[Member]]:
    """Clip and records, texts by name, and the members that are left to read: one of each object that a record names."""
    clip, members = _read_manifest(stream)
    bundle, small, objects = Bundle(clip), {}, []
    for member in members:
        if OBJECT.fullmatch(member.name):
            objects.append(member)
            continue
        if objects:
            raise BundleError(f"{member.name} stands behind the objects")
        _read_header(stream, member)
        small[member.name] = data = _take(stream, member.bytes)
        if hashlib.sha256(data).hexdigest() != member.sha256:
            raise BundleError(f"{member.name} has another digest than the manifest says")
        _skip_padding(stream, member.bytes)
        found = RECORD.fullmatch(member.name)
        if found is not None:
            record = Record.from_json(data.decode(errors="replace"))
            if record is None or (record.parts.stage, record.key) != found.groups():
                raise BundleError(f"the record {member.name} is not as it was written, or is another's")
            if any(footprint.bytes < 0 for footprint in record.footprints.values()):
                raise BundleError(f"the record {member.name} names a size below zero")
            bundle.records.append(record)
    named = {f"objects/{digest}" for record in bundle.records for digest in record.outputs.values()}
    if named != {member.name for member in objects}:
        raise BundleError("its objects are not those that its records name")
    if not any(clip in record.parts.inputs.values() for record in bundle.records):
        raise BundleError("none of its records is of the clip that its manifest names")
    return bundle, {name: data for name, data in small.items() if PAPER.fullmatch(name)}, objects


def _read_manifest(stream: BinaryIO) -> tuple[str, list[Member]]:
    header = _parse_header(stream)
    if header.name != MANIFEST or not 0 < header.size <= LARGEST:
        raise BundleError(f"it does not begin with a {MANIFEST} of at most {LARGEST:,} bytes")
    text = _take(stream, header.size)
    _skip_padding(stream, header.size)
    try:
        raw = json.loads(text)
        members = [Member(*entry) for entry in raw["members"]]
        sound = raw[VERSION_KEY] == VERSION and is_digest(raw["clip"]) and 0 < len(members) <= MOST_MEMBERS
        sound = sound and all(map(_is_member, members)) and len({member.name for member in members}) == len(members)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise BundleError("its manifest cannot be read") from error
    if not sound:
        raise BundleError("its manifest is of another version, or names what no bundle holds")
    return raw["clip"], members


def _is_member(member: Member) -> bool:
    """Whether a bundle may hold a member of this name and size."""
    if not (isinstance(member.name, str) and is_digest(member.sha256) and type(member.bytes) is int and member.bytes >= 0):
        return False
    if OBJECT.fullmatch(member.name):
        return True
    paper = PAPER.fullmatch(member.name) is not None and member.name.rpartition("/")[2] not in (".", "..")
    return member.bytes <= (LARGEST_PAPER if paper else LARGEST) and (
        paper or member.name == LINEAGE or RECORD.fullmatch(member.name) is not None)


def _take_object(stream: BinaryIO, member: Member, sizes: dict[str, Footprint], folder: Path) -> None:
    """Unpacks the next member to `folder/<digest>`."""
    digest = member.name.partition("/")[2]
    expected = sizes[digest]
    if member.bytes > expected.bytes + LARGEST_MANIFEST:
        raise BundleError(f"{member.name} is larger than its record says")
    _read_header(stream, member)
    found = hashlib.sha256()
    unpack(_hashed(_chunks(stream, member.bytes), found), digest, expected, folder / digest)
    if found.hexdigest() != member.sha256:
        raise BundleError(f"{member.name} has another digest than the manifest says")
    _skip_padding(stream, member.bytes)


def _publish(store: Store, record: Record, folder: Path, uses: Counter[str]) -> None:
    """Publishes a record whose objects lie in `folder`. uses: how many outputs still wait for an object; the last one takes it."""
    with store.private(record.parts.stage) as made:
        for output, digest in record.outputs.items():
            target, source = made / output, folder / digest
            target.parent.mkdir(parents=True, exist_ok=True)
            uses[digest] -= 1
            if not uses[digest]:
                os.rename(source, target)
            elif source.is_dir():
                shutil.copytree(source, target)
            else:
                shutil.copyfile(source, target)
        publish(store, record.parts, made, tuple(record.outputs), record.info)


def _keep_papers(store: Store, bundle: Bundle, papers: dict[str, bytes]) -> None:
    for name, data in papers.items():
        place = store.root / PAPERS / bundle.clip / name.removeprefix(f"{PAPERS}/")
        place.parent.mkdir(parents=True, exist_ok=True)
        if place.is_file() and not place.is_symlink() and place.read_bytes() == data:
            bundle.papers.append(place)
            continue
        if os.path.lexists(place):  # one of that name is here already, and stays
            place = place.with_name(f"{hashlib.sha256(data).hexdigest()[:8]}-{place.name}")
        with half_made(place.parent) as (folder, _):
            (folder / "paper").write_bytes(data)
            os.replace(folder / "paper", place)
        bundle.papers.append(place)


def _measure(name: str, parts: Iterable[bytes]) -> Member:
    found, size = hashlib.sha256(), 0
    for part in parts:
        found.update(part)
        size += len(part)
    return Member(name, found.hexdigest(), size)


def _write(out: BinaryIO, name: str, size: int, parts: Iterable[bytes]) -> None:
    header = tarfile.TarInfo(name)
    header.size, header.mode = size, 0o644
    out.write(header.tobuf(tarfile.GNU_FORMAT))
    written = 0
    for part in parts:
        out.write(part)
        written += len(part)
    if written != size:
        raise CacheError(f"{name} changed while it was written into the bundle")
    out.write(bytes(-size % BLOCK))


def _read_header(stream: BinaryIO, member: Member) -> None:
    header = _parse_header(stream)
    if (header.name, header.size) != (member.name, member.bytes):
        raise BundleError(f"{header.name[:80]!r} of {header.size:,} bytes stands where {member.name} of {member.bytes:,} belongs")


def _parse_header(stream: BinaryIO) -> tarfile.TarInfo:
    """The next member's header, of a plain file: nothing else is in a bundle, and no header that another one follows."""
    block = stream.read(BLOCK)
    try:
        header = tarfile.TarInfo.frombuf(block, "utf-8", "strict")
    except (tarfile.HeaderError, ValueError) as error:
        raise BundleError("a header of the tar is damaged, or the file is cut") from error
    if header.type not in (tarfile.REGTYPE, tarfile.AREGTYPE):
        raise BundleError(f"{header.name[:80]!r} is no plain file")
    return header


def _take(stream: BinaryIO, size: int) -> bytes:
    data = stream.read(size)
    if len(data) != size:
        raise BundleError("the file is cut")
    return data


def _skip_padding(stream: BinaryIO, size: int) -> None:
    if any(_take(stream, -size % BLOCK)):
        raise BundleError("something stands between two members")


def _chunks(stream: BinaryIO, size: int) -> Iterator[bytes]:
    while size:
        data = _take(stream, min(size, CHUNK))
        size -= len(data)
        yield data


def _hashed(parts: Iterable[bytes], found: hashlib._Hash) -> Iterator[bytes]:
    for part in parts:
        found.update(part)
        yield part

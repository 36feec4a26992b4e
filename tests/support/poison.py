"""Poisoned action records: what rot makes of one, and what somebody who can write to the store might put in its place.

Not among them is a forgery that is consistent: a record with the declared outputs, their true digests and a right checksum. Who may
write to a store can put such results into it.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gsac.cache.objects import measure

Raw = dict[str, Any]


def sign(raw: Raw) -> bytes:
    """A record's file with a right checksum, whatever it says."""
    content = json.dumps({name: value for name, value in raw.items() if name != "sha256"}, indent=1).removeprefix("{\n") + "\n"
    return f'{{"sha256": "{hashlib.sha256(content.encode()).hexdigest()}",\n{content}'.encode()


def rot(rng: random.Random, data: bytes) -> bytes:
    """Bytes flipped, lost, added, or of something else."""
    at = rng.randrange(len(data))
    return rng.choice([
        lambda: data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1:],
        lambda: data[:at],
        lambda: data[at:],
        lambda: data[:at] + data[at + rng.randrange(1, 9):],
        lambda: data[:at] + rng.randbytes(rng.randrange(1, 9)) + data[at:],
        lambda: data + data,
        lambda: rng.randbytes(rng.randrange(4000)),
        lambda: b"[" * 200_000,
        lambda: rng.choice([b"", b"null", b"[]", b"{}", b"0", b'"record"', b"\xff\xfe"]),
    ])()


def retell(rng: random.Random, raw: Raw) -> None:
    """Another value somewhere, of its own kind; only the checksum tells."""
    spot = rng.choice([
        (raw["info"]["metrics"], "psnr_fg", 99.9), (raw["info"], "seconds", 0.1), (raw["info"], "warnings", []),
        (raw["info"], "log_tail", "all is well"), (raw["info"], "notes", ["nothing to say"]),
        (raw["footprints"]["avatar.npz"], "bytes", 1), (raw["parts"]["params"], "fps", 6),
        (raw["outputs"], "avatar.npz", raw["outputs"]["body.npz"]),
    ])
    spot[0][spot[1]] = spot[2]


def lead_away(outside: Path) -> Callable[[random.Random, Raw], None]:
    """Forgeries by which an output's name or digest would lead to a file or folder in `outside`."""

    def forge(rng: random.Random, raw: Raw) -> None:
        target = rng.choice([outside / ".bashrc", outside / "Documents", outside / "new"])
        names = [str(target), *("../" * n + f"{outside.name}/{target.name}" for n in range(1, 5)), f"frames/../../../{target.name}",
                 "..", ".", "", "/", "frames/", "frames//x", "./clip.json", "frames\0", "a" * 5000, "clip.json\n", "\udcff"]
        digests = [f"../../{outside.name}", str(target), "0" * 64, "ab", raw["key"].upper(), None, 7, [], {"": 0}, "\0" * 64]
        if rng.random() < 0.6:
            old, new = rng.choice(list(raw["outputs"])), rng.choice(names)
            again = rng.random() < 0.3  # beside the true ones
            for table in (raw["outputs"], raw["footprints"]):
                table[new] = table[old] if again else table.pop(old)
        else:
            raw["outputs"][rng.choice(list(raw["outputs"]))] = rng.choice(digests)

    return forge


def mistype(rng: random.Random, raw: Raw) -> None:
    """A value of another kind, or none, somewhere; and forgeries of what the record is about."""
    odd: list[Any] = [None, [], {}, "", "x", 0, -1, 1e400, [[]], {"a": []}, True, "\x1b[2J", ["a", 1]]
    table = rng.choice([raw, raw["parts"], raw["info"], raw["outputs"], raw["footprints"], raw["footprints"]["avatar.npz"]])
    name = rng.choice([name for name, value in table.items() if name != "sha256"])
    kind = (int, float) if type(table[name]) in (int, float) else (type(table[name]),)
    if rng.random() < 0.3 and table is not raw["info"]:  # what is missing there has a default
        del table[name]
    elif rng.random() < 0.3:
        table[f"{name}x"] = table.pop(name)
    else:
        table[name] = rng.choice([value for value in odd if type(value) not in kind])


def replace_file(rng: random.Random, file: Path, outside: Path, other: bytes) -> None:
    """Something else in the record's place: a folder, a link, a pipe, the record of another key."""
    file.unlink()
    rng.choice([
        lambda: file.mkdir(),
        lambda: (file.mkdir(), (file / "inner").mkdir(), (file / "inner" / "file").write_text("something")),
        lambda: (file.mkdir(), (file / "away").symlink_to(outside)),
        lambda: file.symlink_to(outside / "nowhere"),
        lambda: file.symlink_to(outside / ".bashrc"),
        lambda: file.symlink_to(outside / "Documents"),
        lambda: file.symlink_to("/dev/zero"),
        lambda: os.mkfifo(file),
        lambda: file.write_bytes(other),
    ])()


def poison(rng: random.Random, file: Path, outside: Path, other: bytes) -> None:
    """Puts something poisoned in the place of a record. other: the file of another key's sound record."""
    data = file.read_bytes()
    if rng.random() < 0.15:
        replace_file(rng, file, outside, other)
        return
    kind = rng.choice([None, retell, lead_away(outside), lead_away(outside), mistype])
    if kind is None:
        made = rot(rng, data)
    else:
        raw = json.loads(data)
        kind(rng, raw)
        made = json.dumps(raw).encode() if kind is retell else sign(raw)
    file.chmod(0o644)
    file.write_bytes(made)


def hide_damage(file: Path, output: str, path: Path) -> None:
    """Makes a record tell the times of an output's files as they are now: so rot looks, which leaves them alone."""
    seen = measure(path)
    assert seen is not None
    raw = json.loads(file.read_bytes())
    raw["footprints"][output] = asdict(seen)
    file.chmod(0o644)
    file.write_bytes(sign(raw))

"""A fresh store for each test, small results for it, and children that can be killed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gsac.cache.key import KeyParts
from gsac.cache.publish import publish
from gsac.cache.record import Record, RunInfo
from gsac.cache.store import Store

PRELUDE = """
import os, signal, sys, time
from pathlib import Path
from gsac.cache.key import KeyParts
from gsac.cache.lease import in_use, single_flight
from gsac.cache.publish import publish
from gsac.cache.record import RunInfo
from gsac.cache.store import Store
store = Store(Path(sys.argv[1]))

def parts_of(stage="split", **params):
    return KeyParts(stage=stage, inputs={"clip": "c" * 64}, params=params)

def make(parts, text="result", **options):
    with store.private(parts.stage) as folder:
        (folder / "frames" / "inner").mkdir(parents=True)
        for number in range(3):
            (folder / "frames" / f"{number:06d}.png").write_bytes(f"{text} {number}".encode() * 100)
        (folder / "frames" / "inner" / "plate.png").write_text(text)
        (folder / "clip.json").write_text(text)
        return publish(store, parts, folder, ("frames", "clip.json"), RunInfo(seconds=12.5), **options)
"""


@pytest.fixture
def store(tmp_path: Path, monkeypatch) -> Store:
    monkeypatch.setenv("GSAC_CACHE", str(tmp_path / "default"))
    return Store(tmp_path / "store")


@pytest.fixture
def parts_of():
    """parts_of(stage, **params): KeyParts of one input."""
    return _parts_of


@pytest.fixture
def fill():
    """fill(folder, text): writes a folder and a file into it, returns their names."""
    return _fill


@pytest.fixture
def make(store):
    """make(parts, text, ...): publishes a small result of that text."""

    def publish_small(parts: KeyParts, text: str = "result", store: Store = store, **options) -> Record:
        with store.private(parts.stage) as folder:
            return publish(store, parts, folder, _fill(folder, text), RunInfo(seconds=12.5), **options)

    return publish_small


def _parts_of(stage: str = "split", **params) -> KeyParts:
    return KeyParts(stage=stage, inputs={"clip": "c" * 64}, params=params)


def _fill(folder: Path, text: str = "result") -> tuple[str, ...]:
    (folder / "frames" / "inner").mkdir(parents=True)
    for number in range(3):
        (folder / "frames" / f"{number:06d}.png").write_bytes(f"{text} {number}".encode() * 100)
    (folder / "frames" / "inner" / "plate.png").write_text(text)
    (folder / "clip.json").write_text(text)
    return ("frames", "clip.json")


@pytest.fixture
def contents():
    """contents(path): relative name -> bytes of a file or folder."""

    def read(path: Path) -> dict[str, bytes]:
        if path.is_file():
            return {"": path.read_bytes()}
        return {str(file.relative_to(path)): file.read_bytes() for file in path.rglob("*") if file.is_file()}

    return read


@pytest.fixture
def unused(store):
    """unused(record, seconds): makes a record look last used that long ago."""

    def turn_back(record: Record, seconds: float) -> None:
        file = store.record_path(record.parts.stage, record.key)
        then = file.stat().st_mtime - seconds
        os.utime(file, (then, then))

    return turn_back


@pytest.fixture
def child(store: Store):
    """child(code, *arguments): a Python process with `store` open and the arguments in sys.argv[2:]."""
    children = []

    def start(code: str, *arguments: object) -> subprocess.Popen:
        command = [sys.executable, "-c", PRELUDE + code, str(store.root), *map(str, arguments)]
        children.append(subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True))
        return children[-1]

    yield start
    for process in children:
        if process.poll() is None:
            process.kill()
        process.communicate()

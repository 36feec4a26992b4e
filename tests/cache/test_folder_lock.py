"""One process at a time works in a folder; its death frees it, with locks of the file system or without."""

import errno
import subprocess
import sys
import threading

import pytest

from gsac.cache import folder_lock
from gsac.cache.folder_lock import HOLDER, alone_in
from support.children import starter

HOLD = """
import sys
from pathlib import Path
from gsac.cache import folder_lock
if len(sys.argv) > 2:
    folder_lock.try_lock = lambda descriptor: None
with folder_lock.alone_in(Path(sys.argv[1]), lambda: None):
    print("in", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """holder(*arguments): a process that works in tmp_path / "out"."""
    with starter(HOLD, tmp_path / "out") as start:
        yield start


@pytest.mark.parametrize("locks", [True, False])
@pytest.mark.parametrize("end", ["killed", "done"])
def test_a_second_waits_says_so_once_and_goes_on_when_the_first_ends_or_is_killed(tmp_path, holder, monkeypatch, locks, end):
    if not locks:
        def refuse(descriptor, how):
            raise OSError(errno.ENOLCK, "No locks available")

        monkeypatch.setattr(folder_lock.fcntl, "flock", refuse)
        monkeypatch.setattr(folder_lock, "POLL_S", 0.01)
    first = holder(*([] if locks else ["unlocked"]))
    said = []

    def wait():
        said.append("waiting")
        threading.Timer(0.1, first.kill if end == "killed" else first.stdin.close).start()

    with alone_in(tmp_path / "out", wait):
        assert first.wait(5) is not None and said == ["waiting"]
    assert list((tmp_path / "out").iterdir()) == []


def test_a_folder_that_its_holder_removed_is_made_anew(tmp_path, holder):
    first = holder()

    def remove():
        (tmp_path / "out").rmdir()
        first.kill()

    with alone_in(tmp_path / "out", remove):
        assert (tmp_path / "out").is_dir()
        second = subprocess.run([sys.executable, "-c", "import fcntl, os, sys\nfcntl.flock(os.open(sys.argv[1], 0), 6)",
                                 str(tmp_path / "out")], capture_output=True)
        assert second.returncode != 0, "the new one is locked"


def test_a_folder_that_can_only_be_read_is_read_without_a_lock(tmp_path, monkeypatch):
    def refuse(path, flags, *more):
        raise OSError(errno.EROFS, "Read-only file system", str(path))

    monkeypatch.setattr(folder_lock, "try_lock", lambda descriptor: None)
    with monkeypatch.context() as patched:
        descriptor = folder_lock.os.open(tmp_path, folder_lock.os.O_RDONLY)
        patched.setattr(folder_lock.os, "open", lambda path, flags, *more: refuse(path, flags) if more else descriptor)
        with alone_in(tmp_path, lambda: None):
            assert list(tmp_path.iterdir()) == []


def test_the_holder_of_another_machine_is_left_in_peace(tmp_path, monkeypatch):
    monkeypatch.setattr(folder_lock, "try_lock", lambda descriptor: None)
    monkeypatch.setattr(folder_lock.time, "sleep", lambda seconds: (_ for _ in ()).throw(KeyboardInterrupt))
    (tmp_path / HOLDER).write_text("elsewhere boot space 1 1")
    with pytest.raises(KeyboardInterrupt), alone_in(tmp_path, lambda: None):
        pass
    assert (tmp_path / HOLDER).exists()

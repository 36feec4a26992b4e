"""Folders of work in progress: removed by their owner, or after its death by the next that comes; nothing else ever is."""

import errno

import pytest

from gsac.cache import folder_lock
from gsac.cache.half_made import MARK, half_made, sweep
from gsac.cache.owner import is_dead, this_process
from support.children import starter

MAKE = """
import sys
from pathlib import Path
from gsac.cache import folder_lock
from gsac.cache.half_made import half_made
if len(sys.argv) > 2:
    folder_lock.try_lock = lambda descriptor: None
    import gsac.cache.half_made as module
    module.try_lock = folder_lock.try_lock
with half_made(Path(sys.argv[1])) as (folder, _):
    (folder / "deep").mkdir()
    (folder / "deep" / "half.txt").write_text("half")
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def maker(tmp_path):
    """maker(*arguments): a process that is making something in tmp_path."""
    with starter(MAKE, tmp_path) as start:
        yield start


def kill(process):
    process.kill()
    process.wait()


@pytest.fixture
def without_locks(monkeypatch):
    def refuse(descriptor, how):
        raise OSError(errno.ENOTSUP, "Operation not supported")

    monkeypatch.setattr(folder_lock.fcntl, "flock", refuse)


def test_what_is_half_made_goes_with_its_maker(tmp_path):
    with half_made(tmp_path) as (folder, _):
        (folder / "half.txt").write_text("half")
        sweep(tmp_path)
        assert (folder / "half.txt").exists()
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_process_left_goes_with_the_next_that_makes_something_there(tmp_path, maker):
    kill(maker())
    assert len(list(tmp_path.iterdir())) == 1
    with half_made(tmp_path) as (folder, _):
        assert list(tmp_path.iterdir()) == [folder]


def test_what_a_living_process_is_making_stays(tmp_path, maker):
    process = maker()
    sweep(tmp_path)
    assert len(list(tmp_path.glob("*/deep/half.txt"))) == 1
    process.communicate("")
    assert list(tmp_path.iterdir()) == []


def test_where_folders_cannot_be_locked_the_process_named_in_it_decides(tmp_path, maker, without_locks):
    living, dead = maker("unlocked"), maker("unlocked")
    kill(dead)
    sweep(tmp_path)
    assert len(list(tmp_path.iterdir())) == 1
    kill(living)
    sweep(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_folders_of_other_users_and_machines_and_those_without_the_mark_stay(tmp_path, monkeypatch, without_locks):
    names = [tmp_path / f".gsac-{digit * 16}" for digit in "abc"]
    for folder, owner in zip(names, ("elsewhere boot space 1 1", "", None), strict=True):
        folder.mkdir()
        (folder / ("note" if owner is None else MARK)).write_text(owner or "")
    sweep(tmp_path)
    assert all(any(folder.iterdir()) for folder in names)
    monkeypatch.undo()
    monkeypatch.setattr("os.geteuid", lambda: 12345)
    sweep(tmp_path)
    assert all(any(folder.iterdir()) for folder in names)
    monkeypatch.undo()
    sweep(tmp_path)
    assert list(tmp_path.iterdir()) == [names[2]], "only the one that holds no mark is the user's"


def test_a_process_is_known_as_dead_by_number_start_and_boot():
    host, boot, space, number, started = this_process().split()
    assert not is_dead(this_process()) and not is_dead("") and not is_dead("nonsense")
    assert is_dead(" ".join((host, boot, space, number, "1"))) and is_dead(" ".join((host, "before", space, number, started)))
    assert not is_dead(" ".join(("other", "before", space, "1", "1")))
    assert not is_dead(" ".join((host, boot, "pid:[1]", number, "1")))


def test_where_none_can_be_made_the_place_is_named_and_not_the_folder_that_nobody_asked_for(tmp_path):
    with pytest.raises(FileNotFoundError) as refused, half_made(tmp_path / "gone"):
        pass
    assert refused.value.filename == str(tmp_path / "gone")

import errno
import fcntl
import os
import tempfile
import threading
import time
from pathlib import Path

import pytest

from gsac.cache import lock
from gsac.cache.gc import collect
from gsac.cache.lease import in_use, live_names, single_flight
from gsac.cache.lock import exclusive, if_free, shared
from gsac.cache.store import Store
from gsac.cache.verify import verify
from support.poor_disk import make_poor

TESTS = Path(__file__).parents[1]

@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    """Temporary files of this test alone, in which nothing may stay behind."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setenv("TMPDIR", str(folder))
    lock.without_locks.clear()
    return folder


@pytest.fixture
def poor_store(store, monkeypatch):
    """poor_store(errno, *names): the store's file system refuses these calls from now on."""
    for module, name in ((fcntl, "flock"), (os, "link"), (os, "chmod"), (os, "fchmod"), (os, "fsync")):
        monkeypatch.setattr(module, name, getattr(module, name))
    return lambda errno_of, *names: make_poor(store.root, errno_of, names)


REFUSALS = {
    "no hard links": (errno.EPERM, "link"), "no hard links and modes": (errno.EOPNOTSUPP, "link", "chmod"),
    "no locks": (errno.ENOLCK, "flock"), "no locks and hard links": (errno.ENOSYS, "flock", "link"),
    "no fsync of folders either": (errno.EOPNOTSUPP, "flock", "link", "fsync"),
    "nothing but files": (errno.EPERM, "flock", "link", "chmod"),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_a_store_without_links_locks_or_modes_keeps_heals_and_collects_results(store, poor_store, make, parts_of, unused, what):
    errno_of, *names = REFUSALS[what]
    poor_store(errno_of, *names)
    with in_use(store) as lease, single_flight(store, parts_of().key) as found:
        assert found is None
        record = make(parts_of())
        lease.add(record.key)
        assert live_names(store) == {record.key}
    assert store.lookup(record.key, deep=True) == record
    assert make(parts_of(), "second") == record
    forced = make(parts_of(), "third", replace=True)
    assert store.lookup(record.key) == forced and len(store.record_files()) == 2
    store.path(forced, "clip.json").chmod(0o644) if "chmod" not in names else None
    store.path(forced, "clip.json").write_text("wrong")
    assert store.lookup(record.key) is None
    unused(make(parts_of(), "third"), 7200)
    for file in store.record_files():
        os.utime(file, (0, 0))
    with in_use(store, [record.key]):
        assert len(collect(store, max_bytes=0, grace_s=0.0).in_use) == 2
    assert verify(store).sound
    assert len(collect(store, max_bytes=0, grace_s=0.0).records) == 2
    assert [list((store.root / name).iterdir()) for name in ("tmp", "leases")] == [[], []]


def test_locks_that_are_refused_are_held_elsewhere_on_this_machine_and_that_is_said_once(store, poor_store, temporary):
    said = []
    store.say = said.append
    poor_store(errno.ENOLCK, "flock")
    inside, overlaps = [], []

    def take_turns():
        for _ in range(20):
            with single_flight(store, "k" * 64):
                inside.append(1)
                time.sleep(0.0005)
                overlaps.append(len(inside) > 1)
                inside.pop()

    threads = [threading.Thread(target=take_turns) for _ in range(4)]
    with in_use(store):
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert len(overlaps) == 80 and not any(overlaps)
    assert len(said) == 1 and "has no locks" in said[0] and str(store.root) in said[0]
    assert len(list(temporary.iterdir())) <= 1, "the store's own lock stays, as it does in the store"


def test_a_store_with_locks_says_nothing_of_them_and_leaves_nothing_elsewhere(store, make, parts_of, temporary):
    said = []
    store.say = said.append
    with in_use(store), single_flight(store, parts_of().key):
        make(parts_of())
    assert said == [] and list(temporary.iterdir()) == []


HOLD = f"""
sys.path.insert(0, {str(TESTS)!r})
from support.poor_disk import make_poor
make_poor(store.root, {errno.ENOLCK}, ("flock",))
with single_flight(store, 'k' * 64):
    print('held', flush=True)
    time.sleep(60)
"""


def test_where_locks_are_refused_a_killed_holder_frees_its_key_all_the_same(store, poor_store, child):
    poor_store(errno.ENOLCK, "flock")
    holder = child(HOLD)
    assert holder.stdout.readline() == "held\n"
    with if_free(store.root / "leases" / f"{'k' * 64}.lock") as free:
        assert not free
    assert live_names(store) == {"k" * 64}
    holder.kill()
    holder.wait()
    assert live_names(store) == set()


def test_a_lock_that_cannot_be_taken_for_another_reason_is_an_error(store, poor_store):
    poor_store(errno.EIO, "flock")
    with pytest.raises(OSError, match="Input/output"), shared(store.root / "lock"):
        pass


def test_a_link_in_a_locks_place_is_removed_and_what_it_leads_to_stays_as_it_is(tmp_path):
    (tmp_path / "file").write_text("precious")
    for target in ("file", "nowhere"):
        (tmp_path / "lock").symlink_to(tmp_path / target)
        with shared(tmp_path / "lock"):
            pass
        assert not (tmp_path / "lock").is_symlink()
        (tmp_path / "lock").unlink()
    assert (tmp_path / "file").read_text() == "precious" and not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("content", [(), ("a", "b")])
def test_a_folder_in_a_locks_place_does_not_stand_in_the_way(tmp_path, content):
    (tmp_path / "lock").mkdir()
    for name in content:
        (tmp_path / "lock" / name).write_text(name)
    with exclusive(tmp_path / "lock"):
        assert (tmp_path / "lock").is_file()
    kept = sorted(path.name for path in tmp_path.rglob("*") if path.is_file())
    assert kept == list(content)


@pytest.mark.parametrize("name", ["lock", "leases", "tmp", "objects", "quarantine", "roots", "memo.sqlite"])
@pytest.mark.parametrize("kind", ["file", "folder"])
def test_what_stands_in_the_place_of_the_stores_own_files_never_fails_every_run(tmp_path, make, parts_of, name, kind):
    said, root = [], tmp_path / "other"
    root.mkdir()
    if kind == "file":
        (root / name).write_text("something")
    else:
        (root / name / "inner").mkdir(parents=True)
    for trial in range(2):
        store = Store(root, say=said.append)
        assert store.writable
        with in_use(store) as lease, single_flight(store, parts_of(trial=trial).key):
            record = make(parts_of(trial=trial), store=store)
            lease.add(record.key)
            assert live_names(store) == {record.key}
        assert store.lookup(record.key) == record
        collect(store)
    assert len(said) == (kind == "file" and name not in ("lock", "memo.sqlite"))
    assert all(name in line and "is kept as" in line for line in said)


@pytest.mark.parametrize("kind", ["folder", "full folder", "dead link"])
def test_what_stands_in_the_place_of_a_record_is_a_miss_and_a_new_record_takes_its_place(store, make, parts_of, kind):
    record = make(parts_of())
    file = store.record_path("split", record.key)
    for replace in (False, True):
        file.unlink()
        if kind == "dead link":
            file.symlink_to(store.root / "nowhere")
        else:
            file.mkdir()
        if kind == "full folder":
            Path(file, "something").write_text("of somebody")
        if replace:
            again = make(parts_of(), replace=True)
        else:
            assert store.lookup(record.key) is None
            again = make(parts_of())
        assert store.lookup(record.key) == again


def test_gc_and_ls_pass_over_what_stands_in_the_place_of_a_record(store, make, parts_of):
    record = make(parts_of())
    store.record_path("split", "a" * 64).mkdir()
    store.record_path("split", "b" * 64).symlink_to(store.root / "nowhere")
    collect(store)
    assert store.record_files() == [store.record_path("split", record.key)]

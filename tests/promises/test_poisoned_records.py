"""A store that others can write may waste time: it touches no file outside of it, and passes no damaged record as sound."""

import os
import random
from pathlib import Path

import pytest

from gsac.cache.gc import collect
from gsac.cache.key import KeyParts
from gsac.cache.listing import ls
from gsac.cache.publish import publish
from gsac.cache.record import Record, RunInfo
from gsac.cache.store import Store
from gsac.cache.verify import verify
from gsac.pipeline.placing import place
from support.poison import poison

TRIALS = int(os.environ.get("GSAC_TRIALS", "60"))
OUTPUTS = ("avatar.npz", "body.npz", "frames")
PARTS = KeyParts("train", {"clip": "c" * 64}, {"fps": 5}, {"gsac.toy": "d" * 64})


def make(store: Store, parts: KeyParts = PARTS) -> Record:
    with store.private("train") as folder:
        (folder / "frames").mkdir()
        for name in ("avatar.npz", "body.npz", "frames/0.png", "frames/1.png"):
            (folder / name).write_text(f"{name} of {parts.params}")
        info = RunInfo(seconds=12.5, metrics={"psnr_fg": 11.9}, warnings=["hand 3 not seen"], log_tail="done\n")
        return publish(store, parts, folder, OUTPUTS, info)


def state(folder: Path) -> dict:
    """Everything about the files below a folder."""
    found = {}
    for path in [folder, *folder.rglob("*")]:
        stat = path.lstat()
        content = os.readlink(path) if path.is_symlink() else path.read_bytes() if path.is_file() else None
        found[str(path)] = (stat.st_mode, stat.st_uid, stat.st_ino, stat.st_mtime_ns, content)
    return found


@pytest.fixture
def home(tmp_path) -> Path:
    folder = tmp_path / "home"
    (folder / "Documents" / "deep").mkdir(parents=True, mode=0o700)
    (folder / "Documents" / "deep" / "thesis.txt").write_text("years of work")
    (folder / ".bashrc").write_text("alias ll='ls -l'")
    return folder


def test_poisoned_records_touch_nothing_outside_and_pass_no_wrong_result(tmp_path, home):
    store, out = Store(tmp_path / "store"), tmp_path / "out"
    out.mkdir()
    other = make(store, KeyParts("train", {"clip": "e" * 64}, {"fps": 7}))
    other_file = store.record_path("train", other.key).read_bytes()
    true, before = make(store), state(home)
    file = store.record_path("train", true.key)
    for trial in range(TRIALS):
        poison(random.Random(trial), file, home, other_file)
        if trial % 3 == 1:
            ls(store), store.previous("train", other.parts), store.recent("train", 5)
        if trial % 3 == 2:
            verify(store)
        if trial % 20 == 3:
            collect(store)
        found = store.lookup(PARTS.key, OUTPUTS)
        assert found in (None, true), trial
        again = make(store)
        assert (again.parts, again.outputs, again.info) == (true.parts, true.outputs, true.info), trial
        assert store.lookup(PARTS.key, OUTPUTS) == again, trial
        place(store, again, out, {})
        assert {path.name for path in out.iterdir()} == set(OUTPUTS), trial
        assert (out / "avatar.npz").read_text() == "avatar.npz of {'fps': 5}"
        assert state(home) == before, trial
        true = again
    assert store.lookup(other.key, OUTPUTS) == other


def test_a_link_in_an_object_leads_nobody_out_of_the_store(tmp_path, home):
    store, before = Store(tmp_path / "store"), state(home)
    record = make(store)
    for place_of_link in ("inside", "instead"):
        path = store.path(record, "frames")
        path.chmod(0o755)
        if place_of_link == "inside":
            (path / "away").symlink_to(home / "Documents")
        else:
            path.rename(tmp_path / "kept")
            path.symlink_to(home / "Documents")
        assert store.lookup(record.key, OUTPUTS) is None
        record = make(store)
        store.record_path("train", record.key).unlink()
        collect(store, grace_s=0.0)
        assert state(home) == before
        record = make(store)


def test_work_of_a_stopped_run_is_never_a_link_to_elsewhere(tmp_path, home):
    store = Store(tmp_path / "store")
    (store.root / "partial" / PARTS.key).symlink_to(home / "Documents")
    assert not store.partial(PARTS.key).exists() and (home / "Documents").exists()

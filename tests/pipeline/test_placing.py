"""What a run shows in its folder: links into the store, and in export/ files that are the user's own."""

import functools
import json
import os
import shutil

import pytest

from gsac.cache.key import KeyParts
from gsac.cache.publish import publish
from gsac.cache.record import RunInfo
from gsac.cache.store import Store
from gsac.pipeline import placing
from gsac.pipeline.placing import link, place


class Shelf:
    """A store, a folder, and results of two outputs (a file and a folder) that are placed in it."""

    def __init__(self, root, said):
        self.store, self.folder, self.said = Store(root / "store", say=said.append), root / "run" / "export", said
        self.placed: dict[str, str] = {}

    def record(self, text, stage="export"):
        parts = KeyParts(stage=stage, inputs={"clip": "c" * 64}, params={"text": text})
        with self.store.private(stage) as folder:
            (folder / "unity" / "deep").mkdir(parents=True)
            (folder / "unity" / "deep" / "scene.txt").write_text(f"{text} scene")
            (folder / "avatar.glb").write_text(text)
            return publish(self.store, parts, folder, ("avatar.glb", "unity"), RunInfo())

    def place(self, text, stage="export"):
        self.placed = place(self.store, self.record(text, stage), self.folder, self.placed)

    @property
    def holds(self):
        return {str(path.relative_to(self.folder)): path.read_text() for path in self.folder.rglob("*") if path.is_file()}


BOTH = {"avatar.glb": "one", "unity/deep/scene.txt": "one scene"}


@pytest.fixture
def shelf(tmp_path):
    return Shelf(tmp_path, [])


def test_exported_files_are_the_users_own_to_write_to_and_to_delete_and_the_store_stays_as_it_is(shelf):
    shelf.place("one")
    assert shelf.holds == BOTH and not any(path.is_symlink() for path in shelf.folder.rglob("*"))
    for path in (shelf.folder, *shelf.folder.rglob("*")):
        assert path.stat().st_mode & 0o200 and (path.is_dir() or path.stat().st_nlink == 1), path
    (shelf.folder / "unity" / "deep" / "scene.txt").write_text("mine")
    record = shelf.record("one")
    assert (shelf.store.path(record, "unity") / "deep" / "scene.txt").read_text() == "one scene"
    assert shelf.store.lookup(record.key, deep=True) == record
    shutil.rmtree(shelf.folder)


def test_exported_files_outlive_the_cache(shelf):
    shelf.place("one")
    shutil.rmtree(shelf.store.root, ignore_errors=True)
    assert shelf.holds == BOTH


def test_an_exported_file_that_nobody_edited_is_replaced_in_place_and_nothing_is_said(shelf):
    shelf.place("one")
    shelf.place("two")
    assert shelf.holds == {"avatar.glb": "two", "unity/deep/scene.txt": "two scene"} and shelf.said == []
    assert {path.name for path in shelf.folder.iterdir()} == {"avatar.glb", "unity"}


def test_edited_files_and_folders_are_moved_aside_and_named_however_often(shelf):
    for text, mine in (("one", "mine 1"), ("two", "mine 2"), ("two", "mine 3")):
        shelf.place(text)
        (shelf.folder / "avatar.glb").write_text(mine)
        (shelf.folder / "unity" / "added.txt").write_text(mine)
    shelf.place("two")
    kept = {name: text for name, text in shelf.holds.items() if "kept" in name and "scene" not in name}
    assert kept == {name.format(number): f"mine {i}" for i, number in enumerate(("", "-2", "-3"), 1)
                    for name in ("avatar-kept{}.glb", "unity-kept{}/added.txt")}
    assert shelf.holds["avatar.glb"] == "two" and "unity/added.txt" not in shelf.holds
    assert len(shelf.said) == 6 and all(any(name in line for line in shelf.said) for name in ("avatar-kept-2.glb", "unity-kept-3"))


@pytest.mark.parametrize("stage", ["export", "train"])
def test_what_was_never_placed_is_not_ours_and_is_moved_aside(shelf, stage, tmp_path):
    (shelf.folder / "unity").mkdir(parents=True)
    (shelf.folder / "unity" / "mine.txt").write_text("mine")
    (tmp_path / "my.glb").write_text("my own glb")
    (shelf.folder / "avatar.glb").symlink_to(tmp_path / "my.glb")
    shelf.place("one", stage)
    assert (shelf.folder / "unity-kept" / "mine.txt").read_text() == "mine" and len(shelf.said) == 2
    assert os.readlink(shelf.folder / "avatar-kept.glb") == str(tmp_path / "my.glb")
    assert BOTH.items() <= shelf.holds.items() or stage == "train"


def test_other_stages_are_shown_as_links_and_take_the_place_of_links_alone(shelf):
    shelf.place("one", "train")
    shelf.place("two", "train")
    assert all((shelf.folder / name).is_symlink() for name in ("avatar.glb", "unity")) and shelf.placed == {}
    assert (shelf.folder / "avatar.glb").read_text() == "two" and shelf.said == []


def test_links_of_an_older_run_become_real_files_even_where_their_cache_is_gone(shelf):
    record = shelf.record("one")
    for output in record.outputs:
        inside = shelf.store.path(record, output).relative_to(shelf.store.root)
        link(shelf.store.root.with_name("gone") / inside, shelf.folder / output)
    shelf.place("one")
    assert shelf.holds == BOTH and shelf.said == []


def test_placing_what_is_there_copies_nothing_and_keeps_the_inode(shelf, monkeypatch):
    shelf.place("one")
    before = {path: path.stat().st_ino for path in shelf.folder.rglob("*")}
    monkeypatch.setattr(placing, "copy", None)
    shelf.place("one")
    assert before == {path: path.stat().st_ino for path in shelf.folder.rglob("*")}


def test_blocks_are_shared_where_the_file_system_can(shelf, monkeypatch):
    def clone(target, request, source):
        assert request == 0x40049409
        os.write(target.fileno(), b"shared")

    monkeypatch.setattr(placing.fcntl, "ioctl", clone)
    shelf.place("one")
    assert set(shelf.holds.values()) == {"shared"}


def test_a_copy_that_breaks_off_leaves_what_was_there_and_nothing_beside_it(shelf, monkeypatch):
    def full(reading, writing, length):
        raise OSError(28, "No space left on device")

    shelf.place("one")
    monkeypatch.setattr(placing.shutil, "copyfileobj", full)
    monkeypatch.setattr(placing.fcntl, "ioctl", lambda *of: full(*of))
    with pytest.raises(OSError, match="No space"):
        shelf.place("two")
    assert shelf.holds == BOTH and {path.name for path in shelf.folder.iterdir()} == {"avatar.glb", "unity"}


@pytest.fixture
def no_links(monkeypatch):
    """A file system that knows no links."""
    def refuse(self, target, target_is_directory=False):
        raise OSError("no links here")

    monkeypatch.setattr(placing.Path, "symlink_to", refuse)


def test_a_folder_without_links_gets_copies_which_are_known_again(no_links, shelf):
    shelf.place("one", "train")
    assert shelf.holds == BOTH and not (shelf.folder / "unity").is_symlink()
    shelf.place("two", "train")
    assert shelf.holds["avatar.glb"] == "two" and shelf.said == []


@pytest.fixture
def gsac(inside, toy):
    """`gsac` in this process, its stages in theirs."""
    return functools.partial(inside, toy, PYTHONPATH=toy.env["PYTHONPATH"])


def test_a_clip_that_had_to_be_copied_is_taken_again_and_gives_way_to_another_one(no_links, gsac, toy):
    words = ("run", toy.clip, "--out", toy.out)
    assert gsac(*words).code == 0 and not (toy.out / "clip").is_symlink()
    again = gsac(*words, "--json")
    assert again.code == 0 and set(again.statuses.values()) == {"cached"}
    other = toy.root / "other.mp4"
    other.write_text("omega psi")
    assert gsac("run", other, "--out", toy.out, "--replace").code == 0
    assert (toy.out / "clip").read_text() == "omega psi" and toy.result == "OMEGA OMEGA"


def test_a_users_own_file_in_the_place_of_the_clip_is_never_lost(no_links, gsac, toy):
    words = ("run", toy.clip, "--out", toy.out)
    gsac(*words)
    (toy.out / "clip").write_text("precious")
    refused = gsac(*words)
    assert refused.code == 2 and "nor a copy that gsac made; move it away" in refused.err
    assert (toy.out / "clip").read_text() == "precious"
    toy.clip.write_text("precious")
    assert gsac(*words, "--replace").code == 0, "the clip itself, by its content"
    toy.clip.write_text("other words")
    assert gsac(*words, "--replace").code == 2 and (toy.out / "clip").read_text() == "precious"


@pytest.fixture
def exporting(toy):
    """The toy project, whose last stage is called export."""
    toy.call_last_stage_export()
    return toy


def test_a_run_keeps_what_the_user_edited_in_export_and_says_where(exporting):
    toy = exporting
    toy.ran()
    out = toy.out / "export" / "out.txt"
    assert not out.is_symlink() and (toy.out / "cut" / "words").is_symlink()
    out.write_text("mine")
    assert toy.gsac("status", toy.out).code == 3
    done = toy.run()
    assert set(done.statuses.values()) == {"cached"} and out.read_text() == "ALPHA ALPHA"
    assert (toy.out / "export" / "out-kept.txt").read_text() == "mine" and "out-kept.txt" in done.err
    done = toy.run("--set", "left.word=last")
    assert out.read_text() == "GAMMA ALPHA" and "kept" not in done.err
    assert toy.gsac("status", toy.out, "--set", "left.word=last").code == 0


def test_a_stage_alone_places_as_a_run_does(exporting):
    toy = exporting
    toy.ran()
    (toy.out / "export" / "out.txt").write_text("mine")
    done = toy.gsac("stage", "export", cwd=toy.out)
    assert done.code == 0 and (toy.out / "export" / "out-kept.txt").read_text() == "mine" and "out-kept.txt" in done.err
    assert {"export/out.txt", "export/metrics.json"} <= json.loads((toy.out / ".placed.json").read_text()).keys()


def test_a_readers_own_copy_in_the_place_of_a_link_is_not_removed(toy):
    toy.ran()
    words = toy.out / "cut" / "words"
    words.unlink()
    words.mkdir()
    (words / "000000.txt").write_text("my own words")
    done = toy.run()
    assert done.code == 0 and words.is_symlink() and "words-kept" in done.err
    assert (toy.out / "cut" / "words-kept" / "000000.txt").read_text() == "my own words"

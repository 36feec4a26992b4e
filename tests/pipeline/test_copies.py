"""Real files in the place of links, for a folder that outlives its store, as a container's does."""

import os
import shutil

import pytest

from support.toy import Toy


@pytest.fixture
def copying(toy, monkeypatch) -> Toy:
    monkeypatch.setenv("GSAC_COPY", "1")
    return toy


def links(toy: Toy) -> list[str]:
    return [str(path.relative_to(toy.out)) for path in toy.out.rglob("*") if path.is_symlink()]


def test_a_folder_of_real_files_outlives_its_store(copying, tmp_path):
    copying.ran()
    assert links(copying) == ["clip"]
    shutil.rmtree(copying.cache)
    assert copying.result == "ALPHA ALPHA" and (copying.out / "cut" / "words" / "000000.txt").read_text() == "alpha"
    assert copying.gsac("report", copying.out).code == 0
    moved = copying.out.rename(tmp_path / "on another machine")
    assert copying.gsac("status", moved).code == 3, "the store is gone, the results are not"
    assert copying.gsac("run", copying.clip, "--out", moved).code == 0
    assert not list(moved.rglob("*kept*"))


def test_runs_again_copy_nothing_and_new_results_take_the_place_of_old_ones(copying):
    copying.ran()
    before = {path: path.stat().st_ino for path in copying.out.glob("*/*") if path.parent.name != "logs"}
    done = copying.run()
    assert set(done.statuses.values()) == {"cached"} and "kept" not in done.err
    assert before == {path: path.stat().st_ino for path in before}
    done = copying.run("--set", "left.word=last")
    assert copying.result == "GAMMA ALPHA" and "kept" not in done.err and links(copying) == ["clip"]


def test_links_become_files_and_what_was_edited_is_kept(toy, monkeypatch):
    toy.ran()
    assert len(links(toy)) == 6
    monkeypatch.setenv("GSAC_COPY", "1")
    toy.ran()
    assert links(toy) == ["clip"]
    (toy.out / "left" / "out.txt").write_text("mine")
    done = toy.run()
    assert (toy.out / "left" / "out-kept.txt").read_text() == "mine" and "out-kept.txt" in done.err
    monkeypatch.delenv("GSAC_COPY")
    assert toy.ran() == [] and links(toy) == ["clip"], "what lies there is as good as a link"
    assert os.access(toy.out / "left" / "out.txt", os.W_OK)

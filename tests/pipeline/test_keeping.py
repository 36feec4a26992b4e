"""gsac cache gc and ls know the folders of runs."""

import json
import os
import shutil
import time
from pathlib import Path

import pytest

from gsac.cache.key import KeyParts
from gsac.cache.publish import publish
from gsac.cache.record import RunInfo
from gsac.cache.store import Store
from gsac.pipeline.cli import execute
from gsac.pipeline.run_folder import RunFolder

DAY = 86400.0
RUNS = 20


class Runs:
    """Twenty folders of runs over one store: each has three stages, the first of which two clips share."""

    def __init__(self, root: Path):
        self.store, self.root = Store(root / "cache"), root / "runs"
        self.folders = [RunFolder(self.root / f"person{number}-avatar") for number in range(RUNS)]
        for number, folder in enumerate(self.folders):
            folder.root.mkdir(parents=True)
            folder.clip.symlink_to(root / f"person{number}.mp4")
            for stage, text in (("split", f"{number // 2}"), ("train", f"{number}"), ("export", f"{number}")):
                folder.place(self.store, self.publish(stage, text))
        self.publish("train", "an experiment that no folder shows")
        self.turn_back(10 * DAY)

    def publish(self, stage: str, text: str):
        parts = KeyParts(stage=stage, inputs={"clip": "c" * 64}, params={"text": text})
        with self.store.private(stage) as folder:
            (folder / "frames").mkdir()
            (folder / "frames" / "0.png").write_text(f"{stage} {text} frame " * 50)
            (folder / "a.npz").write_text(f"{stage} {text} " * 100)
            return publish(self.store, parts, folder, ("frames", "a.npz"), RunInfo())

    def turn_back(self, seconds: float) -> None:
        for file in self.store.record_files():
            os.utime(file, (time.time() - seconds,) * 2)

    def contents(self) -> dict[str, bytes]:
        """What a reader finds in the folders; a dead link is absent."""
        return {str(Path(folder, name).relative_to(self.root)): Path(folder, name).read_bytes()
                for folder, _, names in os.walk(self.root, followlinks=True) for name in names if Path(folder, name).is_file()}


@pytest.fixture
def runs(tmp_path, monkeypatch):
    monkeypatch.setenv("GSAC_CACHE", str(tmp_path / "cache"))
    return Runs(tmp_path)


def gc(capsys, *words):
    code = execute(["cache", "gc", *words])
    said = capsys.readouterr()
    assert code == 0, said.err
    return said.out + said.err


@pytest.mark.parametrize("words", [
    [], ["--keep-days", "0"], ["--keep-days", "1"], ["--max-size", "0"], ["--max-size", "1K"],
    ["--keep-days", "0", "--max-size", "0"], ["--keep-days", "0", "--max-size", "0", "--json"],
    ["--keep-days", "0", "--max-size", "0", "--dry-run"], ["--keep-days", "0", "--force", "--dry-run"]], ids=" ".join)
def test_no_folder_loses_a_file_by_gc_with_any_options_but_force(runs, capsys, words):
    before = runs.contents()
    assert len(before) == RUNS * 7
    said = gc(capsys, *words)
    assert runs.contents() == before
    bound = "--keep-days" in words or "--max-size" in words
    assert len(runs.store.record_files("train")) == RUNS + (not bound or "--dry-run" in words)
    assert (f"{RUNS} folders keep what they show" in said) == (bound and "--force" not in words)
    for folder in runs.folders if bound else []:
        verb = "would lose" if "--force" in words else "keeps"
        assert f"{folder.root} {verb} split/a.npz, split/frames, train/a.npz, train/frames\n" in said


def test_force_takes_what_folders_show_but_never_their_own_files_and_names_each(runs, capsys):
    said = gc(capsys, "--keep-days", "0", "--force")
    assert set(runs.contents()) == {f"person{n}-avatar/{name}" for n in range(RUNS)
                                    for name in (".placed.json", "export/a.npz", "export/frames/0.png")}
    assert all(f"{folder.root} loses split/a.npz, split/frames, train/a.npz, train/frames\n" in said for folder in runs.folders)


def test_a_folder_that_is_gone_keeps_nothing_and_drops_out(runs, capsys):
    for folder in runs.folders[2:]:
        shutil.rmtree(folder.root)
    before = runs.contents()
    gc(capsys, "--keep-days", "0", "--dry-run")
    assert len(list((runs.store.root / "roots").iterdir())) == RUNS, "a dry run changes nothing"
    gc(capsys, "--keep-days", "0")
    assert runs.contents() == before
    assert len(list((runs.store.root / "roots").iterdir())) == 2
    assert sorted(file.parent.name for file in runs.store.record_files()) == ["split", "train", "train"]


def test_what_a_folder_shows_stays_even_where_its_record_is_lost(runs, capsys):
    before = runs.contents()
    for file in runs.store.record_files():
        file.unlink()
    gc(capsys, "--keep-days", "0", "--max-size", "0")
    assert runs.contents() == before


def test_gc_says_that_results_of_the_last_hour_stay(runs, capsys):
    for file in runs.store.record_files("train")[:2]:
        os.utime(file)
    assert "2 results stay since they were used within the last hour" in gc(capsys, "--max-size", "0", "--dry-run")
    assert "last hour" not in gc(capsys, "--max-size", "1G", "--dry-run")


def test_ls_names_clip_and_folder_of_each_result(runs, capsys):
    execute(["cache", "ls", "--json"])
    said = capsys.readouterr()
    rows = json.loads(said.out.splitlines()[-1])["results"]
    assert {len(row["folders"]) for row in rows if row["stage"] == "split"} == {2}
    assert {(row["clips"][0], row["folders"][0]) for row in rows if row["stage"] == "export"} == {
        (f"person{n}.mp4", str(folder.root)) for n, folder in enumerate(runs.folders)}
    assert [row["folders"] for row in rows if not row["clips"]] == [[]]
    lines = said.err.splitlines()
    assert sum("person7.mp4  " in line and line.endswith(str(runs.folders[7].root)) for line in lines) == 2
    assert sum(line.endswith(f"person6.mp4  {runs.folders[6].root} and 1 more") for line in lines) == 1
    assert sum(line.endswith("  -") for line in lines) == 1


def test_a_run_registers_its_folder_and_gc_leaves_it_whole(toy):
    toy.ran()
    for file in (toy.cache / "actions").glob("*/*.json"):
        os.utime(file, (time.time() - 10 * DAY,) * 2)
    done = toy.gsac("cache", "gc", "--keep-days", "1", "--json")
    assert done.code == 0 and done.json["records"] == [] and list(done.json["kept"]) == [str(toy.out)]
    assert toy.ran() == [] and toy.result == "ALPHA ALPHA"

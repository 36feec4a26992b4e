"""Real and edited files of the user's under an output folder: none is removed or written over, whatever a command does there.

What stands in the way is moved aside and named, or the command stops and says how to go on.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from gsac.pipeline.cli import execute
from gsac.pipeline.journal import Journal
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.reporter import words_of
from support.toy import Toy

MINE = "mine, and precious"


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The toy project with the results of two sets of parameters in its cache, and the folder of the first."""
    toy = Toy(tmp_path_factory.mktemp("finished"))
    toy.call_last_stage_export()
    assert toy.run("--set", "left.word=last", "--out", toy.root / "other").code == 0
    assert toy.run().code == 0
    return toy


@pytest.fixture
def out(finished, tmp_path, monkeypatch):
    """A folder of its own with the finished run; commands in this process see the project."""
    for name in ("GSAC_STAGES", "GSAC_CACHE", "TOY_RUNS", "PYTHONPATH"):
        monkeypatch.setenv(name, finished.env[name])
    shutil.copytree(finished.out, tmp_path / "out", symlinks=True)
    with finished.importable():
        yield tmp_path / "out"


def put(path: Path) -> None:
    clear(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(MINE)


def put_folder(path: Path) -> None:
    clear(path)
    put(path / "deep" / "note.txt")


def clear(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)


def add_to(path: Path) -> None:
    path.write_text(path.read_text() + f"\n# {MINE}\n")


def keep_stat(path: Path) -> None:
    """An edit that neither size nor date betrays."""
    stat, size = path.stat(), len(path.read_bytes())
    path.write_text(MINE[:size])
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def link_to_mine(path: Path, *inside: str) -> None:
    """A link to a folder of the user's with files of these names, or to a file."""
    clear(path)
    mine = path.parents[1] / "elsewhere"
    for name in inside:
        put(mine / name)
    if not inside:
        put(mine)
    path.symlink_to(mine)


def put_read_only(path: Path) -> None:
    put(path)
    path.chmod(0o444)


def put_dead_link(path: Path) -> None:
    clear(path)
    path.symlink_to(path.parent / MINE)


def put_twice(path: Path) -> None:
    put(path)
    put(path.with_name(f"{path.stem}-kept{path.suffix}"))


CASES = {
    "a file in the place of a link": (put, "left/out.txt"),
    "a file in the place of a link to a folder": (put, "cut/words"),
    "a folder in the place of a link to a folder": (put_folder, "cut/words"),
    "a folder in the place of a link to a file": (put_folder, "left/out.txt"),
    "a link to a file of the user's": (link_to_mine, "left/out.txt"),
    "a dead link of the user's": (put_dead_link, "left/out.txt"),
    "a read-only file": (put_read_only, "left/out.txt"),
    "a stage's folder is a link to a folder of the user's": (link_to_mine, "left", "out.txt", "letter.txt"),
    "the same, with a folder in it": (link_to_mine, "cut", "words/a.txt", "words/b.txt"),
    "the export folder is one": (link_to_mine, "export", "out.txt", "metrics.json"),
    "a stage's folder is a file": (put, "right"),
    "a stage's folder is a dead link": (put_dead_link, "right"),
    "an edited export": (put, "export/out.txt"),
    "an edited export of the same size and date": (keep_stat, "export/out.txt"),
    "an edited export where the name aside is taken": (put_twice, "export/out.txt"),
    "a read-only edited export": (put_read_only, "export/out.txt"),
    "a folder in the place of an export": (put_folder, "export/out.txt"),
    "a link in the place of an export": (link_to_mine, "export/out.txt"),
    "files added to the exports": (put, "export/scene.blend"),
    "files added beside the results": (put, "left/notes/today.txt"),
    "a file called as what is half made": (put, ".gsac-0123456789abcdef"),
    "a folder called as what is half made": (put_folder, "export/.gsac-0123456789abcdef"),
    "a hidden file with a process's number": (put, f"export/.out.txt-{os.getpid()}"),
    "a report of the user's": (put, "report.html"),
    "a report that is a link": (link_to_mine, "report.html"),
    "a report that is a folder": (put_folder, "report.html"),
    "an edited report": (add_to, "report.html"),
    "run.json of the user's": (put, "run.json"),
    "edited metrics": (add_to, "metrics.json"),
    "edited parameters": (add_to, "params.yaml"),
    "read-only parameters of the user's": (put_read_only, "params.yaml"),
    "an edited graph": (add_to, "dvc.yaml"),
    "logs that are a link": (link_to_mine, "logs", "cut.log"),
    "logs that are a file": (put, "logs"),
    "a clip of the user's in the place of its link": (put, "clip"),
}


def mine_below(root: Path) -> list[str]:
    """Where the user's texts lie, links not followed; a dead link counts by what it says."""
    found = [path for path in sorted(root.rglob("*")) if not path.is_dir() or path.is_symlink()]
    return [str(path) for path in found if MINE[:5] in (os.readlink(path) if path.is_symlink() and not path.exists()
                                                        else path.read_text() if path.is_file() and not path.is_symlink() else "")]


@pytest.mark.parametrize("word", ["first", "last"])
@pytest.mark.parametrize("case", CASES)
def test_nothing_of_the_users_is_removed_by_a_run(case, word, finished, out, capfd):
    spoil, name, *more = CASES[case]
    spoil(out / name, *more)
    before = mine_below(out.parent)
    assert before
    code = execute(["run", str(finished.clip), "--out", str(out), "--set", f"left.word={word}"])
    said = capfd.readouterr().err
    after = mine_below(out.parent)
    assert len(after) == len(before), said
    for path in set(after) - set(before):
        assert any(str(place) in said for place in (Path(path), *Path(path).parents) if "-kept" in place.name), said
    if code != ExitCode.OK:
        assert code == ExitCode.USAGE and after == before and str(out) in said, said
    assert not list((out.parent / "elsewhere").rglob("*kept*")), "a folder of the user's is left as it is"


@pytest.mark.parametrize("name", ["report.html", "run.json", "params.yaml", "metrics.json", "cut/mine.txt", "logs/cut.log",
                                  "dvc.yaml"])
def test_a_folder_that_is_not_a_runs_is_refused_as_it_is(name, finished, out, tmp_path, capfd):
    put(tmp_path / "fresh" / name)
    assert execute(["run", str(finished.clip), "--out", str(tmp_path / "fresh")]) == ExitCode.USAGE
    assert "choose another --out" in capfd.readouterr().err
    assert [path.name for path in (tmp_path / "fresh").rglob("*") if path.is_file()] == [Path(name).name]


def test_a_folder_of_photos_takes_no_results(finished, tmp_path, capfd):
    for name in ("photos/1.jpg", "photos/2.JPG", "photos/notes.txt"):
        put(tmp_path / name)
    assert execute(["run", str(finished.clip), "--out", str(tmp_path / "photos")]) == ExitCode.USAGE
    assert "photos holds 2 photos, a clip of its own" in " ".join(capfd.readouterr().err.split())
    assert sorted(path.name for path in (tmp_path / "photos").iterdir()) == ["1.jpg", "2.JPG", "notes.txt"]


@pytest.mark.parametrize("name", ["report.html", "metrics.json", "export/out.txt"])
def test_replacing_a_clip_keeps_what_was_edited(name, finished, out, tmp_path, capfd):
    add_to(out / name)
    other = tmp_path / "other.mp4"
    other.write_text("omega")
    assert execute(["run", str(other), "--out", str(out), "--replace", "--until", "cut"]) == ExitCode.OK
    assert sum(MINE in path.read_text() for path in out.rglob("*") if path.is_file()) == 1


def test_a_demo_keeps_a_folder_that_lies_where_its_clip_goes(tmp_path, monkeypatch):
    from gsac.pipeline.commands import demo
    from gsac.turntable import clip

    def write_clip(folder, **options):
        folder.mkdir()
        (folder / "clip.mp4").write_text("film")
        return folder / "clip.mp4"

    said = []
    put(tmp_path / "clip" / "holiday.mp4")
    monkeypatch.setattr(clip, "make_clip", write_clip)
    journal = Journal(lambda event: said.append(words_of(event)))
    assert demo.make_truth_clip(tmp_path / "clip", journal).read_text() == "film"
    assert (tmp_path / "clip-kept" / "holiday.mp4").read_text() == MINE and "clip-kept" in said[2]

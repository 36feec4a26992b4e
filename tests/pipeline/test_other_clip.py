"""A folder that holds another clip's avatar is not silently made this one's; a mistake leaves no folder."""

import json
import re

import pytest

from gsac.pipeline.batch import make_jobs
from gsac.pipeline.commands.run import default_out
from gsac.pipeline.run_folder import RunFolder


@pytest.fixture
def other(toy):
    clip = toy.root / "other.mp4"
    clip.write_text("omega psi")
    return clip


def test_another_clips_avatar_is_not_replaced_and_the_clip_that_is_there_is_named(toy, other):
    toy.ran()
    done = toy.gsac("run", other, "--out", toy.out)
    assert done.code == 2 and f"{toy.out} holds the avatar of {toy.clip}; give another --out, or --replace" in done.err
    assert toy.result == "ALPHA ALPHA" and (toy.out / "clip").resolve() == toy.clip
    assert toy.gsac("status", toy.out).code == 0


def test_a_dry_run_refuses_what_the_run_would_refuse_and_plans_what_it_would_replace(toy, other):
    toy.ran()
    done = toy.gsac("run", other, "--out", toy.out, "--dry-run")
    assert done.code == 2 and f"{toy.out} holds the avatar of {toy.clip}; give another --out, or --replace" in done.err
    assert toy.gsac("run", other, "--out", toy.out, "--dry-run", "--replace").code == 0
    assert toy.result == "ALPHA ALPHA" and (toy.out / "clip").resolve() == toy.clip


def test_phone_clips_of_one_name_do_not_take_each_others_folder(toy):
    for name, words in (("pa", "alpha beta"), ("pb", "gamma delta")):
        (toy.root / name).mkdir()
        (toy.root / name / "IMG_0001.mp4").write_text(words)
    assert toy.gsac("run", "pa/IMG_0001.mp4").code == 0
    assert toy.gsac("run", "pb/IMG_0001.mp4").code == 2
    assert (toy.root / "IMG_0001-avatar" / "join" / "out.txt").read_text() == "ALPHA ALPHA"


def test_replace_puts_the_new_clip_in_and_nothing_speaks_of_the_old_one(toy, other):
    toy.ran()
    assert toy.gsac("run", other, "--out", toy.out, "--replace", "--until", "cut").code == 0
    run = json.loads((toy.out / "run.json").read_text())
    assert run["clip"] == str(other) and [row["name"] for row in run["stages"]] == ["cut"]
    assert json.loads((toy.out / "metrics.json").read_text()) == {}
    assert "<h1>other.mp4</h1>" in (toy.out / "report.html").read_text()
    assert toy.gsac("run", other, "--out", toy.out).code == 0 and toy.result == "OMEGA OMEGA"


def test_a_replace_that_is_refused_takes_nothing(toy, other):
    toy.ran()
    (toy.out / "clip").unlink()
    (toy.out / "clip").write_text("precious")
    assert toy.gsac("run", other, "--out", toy.out, "--replace").code == 2
    assert (toy.out / "run.json").exists() and (toy.out / "report.html").exists()


def test_the_same_content_moved_and_the_same_path_with_new_content_go_on(toy):
    toy.ran()
    moved = toy.clip.rename(toy.root / "moved.mp4")
    assert toy.gsac("run", moved, "--out", toy.out).code == 0
    moved.write_text("omega psi")
    assert toy.gsac("run", moved, "--out", toy.out).code == 0
    assert toy.result == "OMEGA OMEGA"


def test_a_folder_in_which_nothing_was_finished_is_anybodys(toy, other):
    toy.out.mkdir()
    assert toy.run("--set", "cut.trouble=stage").code == 1
    assert toy.gsac("run", other, "--out", toy.out).code == 0


def test_a_mistaken_input_leaves_no_folder(toy):
    done = toy.run("--set", "cut.trouble=bad input")
    assert done.code == 2 and "the clip holds no words" in done.err and "log:" not in done.err
    assert not toy.out.exists()
    assert toy.gsac("run", toy.clip, "--out", "deep/deeper/out", "--set", "cut.trouble=bad input").code == 2
    assert not (toy.root / "deep").exists()


def test_a_mistake_takes_nothing_that_was_there(toy):
    toy.out.mkdir()
    (toy.out / "letter.txt").write_text("mine")
    assert toy.run("--set", "cut.trouble=bad input").code == 2
    assert (toy.out / "letter.txt").read_text() == "mine"
    toy.ran()
    assert toy.run("--force", "cut", "--set", "cut.trouble=bad input").code == 2
    assert toy.result == "ALPHA ALPHA"


def test_what_was_finished_before_a_mistake_stays(toy):
    assert toy.run("--set", "left.trouble=bad input").code == 2
    assert (toy.out / "cut" / "words").exists() and (toy.out / "run.json").exists()


def test_folders_of_photos_whose_names_differ_behind_a_dot_have_folders_of_their_own(tmp_path):
    clips = [tmp_path / "turn.v1", tmp_path / "turn.v2", tmp_path / "turn.mp4", tmp_path / "b" / "turn.mp4"]
    for clip in clips[:2]:
        clip.mkdir()
    names = ["turn.v1-avatar", "turn.v2-avatar", "turn-avatar"]
    assert [default_out(clip).name for clip in clips] == [*names, "turn-avatar"]
    jobs = make_jobs(clips, tmp_path, ())
    assert [job.out.name for job in jobs] == [*names, "turn-2-avatar"]
    assert [job.name for job in jobs] == ["turn.v1", "turn.v2", "turn.mp4", "turn.mp4 (turn-2-avatar)"]


def test_a_run_goes_into_the_folder_around_another_run_and_leaves_that_as_it_is(toy, other):
    inner = toy.out / "inner"
    assert toy.gsac("run", toy.clip, "--out", inner).code == 0
    assert toy.gsac("run", other, "--out", toy.out).code == 0 and toy.result == "OMEGA OMEGA"
    assert (inner / "join" / "out.txt").read_text() == "ALPHA ALPHA" and (inner / "clip").resolve() == toy.clip
    assert toy.gsac("run", toy.clip, "--out", inner).code == toy.gsac("status", inner).code == 0
    assert RunFolder(toy.out).links().keys() == RunFolder(inner).links().keys()


@pytest.mark.parametrize("inside", ["export", "join", "new/deep"])
def test_nothing_of_a_run_is_written_into_the_folder_of_another(toy, other, inside):
    toy.ran()
    before = sorted(toy.out.rglob("*"))
    for dry in ([], ["--dry-run"]):
        done = toy.gsac("run", other, "--out", toy.out / inside, *dry)
        assert done.code == 2 and f"{toy.out / inside} lies in {toy.out}, the folder of another run; choose" in done.err
    assert sorted(toy.out.rglob("*")) == before


@pytest.mark.parametrize("inside", [".", "export"])
def test_a_clip_that_is_run_from_within_another_runs_folder_is_refused_with_the_words_that_work(toy, other, inside):
    toy.ran()
    (toy.out / inside).mkdir(exist_ok=True)
    before = sorted(toy.out.rglob("*"))
    refused = toy.gsac("run", other, cwd=toy.out / inside)
    assert refused.code == 2 and f"this folder is that of a run, {toy.out}" in refused.err
    words = re.search(r"give `(--out [^`]+)`", " ".join(refused.err.split()))
    assert words is not None
    assert toy.gsac("run", other, *words[1].split(), cwd=toy.out / inside).code == 0
    assert (toy.out.parent / "other-avatar" / "join" / "out.txt").read_text() == "OMEGA OMEGA"
    assert sorted(toy.out.rglob("*")) == before


@pytest.mark.parametrize("lost", ["run.json", "clip"])
def test_a_folder_that_has_lost_its_record_or_its_clip_is_still_the_other_clips(toy, other, lost):
    toy.ran()
    if lost == "run.json":
        (toy.out / lost).unlink()
    else:
        run = json.loads((toy.out / "run.json").read_text())
        (toy.out / "run.json").write_text(json.dumps(run | {"clip_digest": None}))
        toy.clip.unlink()
    done = toy.gsac("run", other, "--out", toy.out)
    assert done.code == 2 and f"holds the avatar of {toy.clip}" in done.err and toy.result == "ALPHA ALPHA"

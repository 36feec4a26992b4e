"""What a user can get wrong: every mistake is answered by a sentence that names it, and costs nothing that was there."""

import io
import json
import os
import shutil
import signal
import subprocess
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest

from gsac.pipeline import errors
from gsac.pipeline.cli import execute
from gsac.pipeline.journal import Journal
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.pace import Pace
from gsac.pipeline.reporter import PlainReporter
from gsac.stages.contract import BadInput, Output, Stage, make_config


def quiet(done, code):
    """A sentence for people, no traceback."""
    assert done.code == code, done.err
    assert "Traceback" not in done.err and done.err.splitlines()[-1].startswith("gsac: ")
    return done.err


@pytest.mark.parametrize("mistake", [
    ["--set", "cut.wrod=last"], ["--set", "nothing"], ["--params", "absent.yaml"], ["--until", "nowhere"],
    ["--from", "nowhere"], ["--force", "nowhere"],
])
def test_json_answers_bad_input_with_one_object_that_says_the_error(toy, mistake):
    done = toy.run(*mistake)
    quiet(done, ExitCode.USAGE)
    assert len(done.out.splitlines()) == 1 and done.json["stages"] == []
    assert done.json["error"] in done.err


def test_json_of_a_failed_stage_is_still_one_object(toy):
    done = toy.run("--set", "left.trouble=stage")
    assert len(done.out.splitlines()) == 1 and done.statuses == {"cut": "ran", "left": "failed"}


@pytest.mark.parametrize("command", ["run", "check"])
def test_a_clip_that_is_a_device_or_a_pipe_is_named(toy, command):
    os.mkfifo(toy.root / "pipe.mp4")
    for clip in ("/dev/zero", "pipe.mp4"):
        assert f"{clip} is no regular file; give a video" in quiet(toy.gsac(command, clip), ExitCode.USAGE)


def test_json_answers_a_clip_that_is_not_there(toy):
    done = toy.gsac("run", "nowhere.mp4", "--json")
    assert "nowhere.mp4: no such file" in quiet(done, ExitCode.USAGE) and "nowhere.mp4" in done.json["error"]


def test_one_command_after_another_in_one_process_both_answer(toy, capsys, monkeypatch):
    for name in ("GSAC_CACHE", "PYTHONPATH"):
        monkeypatch.setenv(name, toy.env[name])
    for _ in range(2):
        assert execute(["run", "nowhere.mp4", "--json"]) == ExitCode.USAGE
        assert "nowhere.mp4" in json.loads(capsys.readouterr().out)["error"]


def test_out_below_a_file_is_the_users_mistake(toy):
    toy.root.joinpath("note").write_text("mine")
    assert "note" in quiet(toy.gsac("run", toy.clip, "--out", "note/out"), ExitCode.USAGE)
    assert toy.root.joinpath("note").read_text() == "mine"


@pytest.mark.parametrize("theirs", ["cut/words/letter.txt", "report.html", "params.yaml", "metrics.json", "logs/mine.log", "join"])
def test_files_of_someone_else_in_out_are_never_written_over(toy, theirs):
    path = toy.out / theirs
    path.parent.mkdir(parents=True)
    path.write_text("mine")
    assert theirs.partition("/")[0] in quiet(toy.run(), ExitCode.USAGE)
    assert path.read_text() == "mine" and toy.runs == []


def test_other_files_in_out_stay_beside_the_results(toy):
    toy.out.mkdir()
    (toy.out / "letter.txt").write_text("mine")
    assert toy.ran() and (toy.out / "letter.txt").read_text() == "mine"
    assert toy.ran() == [], "and its own folder is known again"


@pytest.mark.parametrize("out", [".", "out", "deep/out"])
def test_nothing_is_written_into_the_folder_of_the_photos(toy, out):
    photos = toy.root / "photos"
    photos.mkdir()
    (photos / "1.jpg").write_text("a picture")
    assert "elsewhere" in quiet(toy.gsac("run", photos, "--out", photos / out), ExitCode.USAGE)
    assert "elsewhere" in quiet(toy.gsac("run", ".", cwd=photos), ExitCode.USAGE)
    assert [path.name for path in photos.iterdir()] == ["1.jpg"]


def test_a_link_to_nothing_among_the_photos_is_named(toy):
    photos = toy.root / "photos"
    photos.mkdir()
    (photos / "2.jpg").symlink_to("gone.jpg")
    assert "2.jpg" in quiet(toy.gsac("run", photos), ExitCode.USAGE)


def test_batch_refuses_zero_jobs(toy):
    assert "--jobs 0" in quiet(toy.gsac("batch", toy.root, "--jobs", 0), ExitCode.USAGE)
    assert toy.runs == []


def test_a_reader_that_goes_away_is_no_bug(toy):
    toy.ran()
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(toy.command("cache", "ls"), env=toy.env, stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert "Traceback" not in done.stderr and done.returncode == ExitCode.INTERRUPTED


@pytest.mark.parametrize("value", [float("nan"), float("inf"), ".nan", "inf"])
def test_a_number_that_is_none_is_refused_by_the_name_of_its_parameter(value):
    from dataclasses import dataclass

    @dataclass
    class Config:
        pull: float = 1.0

    stage = Stage("cut", (), (Output("out", print),), Config)
    with pytest.raises(BadInput, match="cut.pull"):
        make_config(stage, {"pull": value})


def test_a_failed_write_names_the_file_and_leaves_nothing(tmp_path):
    from gsac.pipeline.run_folder import write_text

    (tmp_path / "run.json").mkdir()
    with pytest.raises(OSError, match="run.json") as caught:
        write_text(tmp_path / "run.json", "{}")
    assert caught.value.filename == str(tmp_path / "run.json")
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]


@pytest.mark.parametrize(("free", "words"), [(1000, "no room left in the cache folder"), (10**12, "no person")])
def test_a_stage_that_fails_on_a_full_disk_says_so_whatever_its_library_said(toy, monkeypatch, capsys, free, words):
    from gsac.pipeline import stage_runner

    for name, value in toy.env.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(stage_runner.shutil, "disk_usage", lambda folder: SimpleNamespace(free=free))
    with toy.importable():
        code = execute(["run", str(toy.clip), "--out", str(toy.out), "--set", "cut.trouble=stage"])
    assert code == ExitCode.FAILED and words in capsys.readouterr().err


def test_the_rate_counts_from_the_first_sign_of_progress(monkeypatch):
    now = iter([0.0, 60.0, 70.0])
    monkeypatch.setattr("gsac.pipeline.journal.time", SimpleNamespace(monotonic=lambda: next(now), time=count(0, 60).__next__))
    lines = io.StringIO()
    journal = Journal(PlainReporter(lines).take)
    journal.starts("train", "first run")
    journal.progress("train", 1, 101, "steps")
    journal.progress("train", 51, 101, "steps")
    assert "5 steps/s, 10 s left" in lines.getvalue()
    pace = Pace()
    pace.hear(1, "steps", 60.0)
    assert pace.words(101) == "1/101 steps"


def test_a_batch_ends_its_clips_even_where_the_shell_made_them_deaf_to_ctrl_c(toy):
    folder = toy.root / "clips"
    folder.mkdir()
    (folder / "one.mp4").write_text("alpha beta")
    batch = subprocess.Popen(toy.command("batch", folder, "--out", toy.out, "--set", "cut.pause_s=60"), env=toy.env,
                             stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                             preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
    toy.wait_for(lambda: toy.runs == ["cut"])
    batch.terminate()
    batch.communicate(timeout=20)
    assert batch.returncode == ExitCode.INTERRUPTED
    assert not list((toy.cache / "tmp").iterdir()), "the clip's stage has gone, and what it was writing"


def test_status_knows_the_results_that_a_run_kept_beside_a_cache_that_cannot_be_written(toy):
    toy.root.joinpath("cache").write_text("not a folder")
    toy.ran()
    assert (toy.out / ".store").is_dir()
    assert toy.gsac("status", toy.out).code == ExitCode.OK
    assert "up to date" in toy.gsac("explain", "join", toy.out).out


def test_a_missing_file_of_the_programs_own_is_not_the_users_mistake(tmp_path):
    ours = Path(errors.__file__).with_name("missing.jinja")
    for path, code in ((ours, None), (Path(pytest.__file__), None), (tmp_path / "clip.mp4", ExitCode.USAGE),
                       (Path(errors.__file__).parents[1] / "clips" / "mine.mp4", ExitCode.USAGE)):
        assert errors.exit_code(FileNotFoundError(2, "No such file or directory", str(path))) == code


def test_a_folder_that_is_removed_while_a_run_works_in_it_is_named(toy):
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=0.5")
    toy.wait_for(lambda: "cut" in toy.runs)
    shutil.rmtree(toy.out)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 2 and f"{toy.out} was removed while a command worked in it" in said and "Traceback" not in said
    assert toy.run().code == 0


def test_an_output_folder_that_cannot_be_made_is_named(tmp_path, capsys):
    clip = tmp_path / "clip.mp4"
    clip.write_bytes(b"0")
    assert execute(["run", str(clip), "--out", "/proc/avatar"]) == ExitCode.USAGE
    assert "/proc/avatar cannot be made (No such file or directory); choose another --out" in capsys.readouterr().err

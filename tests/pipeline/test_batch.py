import io
import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from rich.text import Text

from gsac.pipeline.batch import find_clips, make_jobs
from gsac.pipeline.batch_reporter import open_batch_reporter
from gsac.pipeline.events import ClipEnded, StageProgress, StageStarted
from gsac.pipeline.executors.executor import ClipJob, ClipResult, Limits
from gsac.pipeline.executors.local import LocalExecutor
from gsac.pipeline.reporter import TerminalReporter
from gsac.stages.contract import BadInput

pytestmark = pytest.mark.slow


@pytest.fixture
def clips(toy):
    folder = toy.root / "clips"
    folder.mkdir()
    for name, text in (("one", "alpha beta"), ("two", "gamma delta"), ("bad", "")):
        (folder / f"{name}.mp4").write_text(text)
    (folder / "notes.md").write_text("not a clip")
    return folder


def test_a_batch_goes_on_past_a_clip_that_fails_and_says_which_and_why(toy, clips):
    done = toy.gsac("batch", clips, "--out", toy.root / "avatars", "--executor", "local", "-j", "2", "--json")
    assert done.code == 1
    rows = {row["clip"].rsplit("/", 1)[1]: row for row in done.json["clips"]}
    assert {name: row["status"] for name, row in rows.items()} == {"one.mp4": "done", "two.mp4": "done", "bad.mp4": "failed"}
    assert "stage left failed" in rows["bad.mp4"]["error"]
    assert "2 of 3 clips done" in done.err and "failed: " + str(clips / "bad.mp4") in done.err
    assert (toy.root / "avatars" / "two-avatar" / "join" / "out.txt").read_text() == "GAMMA GAMMA"


def test_a_batch_leaves_one_page_that_shows_every_clip_and_names_it_on_stdout(toy, clips):
    done = toy.gsac("batch", clips, "--out", toy.root / "avatars", "-j", "2")
    page = toy.root / "avatars" / "batch.html"
    assert done.out.splitlines() == [str(page)]
    html = page.read_text()
    assert "2 of 3 clips done, 1 failed." in html and "Stage left failed:" in html
    for clip in ("one", "two", "bad"):
        assert f"<h3>{clip}.mp4</h3>" in html and f'href="{clip}-avatar/report.html"' in html
    assert 'href="bad-avatar/logs/left.log"' in html
    page.write_text("mine")
    refused = toy.gsac("batch", clips, "--out", toy.root / "avatars")
    assert refused.code == 2 and "batch.html was not written by" in refused.err and page.read_text() == "mine"


def test_a_batch_shares_one_store(toy, clips):
    (clips / "bad.mp4").unlink()
    (clips / "again.mp4").write_text("alpha beta")
    assert toy.gsac("batch", clips, "--out", toy.root / "avatars", "-j", "3").code == 0
    assert len(toy.runs) == 8, "again.mp4 has the content of one.mp4"


def test_a_list_names_clips_relative_to_itself_and_a_missing_one_fails_alone(toy, clips):
    todo = toy.root / "todo.txt"
    todo.write_text("# today\nclips/one.mp4\n\nclips/nothing.mp4\nclips/one.mp4\n")
    done = toy.gsac("batch", todo, "--out", toy.root / "avatars", "--set", "left.word=last")
    assert done.code == 1 and "1 of 2 clips done" in done.err and "nothing.mp4: no such file" in done.err
    assert (toy.root / "avatars" / "one-avatar" / "join" / "out.txt").read_text() == "BETA ALPHA"


def test_ctrl_c_ends_a_batch_and_keeps_what_is_finished(toy, clips):
    process = toy.start("batch", clips, "--out", toy.root / "avatars", "-j", "2", "--set", "join.pause_s=60")
    toy.wait_for(lambda: toy.runs.count("join") == 2)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130 and "Traceback" not in err
    assert list((toy.cache / "tmp").iterdir()) == []
    assert (toy.root / "avatars" / "one-avatar" / "left" / "out.txt").read_text() == "ALPHA"


def test_a_process_that_starts_while_a_batch_is_left_is_ended(monkeypatch, tmp_path):
    asked = threading.Event()

    def start_late(job, environment, hear, running):
        asked.set()
        time.sleep(0.5)
        with subprocess.Popen(["sleep", "60"]) as process, running(process):
            return ClipResult(job, process.wait(timeout=30), 0.0)

    monkeypatch.setattr("gsac.pipeline.executors.local.run_process", start_late)
    with LocalExecutor(Limits(1, 1000.0), lambda *told: None) as executor:
        executor.submit(ClipJob(tmp_path / "clip.mp4", tmp_path / "out"))
        asked.wait()
    assert [result.code for result in executor.collect()] == [-signal.SIGTERM]


def test_one_video_in_place_of_a_list_is_sent_to_run(toy):
    done = toy.gsac("batch", toy.clip)
    assert done.code == 2 and f"{toy.clip} is one video: `gsac run {toy.clip}` makes its avatar" in " ".join(done.err.split())


def test_a_wrong_parameter_is_said_once_before_any_clip_runs(toy, clips):
    done = toy.gsac("batch", clips, "--set", "left.wrd=1")
    assert done.code == 2 and "left.wrd" in done.err and toy.runs == []


def test_folders_of_photos_or_of_a_video_with_masks_are_clips_and_other_things_are_not(tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "1.JPG").write_text("x")
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.MOV").write_text("x")
    (tmp_path / "b.txt").write_text("x")
    for name in ("film", "film/masks", "film-alone"):
        (tmp_path / name).mkdir()
    (tmp_path / "film/a.mp4").write_text("x")
    (tmp_path / "film-alone/a.mp4").write_text("x")
    assert [clip.name for clip in find_clips(tmp_path)] == ["a.MOV", "film", "photos"]


def test_clips_of_equal_name_get_folders_of_their_own(tmp_path):
    jobs = make_jobs([tmp_path / "a" / "x.mp4", tmp_path / "b" / "x.mp4", tmp_path / "a" / "x.mp4"], tmp_path, ())
    assert [job.out.name for job in jobs] == ["x-avatar", "x-2-avatar"]


@pytest.mark.parametrize("order", [1, -1])
def test_the_number_of_an_equal_name_is_no_other_clips_name(tmp_path, order):
    clips = [tmp_path / name for name in ("take.mov", "take.mp4", "take-2.mp4", "take.MOV", "take-2.mov")][::order]
    jobs = make_jobs(clips, tmp_path, ())
    assert {job.out.name for job in jobs} == {"take-avatar", *(f"take-{n}-avatar" for n in (2, 3, 4)), "take-2-2-avatar"}
    own = next(job for job in jobs if job.clip.stem == "take-2")
    assert own.out.name == "take-2-avatar" and len({job.name for job in jobs}) == len(clips)


def test_a_list_is_read_without_the_mark_that_windows_writes_and_another_encoding_is_said(tmp_path):
    todo = tmp_path / "todo.txt"
    todo.write_text(" a.mp4\r\n\r\n# later\r\nb.mov\r\n", "utf-8-sig", newline="")
    assert find_clips(todo) == [tmp_path / "a.mp4", tmp_path / "b.mov"]
    todo.write_bytes("a.mp4".encode("utf-16"))
    with pytest.raises(BadInput, match=r"todo.txt: not a list of clips .*in UTF-8"):
        find_clips(todo)


def test_a_list_is_read_as_utf8_in_any_locale(tmp_path):
    (tmp_path / "todo.txt").write_text("Jörg.mp4\n", "utf-8")
    ask = "from pathlib import Path; from gsac.pipeline.batch import find_clips; print(ascii(find_clips(Path('todo.txt'))))"
    plain = os.environ | {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    done = subprocess.run([sys.executable, "-c", ask], cwd=tmp_path, env=plain, capture_output=True, text=True)
    assert "J\\xf6rg.mp4" in done.stdout, done.stderr


def test_a_folder_of_an_earlier_batch_with_another_clip_of_that_name_is_replaced_only_if_told(toy, clips):
    (clips / "bad.mp4").unlink()
    out = toy.root / "avatars"
    assert toy.gsac("batch", clips, "--out", out).code == 0
    others = toy.root / "others"
    others.mkdir()
    (others / "one.mp4").write_text("omega psi")
    done = toy.gsac("batch", others, "--out", out)
    assert done.code == 1 and f"holds the avatar of {clips / 'one.mp4'}" in done.err
    assert toy.gsac("batch", others, "--out", out, "--replace").code == 0
    assert (out / "one-avatar" / "join" / "out.txt").read_text() == "OMEGA OMEGA"


def test_a_batch_says_what_its_clips_are_at_while_they_run(toy, clips):
    process = toy.start("batch", clips, "--out", toy.root / "avatars", "-j", "1", "--set", "cut.pause_s=60")
    assert any("bad.mp4: 1/4 cut: starts" in process.stderr.readline() for _ in range(2))
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)


def test_a_batch_names_each_error_once(toy, clips):
    done = toy.gsac("batch", clips, "--out", toy.root / "avatars", "-j", "1")
    assert done.err.count("stage left failed") == 1 and "(3 of 3 clips" in done.err


def test_the_table_of_a_batch_has_a_row_for_each_clip_at_work():
    with open_batch_reporter(TerminalReporter(io.StringIO()), {"one.mp4": 8.0, "two.mp4": 4.0}) as table:
        table.take(StageStarted(clip="one.mp4", stage="split", place="1/8", reason="first run"))
        table.take(StageStarted(clip="two.mp4", stage="split", place="1/8", reason="first run"))
        table.take(StageProgress(clip="one.mp4", stage="keypoints", place="2/8", done=30, total=60, unit="frames"))
        assert list(table.draw().columns[0]._cells) == [Text("one.mp4"), Text("two.mp4"), Text("batch", style="bold")]
        assert table.draw().columns[1]._cells[0] == Text("2/8 keypoints: 30/60 frames")
        table.take(ClipEnded(clip="one.mp4", status="done"))
        assert list(table.draw().columns[0]._cells) == [Text("two.mp4"), Text("batch", style="bold")]
        assert table.draw().columns[1]._cells[1] == Text("1 of 2 clips")

"""report.html is drawn anew exactly when what it was drawn from differs, and never loses parts."""

import json
import shutil
import signal
import subprocess
import sys

import pytest

from gsac.pipeline.report.origin import read_origin

INTERRUPTED = """
import sys, threading
from pathlib import Path
from gsac.pipeline.report.refresh import EarlySections
from gsac.pipeline.run_folder import RunFolder
start = threading.Thread.start
def interrupted(self):
    start(self)
    raise KeyboardInterrupt
threading.Thread.start = interrupted
EarlySections(RunFolder(Path(sys.argv[1]))).start(["train"])
"""


def page(toy):
    return toy.out / "report.html"


def drawn_again(toy, *arguments):
    """Whether a run draws the report anew."""
    before = page(toy).stat().st_mtime_ns
    assert toy.run(*arguments).code == 0
    return page(toy).stat().st_mtime_ns != before


def test_a_run_with_nothing_to_do_draws_nothing(toy):
    toy.ran()
    assert not drawn_again(toy)


def test_a_stage_that_ran_again_shows_its_new_time_in_the_report_although_its_result_is_the_same(toy):
    toy.ran()
    run = json.loads((toy.out / "run.json").read_text())
    run["stages"][-1]["seconds"] = 61
    (toy.out / "run.json").write_text(json.dumps(run))
    assert toy.gsac("report", toy.out).code == 0 and "1 min 01 s" in page(toy).read_text()
    assert drawn_again(toy, "--force", "join") and "1 min 01 s" not in page(toy).read_text()


def test_going_back_to_a_parameter_that_was_computed_before_draws_the_report_of_that_parameter(toy):
    toy.ran()
    toy.ran("--set", "left.keep=7")
    assert "7" in page(toy).read_text().split("left.keep")[1][:40]
    toy.runs_file.write_text("")
    assert drawn_again(toy) and toy.runs == []
    assert "100" in page(toy).read_text().split("left.keep")[1][:40]


def test_a_clip_of_another_name_is_named_in_the_report(toy):
    toy.ran()
    other = toy.clip.rename(toy.root / "other.mp4")
    assert toy.gsac("run", other, "--out", toy.out).code == 0
    assert "<h1>other.mp4</h1>" in page(toy).read_text()


def test_a_run_that_stops_early_leaves_a_whole_report_alone(toy, everything):
    toy.ran()
    assert not drawn_again(toy, "--until", "cut")
    assert list(read_origin(page(toy)).stages) == everything


def test_the_report_says_of_what_the_last_run_left_behind_that_it_is_of_earlier_inputs(toy):
    toy.ran()
    assert drawn_again(toy, "--until", "right", "--set", "right.word=last")
    assert "Not of the last run&#39;s inputs: join." in page(toy).read_text()
    assert toy.run("--set", "right.word=last").code == 0
    assert "Not of the last run" not in page(toy).read_text()


@pytest.mark.slow
def test_an_interrupted_run_tells_that_the_report_is_of_an_earlier_one(toy):
    toy.ran()
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "left.word=last", "--set", "right.pause_s=60")
    toy.wait_for(lambda: toy.runs.count("right") == 2)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=30)[1]
    assert process.returncode == 130 and f"report.html is of an earlier run; `gsac report {toy.out}` draws it anew" in said
    assert toy.gsac("report", toy.out).code == 0 and "Not of the last run&#39;s inputs: join." in page(toy).read_text()


def test_a_report_of_an_older_version_is_drawn_anew(toy):
    toy.ran()
    page(toy).write_text(page(toy).read_text().replace("gsac-drawn-from", "other"))
    assert drawn_again(toy)


def test_a_whole_report_is_never_replaced_by_a_part_of_it(toy):
    toy.ran()
    whole = page(toy).read_text()
    shutil.rmtree(toy.out / "join")
    done = toy.run("--until", "cut", "--set", "cut.keep=2")
    assert done.code == 0 and "it shows results of join, which are no longer in the folder" in done.err
    assert page(toy).read_text() == whole


@pytest.mark.slow
def test_report_of_dead_links_is_refused_with_the_way_back_and_the_good_page_stays(toy):
    toy.ran()
    whole = page(toy).read_text()
    for name in ("objects", "actions"):
        for path in (toy.cache / name).rglob("*"):
            path.chmod(0o755)
        shutil.rmtree(toy.cache / name)
    done = toy.gsac("report", toy.out)
    assert done.code == 2 and "which is gone" in done.err and f"`gsac run {toy.clip} --out" in done.err
    assert page(toy).read_text() == whole
    assert toy.run().code == 0 and toy.gsac("report", toy.out).code == 0


def test_an_interrupt_at_the_moment_when_early_sections_begin_ends_the_process(tmp_path):
    done = subprocess.run([sys.executable, "-c", INTERRUPTED, tmp_path], capture_output=True, text=True, timeout=60)
    assert done.returncode != 0 and "KeyboardInterrupt" in done.stderr

"""The folder in which a stage leaves for the next run what a stopped one has done."""

import pytest

COUNTS = """
import json, os, signal
from gsac.stages.contract import StageError
from gsac.toy.common import begin


def run(job):
    begin(job, "join")
    seen = job.scratch / "seen"
    times = int(seen.read_text()) if seen.exists() else 0
    if times:
        job.resumed(times, 5, "times")
    job.scratch.mkdir(parents=True, exist_ok=True)
    seen.write_text(str(times + 1))
    if os.environ.get("TOY_END") == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if os.environ.get("TOY_END") == "failed":
        raise StageError("frame 3 has no person")
    (job.out / "metrics.json").write_text("{}")
    (job.out / "out.txt").write_text(f"{times} times before")
"""

pytestmark = pytest.mark.slow


@pytest.fixture
def counting(toy):
    toy.write("join/stage.py", COUNTS)
    return toy


def left(toy):
    return list((toy.cache / "partial").iterdir())


def test_what_a_killed_run_left_is_there_for_the_next_and_gone_once_it_is_done(counting):
    assert [counting.run(TOY_END="killed").code for _ in range(2)] == [1, 1]
    assert [path.name for path in left(counting)] == [counting.run("--dry-run").json["stages"][-1]["key"]]
    assert counting.ran() == ["join"] and counting.result == "2 times before" and left(counting) == []


def test_ctrl_c_leaves_it_too(counting):
    pause = '__import__("time").sleep(float(os.environ.get("TOY_SLEEP", 0)))'
    counting.edit("join/stage.py", "    (job.out", f"    {pause}\n    (job.out")
    process = counting.start("run", counting.clip, "--out", counting.out, TOY_SLEEP="60")
    counting.wait_for(lambda: list((counting.cache / "partial").glob("*/seen")))
    process.terminate()
    process.communicate()
    assert counting.ran() == ["join"] and counting.result == "1 times before"


def test_another_key_does_not_see_it(counting):
    counting.run(TOY_END="killed")
    assert counting.ran("--set", "join.keep=3") == ["join"] and counting.result == "0 times before"


def test_a_stage_that_failed_by_itself_and_a_forced_run_start_anew(counting):
    counting.run(TOY_END="failed")
    assert left(counting) == []
    counting.run(TOY_END="killed")
    assert counting.ran("--force", "join") == ["join"] and counting.result == "0 times before"


def test_the_stage_command_hands_it_as_well(counting):
    counting.run(TOY_END="killed")
    done = counting.gsac("stage", "join", cwd=counting.out)
    assert done.code == 0, done.err
    assert counting.result == "1 times before" and left(counting) == []


def test_a_run_that_goes_on_says_so_and_from_where(counting):
    counting.run(TOY_END="killed")
    assert counting.run("--dry-run").json["stages"][-1]["reason"] == "stopped before"
    done = counting.run()
    assert "join: starts (stopped before)" in done.err and "join: goes on from time 1 of 5" in done.err
    done = counting.run("--force", "join")
    assert "goes on" not in done.err

"""What runs and batches tell, as their folders keep it and as `gsac events` prints it."""

import json
import re
import signal

import pytest

from gsac.pipeline.event_file import read_events
from gsac.pipeline.events import (
    ClipEnded,
    StageFailed,
    StageFinished,
    StageHit,
    StageLine,
    StagePlanned,
    StageProgress,
    StageWarning,
    read_event,
)

pytestmark = pytest.mark.slow
STAGES = ["cut", "left", "right", "join"]


@pytest.fixture
def clips(toy):
    folder = toy.root / "clips"
    folder.mkdir()
    for name, text in (("one", "alpha beta"), ("two", "gamma delta")):
        (folder / f"{name}.mp4").write_text(text)
    return folder


def of_kind(folder, kind):
    return [event for event in read_events(folder) if isinstance(event, kind)]


def test_a_run_keeps_what_it_told_and_the_next_one_appends(toy):
    assert toy.gsac("run", toy.clip, "--out", toy.out, "--set", "left.trouble=warning").code == 0
    planned, made = of_kind(toy.out, StagePlanned), of_kind(toy.out, StageFinished)
    assert [event.stage for event in planned] == [event.stage for event in made] == STAGES
    rows = {row["name"]: row for row in json.loads((toy.out / "run.json").read_text())["stages"]}
    assert {event.stage: event.key for event in made} == {name: row["key"] for name, row in rows.items()}
    assert all(event.bytes > 0 and event.cpu_seconds > 0 and event.place for event in made)
    assert "left at work" in [event.line for event in of_kind(toy.out, StageLine)] and of_kind(toy.out, StageProgress)
    assert [(event.stage, event.code) for event in of_kind(toy.out, StageWarning)] == [("left", "other")]
    toy.gsac("run", toy.clip, "--out", toy.out, "--set", "left.trouble=warning")
    assert [event.key for event in of_kind(toy.out, StageHit)] == [event.key for event in made]
    ends = of_kind(toy.out, ClipEnded)
    assert [(end.status, end.ran, end.stages, end.clip) for end in ends] == [
        ("done", 4, 4, toy.clip.name), ("unchanged", 0, 4, toy.clip.name)]
    assert len({event.run for event in read_events(toy.out)}) == 2


def test_a_run_that_is_killed_leaves_events_and_goes_on_in_the_same_file(toy):
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "join.pause_s=60")
    toy.wait_for(lambda: toy.runs.count("join") == 1)
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    assert [event.stage for event in of_kind(toy.out, StageFinished)] == STAGES[:3] and not of_kind(toy.out, ClipEnded)
    assert toy.gsac("run", toy.clip, "--out", toy.out).code == 0
    assert [event.stage for event in of_kind(toy.out, StageFinished)] == STAGES and len(of_kind(toy.out, StageHit)) == 3


def test_events_on_stdout_come_before_the_result_and_are_those_of_the_file(toy):
    done = toy.gsac("run", toy.clip, "--out", toy.out, "--events", "--json")
    *told, last = done.out.splitlines()
    kept = list(read_events(toy.out))
    lines = {line + "\n" for line in told}
    assert json.loads(last)["stages"] and all(map(read_event, told))
    assert all(event.to_line() in lines for event in kept) and len(kept) >= 10


def test_a_failure_says_which_stage_and_why(toy):
    done = toy.gsac("run", toy.clip, "--out", toy.out, "--set", "left.trouble=stage")
    (failed,), (end,) = of_kind(toy.out, StageFailed), of_kind(toy.out, ClipEnded)
    assert done.code == end.code == 1 and failed.stage == "left" and "record again" in failed.error and failed.error in end.error


def test_events_are_printed_as_a_person_reads_them(toy, inside):
    toy.gsac("run", toy.clip, "--out", toy.out)
    said = inside(toy, "events", toy.out)
    assert said.code == 0 and re.search(rf"^\d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d {toy.clip.name}: 1/4 cut: starts \(first run\)$",
                                        said.out, re.MULTILINE)
    assert "words" not in said.out and "1/2 words" in inside(toy, "-v", "events", toy.out).out
    followed = inside(toy, "events", toy.out, "--follow").out.splitlines()
    assert "done, 4 of 4 stages ran" in followed[-1]
    nothing = inside(toy, "events", toy.root)
    assert nothing.code == 2 and "give the folder of a run or of a batch" in nothing.err


def test_a_users_file_by_the_name_of_the_events_is_never_appended_to(toy, inside, clips):
    (clips / "events.jsonl").write_text("mine\n")
    refused = inside(toy, "batch", clips, "--out", clips)
    assert refused.code == 2 and "events.jsonl was not written by gsac" in refused.err and toy.runs == []
    toy.gsac("run", toy.clip, "--out", toy.out)
    (toy.out / "events.jsonl").write_text("mine\n")
    again = toy.gsac("run", toy.clip, "--out", toy.out)
    assert again.code == 0 and (toy.out / "events-kept.jsonl").read_text() == "mine\n" and of_kind(toy.out, ClipEnded)
    assert (clips / "events.jsonl").read_text() == "mine\n"


def test_a_stage_of_a_run_told_by_itself_is_in_the_file_of_its_run(toy):
    toy.gsac("run", toy.clip, "--out", toy.out, "--until", "right")
    toy.gsac("stage", "left", toy.out)
    assert [event.stage for event in of_kind(toy.out, StageFinished)] == ["cut", "right", "left"]
    assert [(end.status, end.stages) for end in of_kind(toy.out, ClipEnded)] == [("done", 2), ("done", 1)]


@pytest.mark.parametrize("executor", ["local", "ray"])
def test_counts_of_a_batch_are_those_of_its_events_wherever_its_clips_run(toy, clips, executor):
    if executor == "ray":
        pytest.importorskip("ray", reason="needs ray: pip install 'gsac[ray]'")
    out = toy.root / "avatars"
    (clips / "bad.mp4").write_text("")
    assert toy.gsac("batch", clips, "--out", out, "--executor", executor).code == 1
    ends = {event.clip: event for event in of_kind(out, ClipEnded)}
    record = {row["clip"].rsplit("/", 1)[1]: row for row in json.loads((out / "batch.json").read_text())["clips"]}
    assert {name: (row["status"], row["error"]) for name, row in record.items()} == {
        name: (event.status, event.error) for name, event in ends.items()}
    assert sorted(event.status for event in ends.values()) == ["done", "done", "failed"]
    made = of_kind(out, StageFinished)
    counters = (out / "batch.prom").read_text()
    for stage in STAGES:
        mine = [event for event in made if event.stage == stage]
        assert f'gsac_batch_stage_ends{{stage="{stage}",outcome="ran"}} {len(mine)}\n' in counters
        assert f'gsac_batch_stage_bytes{{stage="{stage}"}} {sum(event.bytes for event in mine):.3f}\n' in counters
    assert 'gsac_batch_stage_ends{stage="left",outcome="failed"} 1\n' in counters
    assert {event.batch for event in read_events(out)} == {made[0].batch} and len({event.run for event in made}) == 3
    own = of_kind(out / "one-avatar", StageFinished)
    assert [event.key for event in own] == [event.key for event in made if event.clip == "one.mp4"]


def test_a_resumed_batch_appends_and_tells_what_it_leaves(toy, clips):
    out = toy.root / "avatars"
    toy.gsac("batch", clips, "--out", out)
    again = toy.gsac("batch", "--resume", "--out", out)
    assert again.code == 0
    kinds = [event.kind for event in read_events(out)]
    assert kinds.count("batch_started") == kinds.count("batch_ended") == 2 and kinds.count("clip_kept") == 2
    assert kinds.count("clip_ended") == 2


def test_a_clip_that_is_tried_once_more_says_which_run_tells(toy, clips):
    out = toy.root / "avatars"
    toy.gsac("batch", clips, "--out", out, "--set", "left.trouble=killed")
    failed = [event for event in of_kind(out, StageFailed) if event.clip == "one.mp4"]
    assert [(event.attempt, event.killed) for event in failed] == [(1, "SIGKILL"), (2, "SIGKILL")]
    assert [event.killed for event in of_kind(out, ClipEnded)] == [2, 2]

"""Events as lines, and the file that keeps them."""

import json
import os
import threading

import pytest

from gsac.pipeline import event_file
from gsac.pipeline.event_file import EventFile, follow_events, others_files, read_events
from gsac.pipeline.events import (
    KINDS,
    LONGEST,
    BatchEnded,
    BatchStarted,
    ClipEnded,
    ClipPlanned,
    Note,
    StageFinished,
    StageLine,
    StageProgress,
    StageStarted,
    StageWarning,
    read_event,
)
from gsac.pipeline.journal import Journal
from gsac.pipeline.reporter import TOLD, WORDS, words_of

TOLD_ONCE = [
    StageStarted(time=1.5, run="ab", clip="a b.mp4", stage="train", place="7/8", key="k", reason="first run", device="cpu"),
    StageProgress(stage="train", done=3, total=7, unit="steps", rate=2.0, run_left=None),
    StageWarning(stage="smplx", message="a line\nand\u2028another", code="blur", severity="poorer"),
    ClipPlanned(batch="cd", clip="x", due=["split", "train"], seconds=4.0), Note(message="Grüße", result=True),
    ClipEnded(status="failed", code=1, error="why", killed=2, metrics={"psnr_fg": 23.4, "detector": "x", "lpips": None}),
]


@pytest.mark.parametrize("event", TOLD_ONCE, ids=lambda event: event.kind)
def test_an_event_is_one_line_and_comes_back_as_it_was(event):
    line = event.to_line()
    assert line.count("\n") == 1 and len(line.splitlines()) == 1 and read_event(line) == event


@pytest.mark.parametrize("line", ['{"event":"stage_st', "", "[]", "null", '{"event":"of tomorrow"}', '{"event":["note"]}',
                                  '{"event":"stage_event"}', '{"event":"stage_progress","done":"many"}', "[" * 100_000])
def test_a_line_that_is_no_event_of_this_version_is_passed_over(line):
    assert read_event(line) is None


def test_fields_of_a_later_version_are_passed_over():
    assert read_event('{"event":"note","time":3,"message":"so","colour":"red"}') == Note(time=3.0, message="so")


def test_a_text_without_end_is_cut():
    line = StageLine(stage="train", line="x" * 10 * LONGEST).to_line()
    assert len(line) < LONGEST + 100


def test_every_kind_has_words_for_people():
    assert WORDS.keys() == KINDS.keys() and KINDS.keys() >= TOLD
    assert all(isinstance(words_of(kind()), str) for kind in KINDS.values())
    assert words_of(BatchStarted(clips=1, due=1)) == "batch of 1 clip starts, 1 to do"


def test_a_line_that_a_kill_cut_off_is_ignored_and_the_next_run_appends_whole_lines(tmp_path):
    with EventFile(tmp_path) as file:
        file.take(Note(message="one"))
    with (tmp_path / "events.jsonl").open("a") as stream:
        stream.write('{"event":"note","mess')
    assert [event.message for event in read_events(tmp_path)] == ["one"]
    with EventFile(tmp_path) as file:
        file.take(Note(message="two"))
    assert [event.message for event in read_events(tmp_path)] == ["one", "two"]


def test_the_file_stays_below_its_bound_and_the_newest_events_are_kept(tmp_path):
    with EventFile(tmp_path, limit=4000) as file:
        for number in range(1000):
            file.take(Note(message=str(number)))
    sizes = [path.stat().st_size for path in tmp_path.iterdir()]
    kept = [int(event.message) for event in read_events(tmp_path)]
    assert len(sizes) == 2 and max(sizes) <= 4000 and kept == list(range(kept[0], 1000)) and len(kept) > 100


def test_threads_that_tell_at_once_write_whole_lines(tmp_path):
    with EventFile(tmp_path) as file:
        journal = Journal(file.take)
        tellers = [threading.Thread(target=lambda: [journal.note("x" * 500) for _ in range(200)]) for _ in range(4)]
        for teller in tellers:
            teller.start()
        for teller in tellers:
            teller.join()
    lines = (tmp_path / "events.jsonl").read_text().splitlines()
    assert len(lines) == 800 and all(json.loads(line)["message"] == "x" * 500 for line in lines)


def test_progress_is_kept_every_few_seconds_and_each_phase_once(tmp_path):
    with EventFile(tmp_path) as file:
        for step in range(200):
            file.take(StageProgress(time=step / 10, stage="train", done=step, unit="steps"))
        file.take(StageProgress(time=20.0, stage="train", done=0, unit="parts"))
    assert [(event.done, event.unit) for event in read_events(tmp_path)] == [
        (0, "steps"), (50, "steps"), (100, "steps"), (150, "steps"), (0, "parts")]


def test_a_disk_that_takes_no_more_ends_the_file_and_not_the_run(tmp_path, monkeypatch):
    def full(descriptor, line):
        raise OSError(28, "No space left on device")

    with EventFile(tmp_path) as file:
        file.take(Note(message="kept"))
        with monkeypatch.context() as patch:
            patch.setattr(event_file.os, "write", full)
            file.take(Note(message="lost"))
        file.take(Note(message="too late: what came between would be missing unseen"))
    assert [event.message for event in read_events(tmp_path)] == ["kept"]
    with EventFile(tmp_path / "not there") as file:
        file.take(Note(message="lost"))


def test_a_users_file_by_its_name_and_a_link_are_known(tmp_path):
    (tmp_path / "events.jsonl").write_text('{"mine": 1}\n')
    assert others_files(tmp_path) == [tmp_path / "events.jsonl"]
    os.replace(tmp_path / "events.jsonl", tmp_path / "mine")
    (tmp_path / "events.jsonl").symlink_to(tmp_path / "mine")
    assert others_files(tmp_path) == [tmp_path / "events.jsonl"]
    with EventFile(tmp_path) as file:
        file.take(Note(message="not into it"))
    assert (tmp_path / "mine").read_text() == '{"mine": 1}\n' and not list(read_events(tmp_path))


def test_a_file_is_followed_over_its_turn_up_to_the_end(tmp_path):
    with EventFile(tmp_path, limit=300) as file:
        file.take(Note(message="0"))
        told = iter(range(1, 40))

        def sleep(seconds):
            for _ in range(3):
                file.take(Note(message=str(next(told))))
            if next(told) > 20:
                file.take(BatchEnded())

        heard = list(follow_events(tmp_path, lambda event: isinstance(event, BatchEnded), sleep))
    numbers = [int(event.message) for event in heard if isinstance(event, Note)]
    assert isinstance(heard[-1], BatchEnded) and numbers == sorted(numbers) and {0, 1, 2, 3} < set(numbers)


def test_a_journal_gives_each_event_the_ids_of_its_run_and_a_batch_ends_its_clips_itself():
    heard, batch = [], Journal(of_batch=True)
    with batch.heard_by(heard.append):
        run = Journal(lambda event: batch.relay(event, "x.mp4 (x-2-avatar)", attempt=2), clip="x.mp4")
        run.tell(StageFinished(stage="train"))
        run.tell(ClipEnded(status="done"))
    assert [(event.kind, event.batch, event.run, event.clip, event.attempt) for event in heard] == [
        ("stage_finished", batch.batch, run.run, "x.mp4 (x-2-avatar)", 2)]
    assert len(batch.batch) == len(run.run) == 16 and batch.run == run.batch == "" and heard[0].time > 1e9

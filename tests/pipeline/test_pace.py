"""How fast a stage goes and how long a run still takes."""

import io
import json
from itertools import count
from types import SimpleNamespace

import pytest

from gsac.pipeline.journal import Journal
from gsac.pipeline.pace import Course, Pace
from gsac.pipeline.reporter import BAR, COUNTED, NARROW_BAR, PlainReporter, TerminalReporter
from gsac.pipeline.worker import EventStream

ABOVE = {"split": set(), "smplx": {"split"}, "face": {"split"}, "train": {"split", "smplx"}}


def course(seconds):
    return Course(list(ABOVE), ABOVE.__getitem__, seconds.get)


def test_a_slow_start_does_not_spoil_the_time_left():
    pace = Pace()
    for now, done in ((0, 1), (40, 10), *((40 + t, 10 + 20 * t) for t in range(1, 30))):
        pace.hear(done, "steps", float(now))
    assert pace.words(1190) == "590/1190 steps, 20 steps/s, 30 s left"


def test_no_rate_is_told_before_some_seconds_of_it_were_seen():
    pace = Pace()
    pace.hear(1, "steps", 0.0)
    pace.hear(30, "steps", 1.0)
    assert pace.words(1400) == "30/1400 steps"


def test_another_unit_is_another_phase():
    pace = Pace()
    for done, unit, now in ((0, "steps", 0.0), (100, "steps", 10.0), (0, "parts of judging", 11.0)):
        pace.hear(done, unit, now)
    assert pace.words(4) == "0/4 parts of judging" and pace.seconds_left(4) == 0


def test_the_time_left_of_the_whole_run_is_that_of_earlier_runs():
    whole = course({"split": 2.0, "smplx": 5.0, "face": 3.0, "train": 40.0})
    whole.begin("smplx")
    assert whole.place("smplx") == "2/4"
    assert whole.seconds_left("smplx", 1.0, 0.0) == pytest.approx(4 + 40), "face does not need smplx: it may be in the cache"
    whole.begin("train")
    assert whole.seconds_left("train", 50.0, 7.0) == pytest.approx(7), "longer than last time"


def test_a_clip_that_goes_slower_than_the_last_one_is_expected_to_go_on_so():
    whole = course({"split": 2.0, "smplx": 50.0, "face": 3.0, "train": 40.0})
    whole.begin("split")
    whole.end("smplx", 150.0)
    whole.begin("face")
    assert whole.seconds_left("face", 1.0, 0.0) == pytest.approx((150 + 43) / (50 + 43) * 43 - 1)


def test_a_short_stage_that_took_ten_times_as_long_tells_little_of_the_long_ones():
    whole = course({"split": 2.0, "smplx": 50.0, "face": 3.0, "train": 40.0})
    whole.begin("split")
    whole.end("split", 20.0)
    whole.begin("smplx")
    assert 93 < whole.seconds_left("smplx", 0.0, 0.0) < 93 + 20


def test_nothing_is_promised_of_a_run_with_a_stage_that_never_ran():
    whole = course({"split": 2.0})
    whole.begin("split")
    assert whole.seconds_left("split", 1.0, 0.0) is None


def test_each_line_says_which_stage_of_how_many(toy):
    lines = toy.gsac("run", toy.clip, "--out", toy.out).err.splitlines()
    assert "1/4 cut: starts (first run)" in lines and any(line.startswith("4/4 join: ran in ") for line in lines)


def test_a_piped_run_tells_what_is_left_of_the_whole(monkeypatch):
    now = iter([0.0, 20.0, 40.0])
    monkeypatch.setattr("gsac.pipeline.journal.time", SimpleNamespace(monotonic=lambda: next(now), time=count(0, 20).__next__))
    lines = io.StringIO()
    journal = Journal(PlainReporter(lines).take)
    journal.follows(course({"split": 2.0, "smplx": 60.0, "face": 3.0, "train": 80.0}))
    journal.starts("smplx", "first run")
    for done in (100, 200):
        journal.progress("smplx", done, 300, "steps")
    assert lines.getvalue().splitlines()[-1] == "2/4 smplx: 200/300 steps, 5 steps/s, 20 s left; whole run: about 1 min 40 s left"


def test_work_that_is_no_stage_of_the_run_is_told_by_its_own_name():
    lines = io.StringIO()
    journal = Journal(PlainReporter(lines).take)
    journal.follows(course({"split": 2.0, "smplx": 60.0, "face": 3.0, "train": 80.0}))
    journal.progress("seed3_novel_12", 1, 12, "frames")
    assert lines.getvalue() == "seed3_novel_12: 1/12 frames\n"


def test_the_first_word_of_a_new_phase_is_sent_at_once():
    sent = io.StringIO()
    events = EventStream(sent)
    for done, total, unit in ((1, 1400, "steps"), (2, 1400, "steps"), (0, 4, "parts of judging"), (1, 4, "parts of judging")):
        events.progress(done, total, unit)
    assert [json.loads(line)["unit"] for line in sent.getvalue().splitlines()] == ["steps", "parts of judging"]


@pytest.mark.parametrize(("columns", "bar"), [(100, BAR), (40, NARROW_BAR)])
def test_the_bar_keeps_its_width_and_never_stands_full_while_work_goes_on(monkeypatch, columns, bar):
    monkeypatch.setenv("COLUMNS", str(columns))
    reporter = TerminalReporter(io.StringIO())
    journal = Journal(reporter.take)
    journal.starts("train", "first run")
    shown = reporter._bar
    words = [shown.tasks[0].fields["words"]]
    for done, unit in ((3, "steps"), (1400, "steps"), (0, "parts of judging")):
        journal.progress("train", done, 4 if "parts" in unit else 1400, unit)
        task = shown.tasks[0]
        words.append(task.fields["words"])
        assert not task.finished and shown.columns[2].bar_width == bar
    assert words == ["reading and loading (first run)", "3/1400 steps", f"1400 steps {COUNTED}", "0/4 parts of judging"]
    reporter.__exit__()

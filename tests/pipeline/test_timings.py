"""Times are told wherever figures are, and are in no output: equal keys give equal bytes."""

import json

import pytest

from gsac.pipeline.report.results import Results
from gsac.pipeline.timings import add_timings


@pytest.fixture
def timed(toy):
    """The toy project whose last stage tells how long it took, and has a curve."""
    toy.edit("join/stage.py", '"length": len(left + right)', '"length": len(left + right), "curve": [{"step": 1}, {"step": 2}]')
    toy.edit("join/stage.py", "    end(job)\n", "    end(job)\n    job.timing('seconds', time.time())\n"
             "    job.timing('curve', [{'seconds': 0.5}, {'seconds': 1.0}])\n")
    toy.edit("join/stage.py", "import json", "import json\nimport time")
    return toy


def test_the_figures_of_a_run_have_its_times_and_the_stages_output_has_not(timed):
    done = timed.run()
    told = done.json["metrics"]
    assert told["length"] == 10 and told["seconds"] > 1e9
    assert told["curve"] == [{"step": 1, "seconds": 0.5}, {"step": 2, "seconds": 1.0}]
    run = json.loads((timed.out / "run.json").read_text())
    assert json.loads((timed.out / "metrics.json").read_text()) == told == run["metrics"]
    assert json.loads((timed.out / "join" / "metrics.json").read_text()) == {"length": 10, "curve": [{"step": 1}, {"step": 2}]}


def test_a_cached_result_and_a_command_that_leaves_it_alone_tell_the_times_of_the_run_that_made_it(timed):
    seconds = timed.run().json["metrics"]["seconds"]
    assert timed.run().json["metrics"]["seconds"] == seconds
    assert timed.run("--until", "cut").code == 0
    assert json.loads((timed.out / "metrics.json").read_text())["seconds"] == seconds
    assert timed.run("--set", "join.trouble=stage").code == 1
    assert json.loads((timed.out / "metrics.json").read_text())["seconds"] == seconds, "of the earlier result, which lies there"


def test_two_forced_runs_give_the_same_outputs_and_their_own_times(timed):
    one, two = timed.run("--force", "join").json, timed.run("--force", "join").json
    assert one["stages"][-1]["outputs"] == two["stages"][-1]["outputs"]
    assert one["metrics"]["seconds"] < two["metrics"]["seconds"]


def test_a_report_reads_trains_metrics_with_the_times_of_its_row(tmp_path):
    (tmp_path / "train").mkdir()
    (tmp_path / "train/metrics.json").write_text(json.dumps({"curve": [{"step": 1, "loss": 2.0}]}))
    rows = [{"name": "train", "status": "ran", "timings": {"seconds": 3.0, "curve": [{"seconds": 3.0}]}}]
    (tmp_path / "run.json").write_text(json.dumps({"stages": rows}))
    assert Results(tmp_path).metrics == {"seconds": 3.0, "curve": [{"step": 1, "loss": 2.0, "seconds": 3.0}]}


@pytest.mark.parametrize("timings", [{"curve": [{"seconds": 1.0}] * 2}, {"curve": 3}, {"curve": [7]}, {}])
def test_times_that_do_not_fit_the_figures_leave_them_as_they_are(timings):
    assert add_timings({"curve": [{"step": 1}]}, timings) == {"curve": [{"step": 1}]}

"""Every real stage replays from fixtures that the stage before it made: the same bytes, and no work a third time."""

import shlex
from pathlib import Path

import pytest

from gsac.cache.digest import tree_digest
from gsac.pipeline.project import Project
from support.dvc import Dvc

pytestmark = pytest.mark.slow
PROJECT = Project.at_hand()


@pytest.mark.parametrize("name", PROJECT.graph.steps)
def test_a_stage_replays_to_the_same_bytes_in_a_fresh_store_and_is_cached_from_then_on(small_run, name):
    promised = small_run.manifest["stages"][name]
    command = shlex.split(promised["command"])[1:]
    again = small_run.gsac(*command, "--force", store="fresh", cwd=small_run.fixtures)
    assert again.code == 0 and again.statuses == {name: "ran"}, again.err
    assert again.json["stages"][0]["outputs"] == promised["outputs"]
    for output in PROJECT.outputs(name):
        made = tree_digest(Path(again.json["outputs"][f"{name}/{output}"]))[1]
        before = tree_digest(small_run.out / name / output)[1]
        assert made == before, f"{name}/{output}"
    assert small_run.gsac(*command, store="fresh", cwd=small_run.fixtures).statuses == {name: "cached"}


def test_dvc_takes_the_run_for_up_to_date_and_sees_a_changed_parameter_as_gsac_does(small_run):
    dvc = Dvc(small_run.out, small_run.env())
    assert dvc.is_clean and small_run.gsac("status", small_run.out).code == 0
    assert dvc("repro").count("didn't change") == len(PROJECT.graph.steps)
    params = small_run.out / "params.yaml"
    before = params.read_text()
    params.write_text(before.replace("\n  gaussians: 200\n", "\n  gaussians: 210\n"))
    assert params.read_text() != before
    status = small_run.gsac("status", small_run.out, "--json")
    assert status.code == 3 and not dvc.is_clean
    params.write_text(before)
    assert dvc.is_clean and small_run.gsac("status", small_run.out).code == 0

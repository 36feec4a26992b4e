"""Every real stage replays from what the stage before it made: the same bytes once more, and no work a third time."""

import pytest

from gsac.cache.digest import tree_digest
from gsac.pipeline.project import Project
from support.dvc import Dvc

pytestmark = pytest.mark.slow
PROJECT = Project.at_hand()


@pytest.mark.parametrize("name", PROJECT.graph.steps)
def test_a_stage_replays_to_the_same_bytes_in_a_fresh_store_and_is_cached_from_then_on(small_run, tmp_path, name):
    command = ("stage", name, "--inputs", small_run.out, "--out", tmp_path / name, "--params", small_run.out / "params.yaml", "--json")
    again = small_run.gsac(*command, "--force", store="fresh")
    assert again.code == 0 and again.statuses == {name: "ran"}, again.err
    for output in PROJECT.outputs(name):
        made, before = (tree_digest(folder / name / output)[1] for folder in (tmp_path, small_run.out))
        assert made == before, f"{name}/{output}"
    assert small_run.gsac(*command, store="fresh").statuses == {name: "cached"}


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

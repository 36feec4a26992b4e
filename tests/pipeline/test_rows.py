"""run.json and metrics.json speak of what lies in the folder, whatever the last command was."""

import json
import signal

import pytest


def run_json(toy):
    return json.loads((toy.out / "run.json").read_text())


def rows(toy):
    return {row["name"]: row for row in run_json(toy)["stages"]}


def metrics(toy):
    return json.loads((toy.out / "metrics.json").read_text())


def stale(toy):
    return {name: row["stale_reason"] for name, row in rows(toy).items() if row.get("stale")}


def test_a_run_that_stops_early_loses_no_row_no_metric_and_falsifies_none(toy, everything):
    toy.ran()
    done = toy.run("--until", "cut")
    assert done.json["stages"][0]["name"] == "cut" and len(done.json["stages"]) == 1, "--json is of the command"
    assert list(rows(toy)) == everything and metrics(toy) == {"length": 10} and not stale(toy)
    assert run_json(toy)["metrics"] == {"length": 10} and "join/out.txt" in run_json(toy)["outputs"]


def test_a_result_made_from_what_is_no_longer_there_says_so_and_from_what(toy):
    toy.ran()
    toy.ran("--until", "right", "--set", "right.word=last")
    assert stale(toy) == {"join": "made from an earlier right/out.txt; run again"}
    assert metrics(toy) == {"length": 10}, "it is still what lies in join"
    toy.ran("--set", "right.word=last")
    assert not stale(toy)


def test_what_lies_below_a_stale_result_is_stale_for_the_same_reason(toy):
    toy.ran()
    toy.clip.write_text("delta beta gamma")
    toy.ran("--until", "cut")
    assert stale(toy) == dict.fromkeys(("left", "right", "join"), "made from an earlier cut/words; run again")


@pytest.mark.slow
def test_ctrl_c_in_a_forced_run_loses_nothing(toy, everything):
    toy.ran("--set", "right.pause_s=0.3")
    toy.runs_file.write_text("")
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "right.pause_s=0.3", "--force", "left", "--force", "right")
    toy.wait_for(lambda: "right" in toy.runs)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=30)
    assert process.returncode == 130, said
    assert list(rows(toy)) == everything and metrics(toy) == {"length": 10} and not stale(toy)


def test_a_failed_stage_keeps_the_row_of_the_result_that_still_lies_there(toy):
    toy.ran()
    assert toy.run("--set", "left.trouble=stage").code == 1
    left = rows(toy)["left"]
    assert left["status"] == "failed" and left["error"] and left["earlier"]["params"]["trouble"] == ""
    assert metrics(toy) == {"length": 10} and not stale(toy)
    toy.ran("--until", "cut")
    assert rows(toy)["left"]["status"] == "cached", "the result is there, whatever failed since"


def test_a_result_that_is_gone_has_no_row(toy):
    toy.ran()
    (toy.out / "join" / "out.txt").unlink()
    toy.ran("--until", "right")
    assert list(rows(toy)) == ["cut", "left", "right"] and metrics(toy) == {}


def test_a_result_that_was_written_over_by_hand_says_so(toy):
    toy.ran()
    path = toy.out / "join" / "out.txt"
    path.unlink()
    path.write_text("by hand")
    toy.ran("--until", "cut")
    assert stale(toy) == {"join": "join/out.txt was changed since the stage wrote it; run again"}


def test_the_stage_command_writes_its_row_as_well(toy, everything):
    toy.ran()
    assert toy.gsac("stage", "right", "--set", "right.word=last", cwd=toy.out).code == 0
    assert list(rows(toy)) == everything and rows(toy)["right"]["params"]["word"] == "last"
    assert stale(toy) == {"join": "made from an earlier right/out.txt; run again"}
    assert run_json(toy)["clip"] == str(toy.clip)
    assert toy.gsac("stage", "join", cwd=toy.out).code == 0
    assert not stale(toy) and toy.result == "ALPHA GAMMA"


@pytest.mark.parametrize("torn", ["", "[]", '{"stages": 3}', '{"stages": [7, {"name": "join", "status": "ran", "inputs": 3}]}'])
def test_a_torn_run_json_is_written_anew(toy, torn):
    toy.ran()
    (toy.out / "run.json").write_text(torn)
    toy.ran("--until", "right")
    assert list(rows(toy))[:2] == ["cut", "right"]

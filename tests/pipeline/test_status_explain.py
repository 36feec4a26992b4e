import shutil

import pytest

from gsac.pipeline.project import shipped_dag
from gsac.pipeline.run_folder import RunFolder
from gsac.stages.contract import BadInput


def test_status_is_clean_after_a_run_and_exit_code_3_after_a_change(toy):
    toy.ran()
    done = toy.gsac("status", toy.out, "--json")
    assert done.code == 0 and done.json["up_to_date"]
    toy.edit("right/stage.py", "spell(word)", "spell(word) + '?'")
    done = toy.gsac("status", toy.out, "--json")
    assert done.code == 3 and not done.json["up_to_date"]
    assert [row["reason"] for row in done.json["stages"]] == ["up to date", "up to date", "code changed", "upstream"]


def test_status_tells_an_output_that_is_gone_from_one_that_was_altered(toy):
    toy.ran()
    (toy.out / "left" / "out.txt").unlink()
    (toy.out / "right" / "out.txt").unlink()
    (toy.out / "right" / "out.txt").write_text("by hand")
    rows = toy.gsac("status", toy.out, "--json").json["stages"]
    assert [row["reason"] for row in rows] == ["up to date", "not in the folder", "output changed", "up to date"]


def test_status_takes_a_copy_for_the_real_thing(toy):
    toy.ran()
    link = toy.out / "cut" / "words"
    target = link.resolve()
    link.unlink()
    shutil.copytree(target, link)
    assert toy.gsac("status", cwd=toy.out).code == 0


def test_status_names_a_clip_that_is_gone_and_tells_the_stages_of_the_clip_that_was(inside, toy):
    toy.ran()
    toy.clip.unlink()
    done = inside(toy, "status", toy.out, "--set", "right.keep=7", "--json")
    assert done.code == 2 and "clip.mp4, which is gone" in done.err and "which is gone" in done.json["error"]
    assert [row["reason"] for row in done.json["stages"]] == ["up to date", "up to date", "parameter changed", "upstream"]
    assert inside(toy, "status", toy.out).out.count("up to date") == 4
    (toy.out / "run.json").unlink()
    done = inside(toy, "status", toy.out)
    assert done.code == 2 and "clip.mp4, which is gone" in done.err and not done.out


def test_explain_names_every_part_of_the_key_that_changed(toy):
    toy.ran()
    toy.edit("common.py", "upper()", "lower()")
    done = toy.gsac("explain", "cut", toy.out, "--set", "cut.keep=2", "--json")
    assert done.code == 0 and done.json["reason"] == "parameter changed"
    assert {(c["kind"], c["name"]) for c in done.json["changes"]} == {
        ("parameter", "cut.keep"), ("code", "gsac.toy.common")}
    words = toy.gsac("explain", "cut", toy.out, "--set", "cut.keep=2").out
    assert "parameter cut.keep changed from 100 to 2" in words and "code gsac.toy.common changed" in words


def test_explain_of_a_stage_below_a_change_says_what_it_waits_for(toy):
    toy.ran()
    done = toy.gsac("explain", "join", toy.out, "--set", "right.keep=2")
    assert "runs if the result of right changes" in done.out


def test_explain_of_an_unknown_stage_names_the_known_ones(toy):
    toy.ran()
    done = toy.gsac("explain", "shout", toy.out)
    assert done.code == 2 and "cut, left, right, join" in done.err


def test_the_reason_of_a_result_that_was_damaged_dropped_or_removed_is_that_and_not_a_parameter(toy):
    toy.ran("--set", "right.keep=7")
    toy.ran()
    blob = (toy.out / "cut" / "words" / "000000.txt").resolve()
    blob.chmod(0o644)
    blob.write_text("damaged")
    assert toy.gsac("cache", "verify").code == 4
    assert toy.gsac("status", toy.out, "--json").json["stages"][0]["reason"] == "result lost"
    assert "cut: starts (result lost)" in toy.run().err
    for record in (toy.cache / "actions" / "right").iterdir():
        if "\"keep\": 100" in record.read_text():
            record.unlink()
    assert "right: starts (result lost)" in toy.run().err


def test_a_result_that_is_found_damaged_on_the_way_is_named_so_in_any_folder(toy):
    toy.ran("--set", "right.keep=7", "--set", "right.word=last")
    blob = (toy.out / "right" / "out.txt").resolve()
    blob.chmod(0o644)
    blob.write_text("damaged result")
    toy.run("--until", "cut")
    done = toy.gsac("run", toy.clip, "--out", "elsewhere", "--set", "right.keep=7", "--set", "right.word=last")
    assert "right: starts (result lost)" in done.err


def test_a_folder_that_is_not_there_is_named_as_that(toy):
    done = toy.gsac("status", "nope")
    assert done.code == 2 and f"{toy.root}/nope: no such folder" in done.err


def test_outside_of_a_run_the_runs_that_lie_here_are_named(toy):
    toy.ran()
    done = toy.gsac("status")
    assert done.code == 2 and "give one of: out" in done.err


def test_the_checkout_of_gsac_is_no_run_although_a_dvc_yaml_lies_there():
    with pytest.raises(BadInput, match="not in the output folder of a run"):
        RunFolder.around(shipped_dag().parent)


def test_explain_is_short_unless_all_is_asked_for(toy):
    toy.ran()
    short = toy.gsac("explain", "join", toy.out).out.splitlines()
    assert len(short) == 3 and "(--all lists them)" in short[-1]
    whole = toy.gsac("explain", "join", toy.out, "--all").out
    assert "code       gsac.toy.common = " in whole and "--all" not in whole

"""`gsac run` on the toy project: parts of the chain, what it writes, what it says, how it fails."""

import json
import os
import pty
import re
import subprocess
from pathlib import Path

import pytest
import yaml

from gsac.pipeline.asked_clip import find_clip


def test_until_stops_after_a_stage_and_runs_only_what_it_needs(toy):
    assert toy.ran("--until", "left") == ["cut", "left"]


def test_from_runs_the_stage_and_what_is_below_when_all_above_is_in_the_cache(toy):
    toy.ran()
    words = ["--set", "right.word=last", "--set", "left.word=last"]
    assert toy.ran("--from", "right", *words) == ["left", "right", "join"], "left is beside right, not above it"


def test_from_refuses_with_exit_code_3_when_something_above_is_not_in_the_cache(toy):
    toy.ran()
    done = toy.run("--from", "right", "--set", "cut.keep=1")
    assert done.code == 3 and "stage cut is not up to date" in done.err and "cut.keep" in done.err
    assert toy.runs == ["cut", "left", "right", "join"]


@pytest.mark.parametrize("words", [["--set", "cut.keep=1"], ["--force", "cut"]], ids=" ".join)
def test_dry_run_refuses_as_the_run_does_what_from_needs_and_is_not_in_the_cache(toy, words):
    toy.ran()
    dry, done = (toy.run("--from", "right", *words, *more) for more in (["--dry-run"], []))
    assert dry.code == done.code == 3 and dry.json["error"] == done.json["error"]
    assert "stage cut is not up to date" in dry.err and dry.statuses["cut"] == "planned"
    assert toy.run("--from", "right", "--set", "left.word=last", "--dry-run").code == 0, "left is beside right, not above it"


def test_dry_run_foretells_no_refusal_where_another_machine_may_have_the_result(toy):
    assert toy.run("--from", "right", "--dry-run", GSAC_REMOTE="s3://nowhere").code == 0


def test_dry_run_says_what_would_run_and_why_and_runs_nothing(toy):
    toy.ran()
    toy.runs_file.write_text("")
    done = toy.run("--dry-run", "--set", "left.word=last")
    assert done.code == 0 and toy.runs == []
    assert done.statuses == {"cut": "cached", "left": "planned", "right": "cached", "join": "planned"}
    assert "left.word changed from 'first' to 'last'" in done.err


def test_dry_run_refuses_the_folder_that_a_run_refuses(toy):
    photos = toy.root / "photos"
    photos.mkdir()
    (photos / "1.jpg").write_text("alpha")
    for words in ([], ["--dry-run"]):
        done = toy.gsac("run", ".", *words, cwd=photos)
        assert done.code == 2 and f"{photos}/photos-avatar lies in the folder of the photos" in " ".join(done.err.split())


def test_the_folder_of_a_linked_clip_is_named_after_the_link(toy):
    (toy.root / "ada.mp4").symlink_to(toy.clip)
    assert toy.gsac("run", "ada.mp4", "--until", "cut").out == f"{toy.root}/ada-avatar\n"


def test_the_first_run_in_a_folder_is_one_whatever_the_parameters(toy):
    toy.ran()
    other = toy.root / "other.mp4"
    other.write_text("delta epsilon")
    plans = toy.gsac("run", other, "--dry-run", "--set", "cut.keep=7", "--json").json["stages"]
    assert plans[0]["reason"] == "first run"
    plans = toy.gsac("run", toy.clip, "--out", "elsewhere", "--dry-run", "--set", "cut.keep=7", "--json").json["stages"]
    assert plans[0]["reason"] == "first run", "as after `gsac check`, which splits by other parameters"


def test_dry_run_writes_no_folder(toy):
    assert toy.run("--dry-run").code == 0
    assert not toy.out.exists()


def test_json_is_one_object_on_the_last_line_with_stages_outputs_and_metrics(toy):
    done = toy.run()
    assert len(done.out.splitlines()) == 1
    assert done.statuses == {"cut": "ran", "left": "ran", "right": "ran", "join": "ran"}
    for stage in done.json["stages"]:
        assert re.fullmatch("[0-9a-f]{64}", stage["key"]) and stage["seconds"] > 0
    assert done.json["metrics"] == {"length": 10}
    assert Path(done.json["outputs"]["join/out.txt"]).read_text() == "ALPHA ALPHA"


def test_the_output_folder_shows_every_stage_and_what_was_run(toy):
    toy.ran("--set", "left.trouble=warning")
    assert (toy.out / "cut" / "words").is_symlink() and (toy.out / "join" / "out.txt").is_symlink()
    assert json.loads((toy.out / "metrics.json").read_text()) == {"length": 10}
    run = json.loads((toy.out / "run.json").read_text())
    assert run["clip"] == str(toy.clip)
    left = next(stage for stage in run["stages"] if stage["name"] == "left")
    assert left["warnings"] == ["word 2 is short"] and left["params"]["trouble"] == "warning"
    assert {"seconds", "cpu_seconds", "peak_rss_mb", "key", "status"} <= left.keys()
    assert yaml.safe_load((toy.out / "params.yaml").read_text())["left"]["trouble"] == "warning"


def test_warnings_of_a_cached_stage_are_still_told(toy):
    toy.ran("--set", "left.trouble=warning")
    rows = toy.run("--set", "left.trouble=warning").json["stages"]
    assert rows[1]["status"] == "cached" and rows[1]["warnings"] == ["word 2 is short"]


def test_a_note_is_told_and_kept_and_is_no_warning(toy):
    done = toy.run("--set", "left.trouble=note")
    assert "left: note: words are taken as they come" in done.err and "warning" not in done.err
    left = toy.run("--set", "left.trouble=note").json["stages"][1]
    assert left["status"] == "cached" and left["warnings"] == [] and left["notes"] == ["words are taken as they come"]


def test_without_out_the_folder_is_named_after_the_clip(toy):
    assert toy.gsac("run", toy.clip).code == 0
    assert (toy.root / "clip-avatar" / "join" / "out.txt").read_text() == "ALPHA ALPHA"


@pytest.mark.parametrize(("trouble", "code", "words"), [
    ("stage", 1, "left: frame 3 has no person; record again"),
    ("bad input", 2, "left: the clip holds no words"),
    ("bug", 1, "KeyError: 'surprise'"),
    ("killed", 1, "killed by SIGKILL"),
    ("silent", 1, "did not write out.txt"),
    ("empty", 1, "out.txt is empty"),
])
def test_a_stage_that_fails_is_named_nothing_of_it_is_kept_and_what_was_finished_is(toy, trouble, code, words):
    done = toy.run("--set", f"left.trouble={trouble}")
    assert done.code == code and "stage left failed: " in done.err and words in done.err
    assert "Traceback" not in done.err
    assert done.statuses == {"cut": "ran", "left": "failed"}
    assert not (toy.out / "left").exists() and list((toy.cache / "tmp").iterdir()) == []
    assert json.loads((toy.out / "run.json").read_text())["stages"][1]["error"]
    toy.runs_file.write_text("")
    assert toy.run().code == 0
    assert toy.runs == ["left", "right", "join"]


def test_the_log_of_a_stage_that_broke_has_its_traceback(toy):
    done = toy.run("--set", "left.trouble=bug")
    log = toy.out / "logs" / "left.log"
    assert str(log) in done.err
    assert "left at work" in log.read_text() and "KeyError" in log.read_text()


@pytest.mark.parametrize(("arguments", "word"), [
    (["run", "nothing.mp4"], "nothing.mp4"),
    (["run", "clip.mp4", "--until", "shout"], "unknown stage shout; known: cut, left, right, join"),
    (["run", "clip.mp4", "--force", "shout"], "unknown stage shout"),
    (["run", "clip.mp4", "--until", "left", "--from", "join"], "join does not run with --until left"),
    (["run", "clip.mp4", "--params", "nothing.yaml"], "nothing.yaml"),
    (["run", "clip.mp4", "--out", "clip.mp4"], "clip.mp4 is a file"),
    (["run"], "CLIP"),
    (["fly"], "fly"),
    (["status", "."], "no dvc.yaml here or above"),
    (["view", "."], "viewer.html"),
    (["report", "."], "not the folder of a run"),
    (["bench", "nothing"], "no benchmark nothing"),
    (["cache", "gc", "--max-size", "many"], "many"),
    (["models", "add", "net", "nothing.bin"], "nothing.bin"),
    (["run", "clip.mp4", "--set", "left.model=nobody"], "unknown model file nobody"),
    (["batch", "nothing"], "nothing: no such file or folder"),
    (["batch", "lib"], "no clips here"),
    (["batch", "clip.mp4", "--executor", "moon"], "moon"),
])
def test_a_users_mistake_is_one_clear_line_and_exit_code_2(toy, arguments, word):
    done = toy.gsac(*arguments)
    assert done.code == 2 and word in done.err and "Traceback" not in done.err


def test_report_refuses_a_folder_whose_record_of_the_run_is_nonsense(toy, tmp_path):
    (tmp_path / "run.json").write_text("[1, 2]")
    done = toy.gsac("report", str(tmp_path))
    assert done.code == 2 and "run.json: not the record of a run" in done.err and not (tmp_path / "report.html").exists()


def test_nobodys_dvc_yaml_is_written_over(toy):
    toy.out.mkdir()
    (toy.out / "dvc.yaml").write_text("stages: {fit: {cmd: python fit.py}}")
    done = toy.run()
    assert done.code == 2 and "python fit.py" in done.err
    assert (toy.out / "dvc.yaml").read_text() == "stages: {fit: {cmd: python fit.py}}"


def test_nobodys_clip_is_written_over(toy):
    toy.out.mkdir()
    (toy.out / "clip").write_text("precious")
    assert toy.run().code == 2
    assert (toy.out / "clip").read_text() == "precious"


def test_a_clip_that_changes_while_it_is_read_is_not_published(toy):
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=1.5")
    toy.wait_for(lambda: "cut" in toy.runs)
    toy.clip.write_text("changed meanwhile")
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2 and "changed while it was being read" in err
    assert not list((toy.cache / "actions").glob("cut/*"))


@pytest.mark.parametrize("trouble", ["warning", "silent"])
def test_code_that_is_edited_while_its_stage_runs_publishes_nothing_and_is_named(toy, trouble):
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "left.pause_s=1.5", "--set", f"left.trouble={trouble}")
    toy.wait_for(lambda: "left" in toy.runs)
    toy.edit("left/stage.py", "spell(word)", "spell(word)[::-1]")
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1 and "its code was edited while it ran (gsac.toy.left.stage); run again" in err
    assert not list((toy.cache / "actions").glob("left/*"))


def test_a_parameter_that_is_added_while_a_run_goes_on_is_told_as_that(toy):
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=1.5")
    toy.wait_for(lambda: "cut" in toy.runs)
    toy.edit("left/__init__.py", "    def check", "    volume: int = 1\n\n    def check")
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1 and "its parameters were edited since the run began (volume); run again" in err


def test_a_missing_parent_of_the_cache_is_made(toy):
    assert toy.run(GSAC_CACHE=str(toy.root / "deep" / "deeper")).code == 0


def test_a_cache_that_cannot_be_written_is_said_and_the_run_keeps_its_results_in_its_own_folder(toy):
    done = toy.run(GSAC_CACHE="/proc/no-such-cache")
    assert done.code == 0, done.err
    assert "/proc/no-such-cache cannot be written" in done.err and str(toy.out / ".store") in done.err
    assert toy.result == "ALPHA ALPHA"
    toy.runs_file.write_text("")
    assert toy.run(GSAC_CACHE="/proc/no-such-cache").code == 0 and toy.runs == []


def test_an_unknown_device_is_named_with_the_known_ones(toy):
    done = toy.run(GSAC_DEVICE="abacus")
    assert done.code == 2 and "abacus" in done.err and "cpu, cuda" in done.err


def test_the_logs_of_stages_hold_only_what_the_stages_said(toy):
    toy.ran()
    for name in ("cut", "left", "right", "join"):
        assert (toy.out / "logs" / f"{name}.log").read_text() == f"{name} at work\n"


def test_plain_lines_without_a_terminal_and_no_control_codes(toy):
    done = toy.gsac("run", toy.clip, "--out", toy.out)
    assert "cut: starts" in done.err and "join: ran in" in done.err and "\x1b" not in done.err and done.out == f"{toy.out}\n"


def test_a_bar_in_a_terminal(toy):
    leader, follower = pty.openpty()
    process = subprocess.Popen(toy.command("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=0.6"),
                               cwd=toy.root, env=toy.env | {"TERM": "xterm"}, stderr=follower)
    os.close(follower)
    seen = b""
    while True:
        try:
            piece = os.read(leader, 4096)
        except OSError:
            break
        if not piece:
            break
        seen += piece
    assert process.wait(60) == 0
    assert "1/2 words" in seen.decode() and "left" in seen.decode() and "\x1b[" in seen.decode()


def test_a_rerun_recalls_the_warnings_of_cached_stages_by_their_first_sentence(toy):
    toy.edit("common.py", "word 2 is short", "Word 2 is short. Write a longer one in its place.")
    toy.ran("--set", "left.trouble=warning")
    done = toy.gsac("run", toy.clip, "--out", toy.out, "--set", "left.trouble=warning")
    assert "left: warning: left: Word 2 is short.\n" in done.err or "left: warning: Word 2 is short.\n" in done.err


def test_ctrl_c_says_that_the_same_command_goes_on(toy):
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "left.pause_s=30")
    toy.wait_for(lambda: "left" in toy.runs)
    process.terminate()
    assert "the same command goes on from there" in process.communicate(timeout=30)[1]


def test_in_the_folder_of_a_run_its_own_clip_runs_with_its_own_parameters(toy, everything):
    toy.ran("--set", "left.word=last", "--until", "right")
    toy.runs_file.write_text("")
    done = toy.gsac("run", "--json", cwd=toy.out / "right")
    assert done.code == 0 and toy.runs == ["left", "join"] and done.statuses.keys() == set(everything)
    assert toy.result == "GAMMA ALPHA"
    done = toy.gsac("run", "--set", "right.word=last", "--until", "right", cwd=toy.out)
    assert done.code == 0 and toy.runs == ["left", "join", "right"]
    assert toy.gsac("run", cwd=toy.out).code == 0 and toy.result == "GAMMA GAMMA"


def test_edited_parameters_hold_where_no_clip_is_given_and_are_not_moved_aside(toy):
    toy.ran()
    params = toy.out / "params.yaml"
    params.write_text(params.read_text().replace("left:\n  word: first", "left:\n  word: last"))
    done = toy.gsac("run", cwd=toy.out)
    assert done.code == 0 and toy.result == "GAMMA ALPHA" and "kept" not in done.err
    assert not list(toy.out.glob("params*kept*"))


def test_without_a_clip_another_folder_is_the_only_thing_that_is_not_as_it_was(toy):
    toy.ran("--set", "left.word=last")
    done = toy.gsac("run", "--out", toy.root / "other", cwd=toy.out)
    assert done.code == 0 and (toy.root / "other/join/out.txt").read_text() == "GAMMA ALPHA"


def test_elsewhere_a_run_without_a_clip_says_so(toy):
    for command in ("run", "check"):
        done = toy.gsac(command)
        assert done.code == 2 and "no CLIP was given, and this folder is not a run's: no dvc.yaml in" in done.err


def test_a_quality_for_the_run_in_this_folder_is_refused_with_the_command_that_does_it(toy):
    toy.ran()
    done = toy.gsac("run", "--quality", "draft", cwd=toy.out)
    assert done.code == 2 and f"`gsac run {toy.out}/clip --out {toy.out} --quality draft`" in " ".join(done.err.split())
    assert toy.gsac("run", "--quality", "standard", cwd=toy.out).code == 0
    toy.clip.unlink()
    done = toy.gsac("run", cwd=toy.out)
    assert done.code == 2 and "no clip here (a link to" in done.err


@pytest.mark.parametrize("command", ["run", "check"])
def test_the_folder_of_a_run_is_no_clip_and_the_clip_of_that_run_is_named(toy, command):
    toy.ran()
    done = toy.gsac(command, toy.out)
    assert done.code == 2 and f"{toy.out} is the folder of a run; give its clip, {toy.clip.resolve()}" in done.err
    batch = toy.root / "clips.txt"
    batch.write_text(f"{toy.out}\n")
    assert f"is the folder of a run; give its clip, {toy.clip.resolve()}" in toy.gsac("batch", batch, "--dry-run").err


def test_check_takes_the_clip_of_the_run_that_it_is_typed_in(toy, monkeypatch):
    toy.ran("--until", "left")
    monkeypatch.chdir(toy.out / "left")
    assert find_clip(None) == toy.clip.resolve()

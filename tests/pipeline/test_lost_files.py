"""Where the cache, the current folder or a path is gone, a command says so in one line and harms nothing."""

import os
import shlex
import shutil
import subprocess

import pytest

from gsac.pipeline.cli import execute
from gsac.pipeline.run_folder import RunFolder


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A run's folder as older runs left it: everything in it, export too, is a link into a cache that is gone."""
    monkeypatch.chdir(tmp_path)
    run = RunFolder(tmp_path / "my clip-avatar")
    for place in ("export", "split"):
        (run.root / place).mkdir(parents=True)
    (run.root / "dvc.yaml").write_text("stages: {}\n")
    (run.root / "report.html").write_text("the good report")
    run.write_json("run.json", {"stages": [{"name": "split", "status": "ran"}, {"name": "export", "status": "ran"}]})
    for number, name in enumerate(("export/avatar.gsac", "export/viewer.html", "split/frames")):
        digest = f"{number}a" + "0" * 62
        (run.root / name).symlink_to(tmp_path / "cache" / "objects" / f"{number}a" / digest)
    (tmp_path / "my clip.mp4").write_text("clip")
    run.clip.symlink_to(tmp_path / "my clip.mp4")
    return run.root


def say(capsys, *words):
    code = execute(list(map(str, words)))
    said = capsys.readouterr()
    assert not said.out
    return code, said.err


@pytest.mark.parametrize(("command", "inside"), [
    ("report", ""), ("pack", ""),
    *((command, inside) for command in ("view", "render") for inside in ("", "export", "export/avatar.gsac"))])
def test_dead_links_are_told_with_the_cache_they_led_to_and_the_command_that_brings_the_files_back(folder, capsys, command, inside):
    code, err = say(capsys, command, folder / inside)
    cache, clip = folder.parent / "cache", folder.parent / "my clip.mp4"
    assert code == 2 and err.count("\n") == 1
    assert f"its files lie in the cache {cache}, which is gone: `gsac run '{clip}' --out '{folder}'` brings them back" in err
    (cache / "objects").mkdir(parents=True)
    assert f"{cache}, which does not hold them any more: `gsac run" in say(capsys, command, folder / inside)[1]


def test_the_good_report_of_a_folder_whose_results_are_gone_stays(folder, capsys):
    for name in ("avatar.gsac", "viewer.html"):
        (folder / "export" / name).unlink()
        (folder / "export" / name).write_text("real")
    code, err = say(capsys, "report", folder)
    assert code == 2 and "split/frames" in err
    assert (folder / "report.html").read_text() == "the good report"


def test_where_the_clip_is_gone_too_the_command_leaves_its_place_open(folder, capsys):
    (folder.parent / "my clip.mp4").unlink()
    assert f"`gsac run CLIP --out '{folder}'`" in say(capsys, "view", folder)[1]


@pytest.mark.parametrize("words", [
    ["run", "{clip}", "--out", "/proc/foo"], ["run", "/proc/foo"], ["run", "{loop}"], ["run", "{clip}", "--out", "{loop}"],
    ["run", "{clip}", "--out", "{clip}/sub"], ["run", "{clip}", "--out", "/dev/null"], ["run", "{clip}", "--params", "/proc/foo"],
    ["run", "{clip}", "--out", "x" * 300], ["batch", "/proc/foo"], ["batch", "{loop}"], ["batch", "/dev/null"],
    ["status", "/proc/foo"], ["status", "{loop}"], ["explain", "cut", "/proc/foo"], ["report", "/proc/foo"], ["report", "{loop}"],
    ["view", "/proc/foo"], ["view", "{loop}"], ["view", "/"], ["render", "/proc/foo"], ["render", "{loop}"], ["render", "/"],
    ["pack", "/proc/foo"], ["pack", "{loop}"], ["pack", "/"], ["demo", "--out", "/proc/foo"],
    ["stage", "cut", "--inputs", "/proc/foo", "--out", "{clip}"], ["stage", "cut", "--inputs", "{inputs}", "--out", "/proc/foo"],
    ["models", "add", "body", "/proc/foo"]], ids=" ".join)
def test_no_path_ends_in_a_traceback(toy, words):
    (toy.root / "loop").symlink_to("loop")
    (toy.root / "inputs").mkdir()
    (toy.root / "inputs" / "clip").write_text("alpha")
    places = {"clip": toy.clip, "loop": toy.root / "loop", "inputs": toy.root / "inputs"}
    done = toy.gsac(*(word.format(**places) for word in words))
    assert done.code == 2, done.err
    assert "Traceback" not in done.err and done.err.splitlines()[-1].startswith("gsac: ")


@pytest.mark.parametrize("words", [
    ["run", "clip.mp4"], ["run", "{clip}"], ["status"], ["view", "."], ["render", "."], ["report", "."], ["pack", "."],
    ["stage", "cut"]], ids=" ".join)
def test_a_current_folder_that_is_gone_is_told_in_one_line(toy, words):
    gone = toy.root / "gone"
    gone.mkdir()
    command = toy.command(*(word.format(clip=toy.clip) for word in words))
    done = subprocess.run(["sh", "-c", 'cd "$0" && rmdir "$0" && exec "$@"', gone, *command], env=toy.env, text=True,
                          capture_output=True, timeout=60)
    assert done.returncode == 2 and "Traceback" not in done.stderr and done.stderr.count("\n") <= 2, done.stderr


def test_a_real_run_brings_lost_files_back(toy):
    toy.call_last_stage_export()
    toy.ran()
    shutil.rmtree(toy.cache, ignore_errors=True)
    subprocess.run(["chmod", "-R", "u+w", toy.cache], check=False)
    shutil.rmtree(toy.cache, ignore_errors=True)
    assert (toy.out / "export" / "out.txt").read_text() == "ALPHA ALPHA" and not os.path.exists(toy.out / "cut" / "words")
    done = toy.gsac("report", toy.out)
    command = f"gsac run {toy.clip} --out {toy.out} --params {toy.out / 'params.yaml'}"
    assert done.code == 2 and f"`{command}` brings them back" in done.err
    assert toy.ran() == ["cut", "left", "right", "export"] and toy.gsac("report", toy.out).code == 0
    assert [path.name for path in (toy.out / "export").iterdir() if "kept" in path.name] == []


def test_the_command_that_is_told_brings_back_what_the_runs_own_parameters_made(toy):
    toy.call_last_stage_export()
    assert toy.run("--set", "left.word=last").code == 0
    before = (toy.out / "export" / "out.txt").read_text()
    subprocess.run(["chmod", "-R", "u+w", toy.cache], check=True)
    shutil.rmtree(toy.cache)
    told = toy.gsac("report", toy.out).err.split("`")[1]
    assert toy.gsac(*shlex.split(told)[1:]).code == 0
    assert (toy.out / "export" / "out.txt").read_text() == before != "ALPHA ALPHA"

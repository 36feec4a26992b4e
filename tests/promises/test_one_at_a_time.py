"""Two commands in one folder: the second waits, and nothing of one is mixed with the other's."""

from __future__ import annotations

import json
import os
import signal

import pytest

pytestmark = pytest.mark.slow


def wait_for_words(process, words: str) -> str:
    """What a process has said on stderr by the time that these words have come."""
    said = ""
    while words not in said:
        line = process.stderr.readline()
        assert line, said
        said += line
    return said


@pytest.fixture
def busy(toy):
    """The toy project, and a run in its folder that has come to `left` and stays there for a while."""
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "left.pause_s=1.5")
    toy.wait_for(lambda: "left" in toy.runs)
    yield process
    process.kill()
    process.communicate()


def test_a_second_clip_waits_says_so_and_is_refused_when_the_first_has_taken_the_folder(toy, busy):
    other = toy.root / "other.mp4"
    other.write_text("omega psi")
    second = toy.start("run", other, "--out", toy.out)
    said = wait_for_words(second, "another command works in")
    assert str(toy.out) in said and busy.poll() is None
    _, rest = second.communicate(timeout=60)
    assert busy.wait(1) == 0 and second.returncode == 2 and f"holds the avatar of {toy.clip}" in rest
    assert toy.result == "ALPHA ALPHA" and json.loads((toy.out / "run.json").read_text())["clip"] == str(toy.clip)
    assert toy.gsac("status", toy.out, "--set", "left.pause_s=1.5").code == 0


@pytest.mark.parametrize("command", ["run", "stage", "report", "pack"])
def test_every_command_that_works_in_a_folder_waits_for_the_one_before(toy, busy, command):
    arguments = {"run": ["run", toy.clip, "--out", toy.out], "stage": ["stage", "right", toy.out],
                 "report": ["report", toy.out], "pack": ["pack", toy.out]}[command]
    if command == "report":
        (toy.out / "run.json").write_text('{"stages": []}')
    second = toy.start(*arguments)
    wait_for_words(second, "another command works in")
    assert busy.poll() is None
    _, said = second.communicate(timeout=60)
    assert busy.wait(1) == 0 and second.returncode == (2 if command == "pack" else 0), said
    assert "Traceback" not in said and not list((toy.out / "logs").glob("*.next"))


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_who_waits_can_be_interrupted_and_leaves_the_other_in_peace(toy, busy, how):
    second = toy.start("run", toy.clip, "--out", toy.out)
    wait_for_words(second, "another command works in")
    second.send_signal(how)
    assert second.wait(5) == 130 and busy.poll() is None
    assert busy.wait(30) == 0 and toy.result == "ALPHA ALPHA"


def test_a_killed_command_frees_the_folder_at_once(toy, busy):
    busy.kill()
    busy.wait()
    assert toy.ran() == ["left", "right", "join"]
    assert "another" not in toy.run().err


def test_gc_takes_no_input_of_a_stage_that_is_at_work_alone(toy):
    toy.edit("join/stage.py", '    begin(job, "join")\n', '    begin(job, "join")\n    end(job)\n')
    toy.ran("--set", "join.word=last")
    process = toy.start("stage", "join", "--inputs", toy.out, "--out", toy.root / "replay", "--set", "join.pause_s=2")
    toy.wait_for(lambda: toy.runs.count("join") == 2)
    for record in (toy.cache / "actions").glob("*/*.json"):
        os.utime(record, (0, 0))
    gone = toy.gsac("cache", "gc", "--max-size", "0", "--force", "--json").json["records"]
    assert {name.partition("/")[0] for name in gone} == {"cut", "join"}, "left and right are being read"
    _, said = process.communicate(timeout=60)
    assert process.returncode == 0, said
    assert (toy.root / "replay" / "out.txt").read_text() == "ALPHA ALPHA"

"""Kills, crowds and rot: a result is whole or it does not count."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gsac.cache.publish import STEPS
from support.leftovers import find_leftovers

pytestmark = pytest.mark.slow

STOPPED_AT = """
import errno, os, signal, sys
from gsac.pipeline import cli, stage_runner

publish = stage_runner.publish

def watched(store, parts, *rest, **more):
    def step(name):
        if parts.stage == "join" and name == sys.argv[2]:
            if sys.argv[1] == "killed":
                os.kill(os.getpid(), signal.SIGKILL)
            raise OSError(errno.ENOSPC, "No space left on device")
    return publish(store, parts, *rest, step=step, **more)

stage_runner.publish = watched
sys.exit(int(cli.execute(sys.argv[3:])))
"""


@pytest.fixture
def temporary(tmp_path, monkeypatch) -> Path:
    """An empty folder in which commands put their temporary files."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    return tmp_path / "temporary"


def run_stopped(toy, how: str, step: str) -> subprocess.CompletedProcess:
    """A run that is killed, or finds the disk full, right after one step of the publish of `join`."""
    command = [sys.executable, "-P", "-c", STOPPED_AT, how, step, "run", str(toy.clip), "--out", str(toy.out)]
    return subprocess.run(command, cwd=toy.root, env=toy.env, capture_output=True, text=True)


@pytest.mark.parametrize("step", ["started", "sealed", "placed", "record written"])
def test_a_disk_that_is_full_while_publishing_is_said_and_nothing_is_lost(toy, step):
    toy.ran("--until", "right")
    done = run_stopped(toy, "full", step)
    assert done.returncode == 1 and "no room left in the cache folder" in done.stderr and "Traceback" not in done.stderr
    assert toy.gsac("cache", "verify").code == 0
    assert toy.ran() == ["join"] and toy.result == "ALPHA ALPHA"


@pytest.mark.parametrize("step", STEPS)
def test_sigkill_at_every_step_of_a_publish_leaves_no_torn_artifact_and_nothing_after_the_next_run(toy, step, temporary):
    toy.ran("--until", "right")
    done = run_stopped(toy, "killed", step)
    assert done.returncode == -signal.SIGKILL
    assert toy.gsac("cache", "verify").code == 0
    left = toy.ran()
    assert left == ([] if step in ("recorded", "record synced") else ["join"])
    assert toy.result == "ALPHA ALPHA"
    assert find_leftovers(toy.cache, toy.out, temporary) == []


def test_sigkill_in_the_middle_of_a_stage_never_leaves_a_torn_artifact_that_counts_as_done(toy):
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "join.pause_s=30")
    toy.wait_for(lambda: "join" in toy.runs)
    toy.wait_for(lambda: list((toy.cache / "tmp").glob("join-*/out.txt")))
    worker = _children(process.pid)
    assert worker
    process.kill()
    process.communicate()
    toy.wait_for(lambda: not any(_alive(pid) for pid in worker))
    assert not (toy.out / "join").exists()
    assert toy.ran() == ["join"]
    assert toy.result == "ALPHA ALPHA"


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_the_stage_with_exit_code_130_and_keeps_what_is_finished(toy, how):
    process = toy.start("run", toy.clip, "--out", toy.out, "--json", "--set", "join.pause_s=30")
    toy.wait_for(lambda: "join" in toy.runs)
    worker = _children(process.pid)
    began = time.monotonic()
    process.send_signal(how)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130 and "interrupted" in err and "Traceback" not in err
    assert time.monotonic() - began < 10
    assert not any(_alive(pid) for pid in worker)
    assert list((toy.cache / "tmp").iterdir()) == []
    assert (toy.out / "left" / "out.txt").read_text() == "ALPHA"
    assert toy.ran() == ["join"]


def test_many_writers_one_result(toy, everything):
    runs = [toy.start("run", toy.clip, "--out", toy.root / f"out{i}", "--set", "cut.pause_s=0.5") for i in range(4)]
    for run in runs:
        _, err = run.communicate(timeout=120)
        assert run.returncode == 0, err
    assert sorted(toy.runs) == sorted(everything)
    assert {(toy.root / f"out{i}" / "join" / "out.txt").read_text() for i in range(4)} == {"ALPHA ALPHA"}


def test_a_run_that_dies_hands_its_key_to_the_one_that_waits(toy):
    first = toy.start("run", toy.clip, "--out", toy.root / "out1", "--until", "cut", "--set", "cut.pause_s=2")
    toy.wait_for(lambda: "cut" in toy.runs)
    second = toy.start("run", toy.clip, "--out", toy.root / "out2", "--until", "cut", "--set", "cut.pause_s=2")
    toy.wait_for(lambda: b"waiting" in os.read(second.stderr.fileno(), 10_000))
    first.kill()
    first.communicate()
    second.communicate(timeout=60)
    assert second.returncode == 0
    assert toy.runs == ["cut", "cut"]


def test_a_corrupt_blob_is_found_quarantined_and_recomputed(toy):
    toy.ran()
    blob = (toy.out / "right" / "out.txt").resolve()
    blob.chmod(0o644)
    blob.write_text("WRONG")
    done = toy.run()
    assert done.code == 0 and "damaged" in done.err
    assert toy.result == "ALPHA ALPHA"
    assert [p.read_text() for p in (toy.cache / "quarantine").iterdir()] == ["WRONG"]


def test_verify_finds_rot_that_keeps_size_and_date_and_says_so_with_exit_code_4(toy):
    toy.ran()
    assert toy.gsac("cache", "verify").code == 0
    blob = (toy.out / "right" / "out.txt").resolve()
    stat = blob.stat()
    blob.chmod(0o644)
    blob.write_text("OMEGA")
    os.utime(blob, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    found = toy.gsac("cache", "verify", "--json")
    assert found.code == 4 and not found.json["sound"] and len(found.json["damaged"]) == 1
    assert toy.gsac("cache", "verify").code == 0
    # left and right had the same content, so the same blob: both are made again, and join, which may have read what was damaged.
    assert toy.ran() == ["left", "right", "join"]
    assert toy.result == "ALPHA ALPHA"


def test_gc_never_removes_what_a_run_in_progress_needs(toy):
    toy.ran("--set", "right.word=last")
    shutil.rmtree(toy.out)
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "join.pause_s=4")
    toy.wait_for(lambda: "join" in toy.runs[4:])
    for record in (toy.cache / "actions").glob("*/*.json"):
        os.utime(record, (0, 0))
    collected = toy.gsac("cache", "gc", "--max-size", "0", "--json")
    assert collected.code == 0
    assert {name.split("/")[0] for name in collected.json["records"]} == {"right", "join"}, "the other run's results go"
    _, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert toy.result == "ALPHA ALPHA"
    assert (toy.out / "cut" / "words" / "000000.txt").read_text() == "alpha"


def _children(pid: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def _alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"

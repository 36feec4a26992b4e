"""Processes that gsac has started end with it, however it ends and whatever they do."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SOON_S = 2.0

STARTER = """
import sys
from gsac.pipeline.tether import tethered
with tethered(sys.argv[1], stdout=sys.stdout, env=None) as process:
    process.wait()
"""
CHILDREN = {
    "sleeping": "import time\ntime.sleep(60)",
    "busy in one call": "sum(range(10**12))",
    "deaf to signals": "import signal, time\nfor s in (2, 15, 1): signal.signal(s, signal.SIG_IGN)\ntime.sleep(60)",
}
SPOKEN = "import os, subprocess, sys\nother = subprocess.Popen(['sleep', '60'])\nprint(os.getpid(), other.pid, flush=True)\n"


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("kind", CHILDREN)
def test_a_child_and_what_it_started_end_within_two_seconds_of_a_killed_parent(tmp_path, kind):
    (tmp_path / "clinging.py").write_text(SPOKEN + CHILDREN[kind])
    path = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    starter = subprocess.Popen([sys.executable, "-c", STARTER, "clinging"], stdout=subprocess.PIPE, text=True,
                               env=os.environ | {"PYTHONPATH": path})
    pids = [int(word) for word in starter.stdout.readline().split()]
    assert len(pids) == 2 and all(map(is_alive, pids))
    starter.kill()
    starter.wait()
    end = time.monotonic() + SOON_S
    while any(map(is_alive, pids)) and time.monotonic() < end:
        time.sleep(0.01)
    assert not any(map(is_alive, pids))


def test_a_child_that_ends_by_itself_keeps_its_exit_code(tmp_path):
    (tmp_path / "ending.py").write_text("import sys\nsys.exit(7)")
    path = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    script = STARTER + "\nsys.exit(process.returncode)"
    assert subprocess.run([sys.executable, "-c", script, "ending"], env=os.environ | {"PYTHONPATH": path}).returncode == 7


@pytest.mark.slow
def test_a_stage_ends_within_two_seconds_of_a_killed_run_and_the_next_start_leaves_no_temporary_file(toy, tmp_path):
    toy.edit("common.py", "import os\n", "import os\nimport tempfile\n")
    toy.edit("common.py", "time.sleep(job.config.pause_s)", "tempfile.mkstemp(); sum(range(int(job.config.pause_s * 10**10)))")
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "join.pause_s=30", TMPDIR=str(temporary))
    toy.wait_for(lambda: "join" in toy.runs and list(temporary.glob("*/tmp*")))
    worker = [int(word) for word in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]
    process.send_signal(signal.SIGKILL)
    process.communicate()
    toy.wait_for(lambda: not any(map(is_alive, worker)), SOON_S)
    assert list(temporary.iterdir())
    assert toy.run("--until", "cut", TMPDIR=str(temporary)).code == 0
    assert list(temporary.iterdir()) == []

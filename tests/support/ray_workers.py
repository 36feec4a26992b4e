"""Clips of stages that sleep on one Ray worker and on four: `PYTHONPATH=tests python -m support.ray_workers [CLIPS]`.

Both figures are told: with the time that the command takes to start and end, and of the clips alone, from the first stage that
begins to the last that ends.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from support.toy import Toy

PAUSE_S = 2.0
"""Of each of the four stages."""
NOTED = """
import os, time

def run(job):
    with open(os.environ["TOY_RUNS"] + ".times", "a") as log:
        log.write(f"{time.time()}\\n")
"""
CORES = 2
"""That a clip takes of the cluster."""


class Took(NamedTuple):
    """Seconds of a batch."""

    whole: float
    start: float
    """Before the first stage began."""
    clips: float
    """From then to the end of the last stage."""


def run_batch(root: Path, clips: int, workers: int) -> Took:
    """A batch of so many clips on a cluster with room for so many at once."""
    from ray.cluster_utils import Cluster

    toy = Toy(root)
    for stage in ("cut", "left", "right", "join"):
        toy.edit(f"{stage}/stage.py", "def run(job):\n", NOTED)
    folder = root / "clips"
    folder.mkdir()
    for number in range(clips):
        (folder / f"{number}.mp4").write_text(f"{number} alpha")
    os.environ.update({name: toy.env[name] for name in ("PYTHONPATH", "GSAC_STAGES", "GSAC_CACHE", "TOY_RUNS")})
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": CORES * workers})
    try:
        began = time.time()
        pauses = [word for stage in ("cut", "left", "right", "join") for word in ("--set", f"{stage}.pause_s={PAUSE_S}")]
        command = toy.command("batch", folder, "--out", root / "out", "--executor", "ray", "--address", cluster.address, *pauses)
        done = subprocess.run(command, env=toy.env, cwd=root, text=True, capture_output=True, check=False)
        whole = time.time() - began
    finally:
        cluster.shutdown()
    if done.returncode:
        raise SystemExit(done.stderr)
    times = sorted(map(float, toy.runs_file.with_name(f"{toy.runs_file.name}.times").read_text().split()))
    return Took(whole, times[0] - began, times[-1] + PAUSE_S - times[0])


def main() -> None:
    clips = int(sys.argv[1]) if len(sys.argv) > 1 else 12
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as four:
        alone, together = run_batch(Path(one), clips, 1), run_batch(Path(four), clips, 4)
    for workers, took in ((1, alone), (4, together)):
        print(f"{workers} at once: {took.whole:.1f} s, {took.start:.1f} of them to the first stage; clips alone "
              f"{took.clips:.1f} s, {took.clips * workers / clips:.1f} s each")
    print(f"{clips} clips of four stages of {PAUSE_S:g} s: {alone.clips / together.clips:.2f} times the throughput, "
          f"{alone.whole / together.whole:.2f} with start and end")


if __name__ == "__main__":
    main()

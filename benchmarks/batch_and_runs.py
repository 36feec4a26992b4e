"""A batch against as many runs in a row: `python -m gsac.benchmarks.batch_and_runs [CLIPS] [--rounds N] [--memory GB ...]`.

Clips of made-up persons, 8 frames each, go from the clip to the masks, in turn by `gsac batch` and by one `gsac run` after
another, each time in an empty cache that has the models. Told are CPU seconds of all processes, and seconds by the clock, the best
of all rounds; and the most memory that the processes held at once. Then, for each `--memory`, a batch of two at once under that
bound, in a cache that knows from two other clips what they take.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from gsac.benchmarks.batch_planner import borrow_models
from gsac.cache import objects
from gsac.turntable.clip import make_clip

FRAMES, HEIGHT = 16, 320
"""Of a clip; every second frame is read."""
ARGUMENTS = ("--until", "segment", "--set", "split.count=8", "--set", "split.max_height=240")
SAMPLE_S = 0.2
"""s between two looks at the memory."""


class Cost(NamedTuple):
    """Of all clips."""

    cpu: float
    """s of all processes."""
    wall: float
    peak_mb: float
    """Most memory at once; what processes share is counted once for each."""


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.batch_and_runs",
                                     description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("clips", type=int, nargs="?", default=12, metavar="CLIPS")
    parser.add_argument("--rounds", type=int, default=2, metavar="N", help="of which the best is told")
    parser.add_argument("--memory", type=float, nargs="*", default=[], metavar="GB", help="bounds, as of `gsac batch`")
    options = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        clips = Path(folder, "clips")
        clips.mkdir()
        for seed in range(options.clips):
            make_clip(Path(folder, "truth"), seed=seed, frames=FRAMES, height=HEIGHT).rename(clips / f"{seed:02d}.mp4")
            shutil.rmtree(Path(folder, "truth"))
        batch = [["batch", str(clips), "--out", "{out}", *ARGUMENTS]]
        row = [["run", str(clip), "--out", f"{{out}}/{clip.stem}", *ARGUMENTS] for clip in sorted(clips.iterdir())]
        ways = {"batch": batch, "one after another": row}
        costs: dict[str, list[Cost]] = {name: [] for name in ways}
        for _ in range(options.rounds):
            for name, commands in ways.items():
                costs[name].append(measure(Path(folder, "work"), commands))
                print(f"{name}: {costs[name][-1].cpu:.1f} CPU s, {costs[name][-1].wall:.1f} s, {costs[name][-1].peak_mb:,.0f} MB",
                      flush=True)
        for bound in options.memory:
            first, others = Path(folder, "first.txt"), Path(folder, "others.txt")
            paths = [str(clip) for clip in sorted(clips.iterdir())]
            first.write_text("\n".join(paths[:2]))
            others.write_text("\n".join(paths[2:]))
            words = ["batch", str(others), "--out", "{out}", "-j", "2", "--memory", str(bound), *ARGUMENTS]
            cost = measure(Path(folder, "work"), [words], before=["batch", str(first), "--out", "{out}", *ARGUMENTS])
            print(f"two at once, --memory {bound:g}: {cost.peak_mb:,.0f} MB at most, {cost.wall:.1f} s", flush=True)
    if not options.rounds:
        return 0
    best = {name: Cost(*(min(values) for values in zip(*found, strict=True))) for name, found in costs.items()}
    both = [best[name] for name in ways]
    print(f"{options.clips} clips, batch over runs: CPU {both[0].cpu / both[1].cpu:.3f}, clock {both[0].wall / both[1].wall:.3f}")
    return 0


def measure(work: Path, commands: list[list[str]], before: list[str] | None = None) -> Cost:
    """Runs commands one after another in an empty cache. `{out}` in a word is their folder. before: one that does not count."""
    work.mkdir()
    borrow_models(work / "cache")
    environment = os.environ | {"GSAC_CACHE": str(work / "cache"), "GSAC_MEASURED": str(work)}

    def spell(words: list[str]) -> list[str]:
        return [sys.executable, "-P", "-m", "gsac.pipeline.cli", *(word.replace("{out}", str(work / "out")) for word in words)]

    if before is not None:
        subprocess.run(spell(before), env=environment, check=True, capture_output=True)
    began, spent, peak = time.perf_counter(), children_s(), 0.0
    for command in map(spell, commands):
        with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            while process.poll() is None:
                peak = max(peak, memory_mb(f"GSAC_MEASURED={work}".encode()))
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(SAMPLE_S)
        if process.returncode:
            raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    cost = Cost(children_s() - spent, time.perf_counter() - began, peak)
    objects.remove(work)
    return cost


def children_s() -> float:
    """CPU seconds of the processes that have ended below this one."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def memory_mb(mark: bytes) -> float:
    """Memory of all processes that have a word in their environment."""
    total = 0
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            if mark in (process / "environ").read_bytes():
                total += int((process / "statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return total / 2**20


if __name__ == "__main__":
    sys.exit(main())

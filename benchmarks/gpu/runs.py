"""python -m gsac.benchmarks.gpu.runs CLIP [CLIP ...] : whole runs, each over a store with no result in it, as README's rows.

Models and compiled kernels are those of the usual store; what is known of files that have not changed stays from run to run. A clip
that is given twice is also held to the same bytes.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from gsac.cache import objects
from gsac.cache.root import default_root
from gsac.stages.contract import BadInput

KEPT = ("models", "kernels")
"""Folders of the usual store that every run may use."""
RESULTS = ("actions", "objects")
"""Folders of a store that hold what was computed."""
SAME = ("train/avatar.npz", "train/body.npz", "export/avatar.gsac")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.gpu.runs", description=__doc__.splitlines()[0])
    parser.add_argument("clips", type=Path, nargs="+", metavar="CLIP")
    clips = parser.parse_args().clips
    known: dict[Path, list[bytes]] = {}
    with tempfile.TemporaryDirectory() as folder:
        store = new_store(Path(folder))
        for number, clip in enumerate(clips):
            out = Path(folder) / f"out{number}"
            took, summary = run(clip.absolute(), out, store)
            if not number:
                print(row("clip", [stage["name"] for stage in summary["stages"]] + ["between them", "in all"]), flush=True)
            seconds = [stage["seconds"] for stage in summary["stages"]]
            print(row(clip.stem, [f"{s:.1f}" for s in (*seconds, took - sum(seconds), took)]), flush=True)
            made = [(out / name).read_bytes() for name in SAME]
            if known.setdefault(clip, made) is not made:
                print("    the same bytes as before" if known[clip] == made else "    NOT the same bytes as before", flush=True)


def new_store(folder: Path) -> Path:
    """A store without a result."""
    store = folder / "store"
    store.mkdir()
    for name in KEPT:
        (default_root() / name).mkdir(parents=True, exist_ok=True)
        (store / name).symlink_to(default_root() / name)
    return store


def run(clip: Path, out: Path, store: Path) -> tuple[float, dict]:
    """Wall seconds of one run into `out`, with nothing computed before, and the object of its --json. BadInput where it fails."""
    for name in RESULTS:
        objects.remove(store / name)
    began = time.monotonic()
    done = subprocess.run([sys.executable, "-m", "gsac.pipeline.cli", "run", str(clip), "--out", str(out), "--json"],
                          capture_output=True, text=True, env=os.environ | {"GSAC_CACHE": str(store)})
    took = time.monotonic() - began
    if done.returncode:
        raise BadInput(f"{clip}: the run ended with code {done.returncode}\n{done.stderr}")
    return took, json.loads(done.stdout.splitlines()[-1])


def row(head: str, cells: list[str]) -> str:
    return f"| {' | '.join([head, *cells])} |"


if __name__ == "__main__":
    main()

"""python -m gsac.benchmarks.gpu.runs CLIP [CLIP ...]: times whole runs, each on a store without results, as rows of the README.

Models and compiled kernels are those of the default store; digests of unchanged files are kept from run to run. A clip that is
given twice must give the same bytes.
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
"""Folders of the default store that every run may use."""
RESULTS = ("actions", "objects")
"""Folders of a store that hold results."""
SAME = ("train/avatar.npz", "train/body.npz", "export/avatar.gsac")
"""Files that are compared between runs of one clip."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.gpu.runs", description=__doc__.splitlines()[0])
    parser.add_argument("clips", type=Path, nargs="+", metavar="CLIP")
    clips = parser.parse_args().clips
    known: dict[Path, list[bytes]] = {}
    with tempfile.TemporaryDirectory() as folder:
        store = make_store(Path(folder))
        for number, clip in enumerate(clips):
            out = Path(folder) / f"out{number}"
            took, summary = run(clip.absolute(), out, store)
            if not number:
                print(format_row("clip", [stage["name"] for stage in summary["stages"]] + ["between them", "in all"]), flush=True)
            seconds = [stage["seconds"] for stage in summary["stages"]]
            print(format_row(clip.stem, [f"{s:.1f}" for s in (*seconds, took - sum(seconds), took)]), flush=True)
            made = [(out / name).read_bytes() for name in SAME]
            if known.setdefault(clip, made) is not made:
                print("    the same bytes as before" if known[clip] == made else "    NOT the same bytes as before", flush=True)


def make_store(folder: Path) -> Path:
    """Makes a store without results."""
    store = folder / "store"
    store.mkdir()
    for name in KEPT:
        (default_root() / name).mkdir(parents=True, exist_ok=True)
        (store / name).symlink_to(default_root() / name)
    return store


def run(clip: Path, out: Path, store: Path) -> tuple[float, dict]:
    """Removes the store's results and runs a clip into `out`. Returns wall seconds and --json's object; BadInput if it fails."""
    for name in RESULTS:
        objects.remove(store / name)
    began = time.monotonic()
    done = subprocess.run([sys.executable, "-m", "gsac.pipeline.cli", "run", str(clip), "--out", str(out), "--json"],
                          capture_output=True, text=True, env=os.environ | {"GSAC_CACHE": str(store)})
    took = time.monotonic() - began
    if done.returncode:
        raise BadInput(f"{clip}: the run ended with code {done.returncode}\n{done.stderr}")
    return took, json.loads(done.stdout.splitlines()[-1])


def format_row(head: str, cells: list[str]) -> str:
    """A row of a Markdown table."""
    return f"| {' | '.join([head, *cells])} |"


if __name__ == "__main__":
    main()

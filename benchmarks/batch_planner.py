"""Planning a batch of unchanged clips: how long, and how much memory: `python -m gsac.benchmarks.batch_planner CLIPS JOBS`.

Clips and results are made up, one small file an output and FRAMES a folder, in a cache of their own; a clip stands for as many jobs
as are wanted, each with a folder of its own. So the figures are of a disk whose files lie in memory.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

from gsac.cache.publish import publish
from gsac.cache.record import RunInfo
from gsac.cache.store import Store
from gsac.pipeline.batch_plan import BatchPlanner
from gsac.pipeline.executors.executor import ClipJob
from gsac.pipeline.graph import CLIP
from gsac.pipeline.keys import KeysOfOneMoment
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.pipeline.run import Options
from gsac.pipeline.sources import source_digest

FRAMES = 60


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.batch_planner", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("clips", type=int, metavar="CLIPS", help="made-up clips")
    parser.add_argument("jobs", type=int, metavar="JOBS", help="to be planned")
    options = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        borrow_models(Path(folder, "cache"))
        project, store = Project.at_hand(), Store(Path(folder, "cache"))
        configs = resolve(project)
        clips = make_clips(Path(folder), options.clips, KeysOfOneMoment(project, configs, store), store)
        jobs = [ClipJob(clips[n % len(clips)], Path(folder, f"{n}-avatar")) for n in range(options.jobs)]
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        began = time.process_time()
        plans = BatchPlanner(project, configs, store, Options()).plan_all(jobs)
        took = time.process_time() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(f"{len(plans):,} jobs of {len(clips):,} clips, {sum(plan.unchanged for plan in plans):,} unchanged: {took:.1f} CPU s, "
          f"{1000 * took / len(plans):.2f} ms each; {peak / 1024:.0f} MB at most, {before / 1024:.0f} before")
    return 0


def borrow_models(cache: Path) -> None:
    """Makes a cache with the model files of the user's own, and nothing else."""
    cache.mkdir()
    (cache / "models").symlink_to(Store.open().root / "models")


def make_clips(folder: Path, count: int, keys: KeysOfOneMoment, store: Store) -> list[Path]:
    """Made-up clips whose stages all have a made-up result in the store."""
    clips = [folder / f"{number}.mp4" for number in range(count)]
    for clip in clips:
        clip.write_text(clip.name)
        digests = {CLIP: source_digest(clip, store)}
        for name, step in keys.project.graph.steps.items():
            outputs = keys.project.outputs(name)
            with store.private(name) as made:
                for output in outputs:
                    write_output(made / output, f"{name} {clip.name}")
                parts = keys.parts(name, {port: digests[port] for port in step.deps})
                record = publish(store, parts, made, outputs, RunInfo(seconds=1.0))
            digests |= {f"{name}/{output}": digest for output, digest in record.outputs.items()}
    return clips


def write_output(path: Path, words: str) -> None:
    """A file, or a folder of frames where the output's name has no ending."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix:
        path.write_text("{}" if path.suffix == ".json" else words)
        return
    path.mkdir()
    for number in range(FRAMES):
        (path / f"{number:06d}.png").write_text(f"{words} {number}")


if __name__ == "__main__":
    sys.exit(main())

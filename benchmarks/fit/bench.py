"""gsac bench fit: `lm` and `paper` on the same detections of truth clips, in one run.

Clips come from the turntable, with bodies outside the shape basis and seeds that measured nothing, and from `--clip` folders. What
the stages before `smplx` see is computed once and kept in the cache.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

SEEDS = (31, 32)
"""Not 11, 12 and 41 to 44: those measured the detector's offsets and habits."""


def parser() -> argparse.ArgumentParser:
    out = argparse.ArgumentParser(prog="gsac bench fit", description="The body fit against truth: error and seconds, both methods.")
    out.add_argument("--seeds", type=int, nargs="*", default=list(SEEDS), help="turntable clips (default: 31 32)")
    out.add_argument("--clip", type=Path, action="append", default=[], metavar="DIR",
                     help="another truth clip: a folder with clip.mp4, mask/ and truth.npz; may be repeated")
    out.add_argument("--methods", nargs="+", default=["lm", "paper"], choices=["lm", "paper"])
    out.add_argument("--focal", nargs="+", default=["given", "unknown"], choices=["given", "unknown"])
    out.add_argument("--out", type=Path, default=Path("bench-fit"), metavar="DIR", help="default: ./bench-fit")
    out.add_argument("--clips", type=Path, metavar="DIR", help="where rendered clips are kept (default: OUT/clips)")
    return out


def main(argv: list[str] | None = None) -> int:
    options = parser().parse_args(argv)
    from gsac.benchmarks.fit import chart, clips, table, trial
    from gsac.cache.store import Store
    from gsac.pipeline.events import PlainReporter

    say = PlainReporter(sys.stderr)
    store = Store.open(say=say.note)
    options.out.mkdir(parents=True, exist_ok=True)
    kept = options.clips or options.out / "clips"
    folders = [clips.truth_folder(kept / f"seed{seed}", seed, say) for seed in options.seeds]
    cases = [clips.seen(f, store, options.out / "runs" / f.name, say) for f in [*folders, *options.clip]]
    trial.warm_up()
    trials = []
    for case in cases:
        for focal in options.focal:
            for method in options.methods:
                trials.append(trial.fit(case, method, focal == "given"))
                say.note(f"{case.name}, focal {focal}, {method}: {trials[-1].wall_s:.1f} s")
    written = table.text(trials)
    print(written)
    print("\n".join(table.faster(trials)))
    (options.out / "fit.txt").write_text(written + "\n")
    table.write_csv(trials, options.out / "fit.csv")
    chart.draw(trials, options.out)
    return 0

"""gsac bench speed-accuracy: held-out quality against CPU seconds of training, in one run on the same clips and frames.

A curve's seconds are CPU seconds of all threads; judging is not counted, loading of compiled kernels is.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from gsac.benchmarks import training

CURVE = 16
"""Checkpoints of a curve."""


def parser() -> argparse.ArgumentParser:
    out = argparse.ArgumentParser(prog="gsac bench speed-accuracy", description=__doc__.splitlines()[0])
    training.declare(out, "speed-accuracy")
    out.add_argument("--recipes", nargs="+", default=["fast", "paper"], choices=["fast", "paper"])
    out.add_argument("--budgets", type=int, nargs="+", default=[400, 1600, 3200], metavar="STEPS",
                     help="steps of recipe fast, one training each (default: 400 1600 3200)")
    out.add_argument("--paper-steps", type=int, default=3000, metavar="STEPS", help="steps of recipe paper (default: 3000)")
    out.add_argument("--repeats", type=int, default=1, metavar="N", help="trainings of each, with seeds 0 to N-1 (default: 1)")
    out.add_argument("--gpu-curve", type=Path, metavar="CSV",
                     help="curve.csv of `python -m gsac.benchmarks.gpu.curve`, drawn beside the CPU's curves of the same clips")
    return out


def main(argv: list[str] | None = None) -> int:
    options = parser().parse_args(argv)
    from gsac.benchmarks.gpu import curve
    from gsac.benchmarks.speed_accuracy import chart, table
    from gsac.benchmarks.speed_accuracy.trial import trial
    from gsac.pipeline.events import PlainReporter

    say = PlainReporter(sys.stderr)
    on_gpu = curve.read(options.gpu_curve) if options.gpu_curve else []
    options.out.mkdir(parents=True, exist_ok=True)
    trials = []
    for case in training.cases(options, say):
        for recipe in options.recipes:
            for steps in options.budgets if recipe == "fast" else [options.paper_steps]:
                for seed in range(options.repeats):
                    folder = options.out / "trainings" / f"{case.name}_{recipe}{steps}_{seed}"
                    metrics = training.train(case, folder, recipe=recipe, steps=steps, seed=seed, height=options.height,
                                             curve=CURVE)
                    trials.append(trial(case.name, metrics))
                    say.note(f"{folder.name}: {trials[-1].psnr_fg:.2f} dB after {trials[-1].cpu_s:.1f} CPU s")
    words = table.text(trials)
    print(words)
    (options.out / "speed_accuracy.txt").write_text(words + "\n")
    table.write_csv(trials, options.out / "speed_accuracy.csv")
    chart.draw(trials, options.out, on_gpu)
    return 0

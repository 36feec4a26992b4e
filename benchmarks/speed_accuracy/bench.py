"""gsac bench speed-accuracy: held-out quality against CPU seconds of training, in one run on the same clips and frames.

A curve's seconds are CPU seconds of all threads, with loading of compiled kernels, without judging.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from gsac.benchmarks import training
from gsac.benchmarks.speed_accuracy.trial import Trial
from gsac.pipeline.reporter import PlainReporter

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
    out.add_argument("--jobs", type=int, default=1, metavar="N",
                     help="trainings side by side, each on its share of the cores (default: 1)")
    out.add_argument("--novel", type=int, default=0, metavar="FRAMES",
                     help="also judge this many frames in novel poses against truth; rendered clips only (default: 0)")
    out.add_argument("--exact", action="store_true", help="also train rendered clips with their true poses")
    out.add_argument("--gpu-curve", type=Path, metavar="CSV",
                     help="curve.csv of `python -m gsac.benchmarks.gpu.curve`, drawn beside the CPU's curves of the same clips")
    return out


def main(argv: list[str] | None = None) -> int:
    options = parser().parse_args(argv)
    from gsac.benchmarks.gpu import curve
    from gsac.benchmarks.speed_accuracy import chart, table

    say = PlainReporter(sys.stderr)
    on_gpu = curve.read(options.gpu_curve) if options.gpu_curve else []
    options.out.mkdir(parents=True, exist_ok=True)
    trials = measure(training.prepare_cases(options, say, options.novel, options.exact), options, say)
    words = table.text(trials)
    print(words)
    (options.out / "speed_accuracy.txt").write_text(words + "\n")
    table.write_csv(trials, options.out / "speed_accuracy.csv")
    chart.draw(trials, options.out, on_gpu)
    return 0


def measure(cases: list[training.Case], options: argparse.Namespace, say: PlainReporter) -> list[Trial]:
    """Runs all trainings of the cases. Long ones start first, so that jobs side by side end together."""
    from gsac.benchmarks.speed_accuracy import novel_poses
    from gsac.benchmarks.speed_accuracy.trial import make_trial

    def one(case: training.Case, recipe: str, steps: int, seed: int, cores: list[int] | None) -> Trial:
        folder = options.out / "trainings" / f"{case.name}_{recipe}{steps}_{seed}"
        metrics = training.train(case, folder, cores, recipe=recipe, steps=steps, seed=seed, height=options.height, curve=CURVE,
                                 flip=True)
        if case.novel:
            metrics |= novel_poses.judge_poses(folder, case.novel, folder / "novel")
        say.note(f"{folder.name}: {metrics['psnr_fg']:.2f} dB after {metrics['cpu_seconds']:.1f} CPU s")
        return make_trial(case.name, metrics)

    calls = [(case, recipe, steps, seed) for recipe in sorted(options.recipes, reverse=True) for case in cases
             for steps in (options.budgets if recipe == "fast" else [options.paper_steps]) for seed in range(options.repeats)]
    trials = training.side_by_side(one, calls, options.jobs)
    return sorted(trials, key=lambda t: [c.name for c in cases].index(t.clip))

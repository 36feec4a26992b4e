"""gsac bench speed-accuracy: held-out quality against the seconds from clip to avatar, presets and the paper's recipe side by side.

The seconds are of all stages from split to export; judging is left out. On the CPU they are of all threads; where training runs on
a GPU they are by the clock, and only of trainings that had it alone. A stage before training that comes from the cache has the
seconds of when it ran.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from gsac.benchmarks import training
from gsac.benchmarks.speed_accuracy.trial import PAPER, WAYS, Trial
from gsac.pipeline.command_parser import CommandParser
from gsac.pipeline.journal import Journal, plain_journal
from gsac.pipeline.quality import QUALITIES, STANDARD

CURVE = 6
"""Judged checkpoints of a training with seed 0."""


def parser() -> CommandParser:
    out = CommandParser(prog="gsac bench speed-accuracy", description=(__doc__ or "").partition("\n")[0])
    training.declare(out, "speed-accuracy")
    out.add_argument("--ways", nargs="+", default=list(WAYS), choices=WAYS,
                     help="presets of --quality, or recipe paper (default: all)")
    out.add_argument("--device", default="cpu", choices=["cpu", "cuda"], help="where training runs (default: cpu)")
    out.add_argument("--repeats", type=int, default=3, metavar="N", help="trainings of each, with as many seeds (default: 3)")
    out.add_argument("--first", type=int, default=0, metavar="SEED", help="first of these seeds; only 0 has a curve (default: 0)")
    out.add_argument("--jobs", type=int, default=1, metavar="N",
                     help="trainings side by side, each on its share of the cores (default: 1)")
    out.add_argument("--novel", type=int, default=0, metavar="FRAMES",
                     help="also judge this many frames in novel poses against truth; rendered clips only (default: 0)")
    out.add_argument("--exact", action="store_true", help="also train rendered clips with their true poses")
    out.add_argument("--beside", type=Path, action="append", default=[], metavar="CSV",
                     help="speed_accuracy.csv of another device or machine, or of a part that ran on its own: told, drawn and "
                          "written with these; may be repeated; with --seeds and no number after it nothing else is measured")
    return out


def main(argv: list[str] | None = None) -> int:
    options = parser().parse_args(argv)
    from gsac.benchmarks.speed_accuracy import chart, table

    say = plain_journal()
    options.out.mkdir(parents=True, exist_ok=True)
    beside = [table.read_csv(path) for path in options.beside]
    trials = table.join(*beside, measure(options, say))
    table.write_csv(trials, options.out / "speed_accuracy.csv")
    words = table.text(trials)
    print(words)
    (options.out / "speed_accuracy.txt").write_text(words + "\n")
    chart.draw(trials, options.out)
    return 0


def measure(options: argparse.Namespace, say: Journal) -> list[Trial]:
    """Runs all trainings of the clips. What is finished is in speed_accuracy.csv, should the rest be stopped."""
    from gsac.benchmarks.speed_accuracy import novel_poses, table
    from gsac.benchmarks.speed_accuracy.trial import make_trial

    cases = {way: training.prepare_cases(options, say, options.novel, options.exact, way, settings_before(way, options.device))
             for way in dict.fromkeys(STANDARD if way == PAPER else way for way in options.ways)}
    trials: list[Trial] = []

    def one(case: training.Case, clip: str, way: str, seed: int, cores: list[int] | None) -> None:
        folder = options.out / "trainings" / f"{clip}_{way}_{options.device}_{seed}"
        values = train_values(way, options.device) | ({"height": options.height} if options.height else {})
        metrics = training.train(case, folder, cores, **values, device=options.device, seed=seed, curve=0 if seed else CURVE,
                                 flip=True)
        if case.novel:
            metrics |= novel_poses.judge_poses(folder, case.novel, folder / "novel")
        trial = make_trial(clip, way, metrics, case.before, training.export(case, folder, cores))
        if options.jobs > 1:
            trial.wall_s = None
        say.note(f"{folder.name}: {trial.psnr_fg:.2f} dB after {trial.cpu_s:.1f} CPU s")
        trials.append(trial)
        table.write_csv(trials, options.out / "speed_accuracy.csv")

    calls = [(case, plain.name, way, seed) for seed in range(options.first, options.first + options.repeats) for way in options.ways
             for case, plain in zip(cases[STANDARD if way == PAPER else way], next(iter(cases.values())), strict=True)]
    training.side_by_side(one, calls, options.jobs)
    names = [(clip, way) for way in options.ways for _, clip, its, _ in calls if its == way]
    return sorted(trials, key=lambda t: (names.index((t.clip, t.way)), t.seed))


def train_values(way: str, device: str) -> dict:
    """Parameters of `train` that a way sets."""
    return {"recipe": PAPER} if way == PAPER else dict(QUALITIES[way].on(device).get("train", {}))


def settings_before(way: str, device: str) -> tuple[str, ...]:
    """`stage.key=value` of what a preset sets for the stages before training."""
    return tuple(f"{stage}.{key}={value}" for stage, values in QUALITIES[way].on(device).items() if stage != "train"
                 for key, value in values.items())

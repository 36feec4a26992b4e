"""Avatars in strong poses that no clip shows, from afar and from near: `python -m gsac.benchmarks.strong_poses --seeds 101`.

Each person is rendered in a turn, which is trained on, and with elbows and knees bent by 100 degrees and more, arms up, waving and
hands on hips, once more from half the distance; every pose is moved onto its image before it is judged.
"""

from __future__ import annotations

import argparse

from gsac.benchmarks import training
from gsac.benchmarks.clip_runs import render_clip
from gsac.benchmarks.speed_accuracy.novel_poses import judge_poses
from gsac.pipeline.journal import plain_journal

DISTANCES = {"strong": 1.0, "near": 0.5}
"""Name of the pictures -> distance of their camera, as a factor."""
FIGURES = ("psnr_{}_aligned", "stray_{}", "holes_{}")
JUDGED = ("stray_alpha", "torn_alpha", "needle_share")


def main() -> None:
    """Prints a row for each clip as it is judged."""
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.strong_poses",
                                     description="Avatars in strong poses that no clip shows.")
    training.declare(parser, "strong-poses")
    parser.add_argument("--views", type=int, default=12, metavar="N", help="pictures from each distance (default: 12)")
    options, say = parser.parse_args(), plain_journal()
    if options.run:
        parser.error("--run has no truth in other poses; give --seeds")
    columns = [name.format(kind) for kind in DISTANCES for name in FIGURES]
    print("clip", "psnr_fg_ttpo", *columns, *JUDGED, sep=",")
    for seed, case in zip(options.seeds or [31], training.prepare_cases(options, say), strict=True):
        folder = options.out / "trainings" / case.name
        metrics = training.train(case, folder, height=options.height)
        for kind, distance in DISTANCES.items():
            clip = render_clip(training.clip_folder(options.out, f"seed{seed}_{kind}_{options.views}"), say, seed=seed,
                               frames=options.views, poses="strong", distance=distance)
            metrics |= judge_poses(folder, clip, folder / kind, name=kind)
        figures = (metrics[name] for name in ("psnr_fg_ttpo", *columns, *JUDGED))
        print(case.name, *("" if value is None else f"{value:.5g}" for value in figures), sep=",", flush=True)


if __name__ == "__main__":
    main()

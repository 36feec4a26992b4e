"""python -m gsac.benchmarks.gpu.people: both recipes on the GPU for many turntable people, judged also in novel poses.

The difference between people exceeds that between trainings of one person, so the recipes' difference is given as a mean over
people with its standard error. Clips are rendered and fitted unless they are kept, as for `gsac bench speed-accuracy`.
"""

from __future__ import annotations

import argparse
import csv

import numpy as np

from gsac.avatar.cuda import why_not
from gsac.benchmarks import training

FIGURES = {"psnr_fg": "held out, dB", "flip": "FLIP", "psnr_novel": "unseen poses, dB", "flip_novel": "FLIP",
           "psnr_novel_aligned": "moved onto the image, dB", "flip_novel_aligned": "FLIP"}
"""Metric -> heading."""
RECIPES = ("fast", "paper")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.gpu.people", description=__doc__.splitlines()[0])
    training.declare(parser, "gpu-people")
    parser.add_argument("--novel", type=int, default=12, metavar="FRAMES", help="frames in novel poses (default: 12)")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="trainings side by side (default: 1)")
    options = parser.parse_args()
    if why := why_not():
        raise SystemExit(f"benchmarks.gpu.people: {why}")
    from gsac.benchmarks.speed_accuracy.novel_poses import judge_poses
    from gsac.pipeline.journal import plain_journal

    def one(case: training.Case, recipe: str, cores: list[int] | None) -> dict:
        folder = options.out / "trainings" / f"{case.name}_{recipe}"
        metrics = training.train(case, folder, cores, recipe=recipe, device="cuda", height=options.height, flip=True)
        return metrics | (judge_poses(folder, case.novel, folder / "novel") if case.novel else {})

    cases = training.prepare_cases(options, plain_journal(), options.novel)
    calls = [(case, recipe) for case in cases for recipe in RECIPES]
    ends = training.side_by_side(one, calls, options.jobs)
    pairs = {case.name: tuple(ends[2 * k: 2 * k + 2]) for k, case in enumerate(cases)}
    print(text(pairs))
    with open(options.out / "people.csv", "w", newline="") as f:
        sheet = csv.writer(f)
        sheet.writerow(["clip", "recipe", "n_gaussians", "stray_alpha", "needle_share", *FIGURES])
        sheet.writerows([clip, recipe, *(end.get(name) for name in ("n_gaussians", "stray_alpha", "needle_share", *FIGURES))]
                        for clip, both in pairs.items() for recipe, end in zip(RECIPES, both, strict=True))


def text(pairs: dict[str, tuple[dict, dict]]) -> str:
    """Markdown table: a row for each clip with both recipes' metrics, and one with the mean difference and its standard error.

    pairs: clip -> metrics of `fast` and of `paper`.
    """
    known = [name for name in FIGURES if all(name in end for both in pairs.values() for end in both)]
    rows = [["clip", *(FIGURES[name] for name in known)], ["---"] * (1 + len(known))]
    for clip, (fast, paper) in pairs.items():
        rows.append([clip, *(f"{fast[n]:.{_digits(n)}f}, {paper[n]:.{_digits(n)}f}" for n in known)])
    apart = np.array([[fast[n] - paper[n] for n in known] for fast, paper in pairs.values()])
    error = apart.std(0, ddof=1) / np.sqrt(len(apart)) if len(apart) > 1 else np.full(len(known), np.nan)
    rows.append(["apart, mean", *(f"{mean:+.{_digits(n)}f} +- {e:.{_digits(n)}f}"
                                  for n, mean, e in zip(known, apart.mean(0), error, strict=True))])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _digits(name: str) -> int:
    return 3 if name.startswith("flip") else 2


if __name__ == "__main__":
    main()

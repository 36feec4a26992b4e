"""gsac bench size: held-out quality against the number of gaussians, with the automatic choice marked.

The line has all sizes that `train.gaussians: auto` tries; crosses are trainings with a fixed number from the start.
"""

from __future__ import annotations

import csv
from pathlib import Path

from gsac.benchmarks import training
from gsac.pipeline.command_parser import CommandParser

FIELDS = ("n_gaussians", "psnr_fg_mean", "psnr_fg_error", "detail_mean", "detail_error", "chosen")


def parser() -> CommandParser:
    out = CommandParser(prog="gsac bench size", description=(__doc__ or "").partition("\n")[0])
    training.declare(out, "size")
    out.add_argument("--scratch", type=int, nargs="*", default=[], metavar="N", help="also train these numbers from the start")
    out.add_argument("--steps", type=int, default=None, help="steps of a training (default: the recipe's)")
    return out


def main(argv: list[str] | None = None) -> int:
    options = parser().parse_args(argv)
    from gsac.benchmarks.size import chart
    from gsac.pipeline.journal import plain_journal

    say = plain_journal()
    options.out.mkdir(parents=True, exist_ok=True)
    curves: dict[str, list[dict]] = {}
    scratch: dict[str, list[tuple[int, float]]] = {}
    for case in training.prepare_cases(options, say):
        common = {"height": options.height, "steps": options.steps}
        folder = options.out / "trainings"
        curves[case.name] = training.train(case, folder / f"{case.name}_auto", gaussians="auto", every_size=True,
                                           **common)["size_curve"]
        scratch[case.name] = []
        for count in options.scratch:
            metrics = training.train(case, folder / f"{case.name}_{count}", gaussians=count, **common)
            scratch[case.name].append((count, metrics["psnr_fg_ttpo"]))
    words = text(curves)
    print(words)
    (options.out / "size.txt").write_text(words + "\n")
    write_csv(curves, options.out / "size.csv")
    chart.draw(curves, scratch, options.out)
    return 0


def text(curves: dict[str, list[dict]]) -> str:
    """The table, one row a clip and size; the choice has a star. curves: clip -> `size_curve` of metrics.json."""
    lines = [f"{'clip':>16}  gaussians  psnr_fg aligned   detail"]
    for clip, sizes in curves.items():
        lines += [f"{clip:>16}  {r['n_gaussians']:9d}  {r['psnr_fg_mean']:7.2f} +- {r['psnr_fg_error']:4.2f}  "
                  f"{r['detail_mean']:7.3f}{'  *' if r['chosen'] else ''}" for r in sizes]
    return "\n".join(lines)


def write_csv(curves: dict[str, list[dict]], path: Path) -> None:
    """Writes a row for each clip and size."""
    with open(path, "w", newline="") as f:
        sheet = csv.writer(f)
        sheet.writerow(["clip", *FIELDS])
        for clip, sizes in curves.items():
            sheet.writerows([clip, *(size[name] for name in FIELDS)] for size in sizes)

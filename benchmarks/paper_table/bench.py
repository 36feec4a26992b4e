"""gsac bench paper-table: training time, number of gaussians, PSNR, SSIM and LPIPS, with the paper's three ways to poses and ours.

In the truth clips a hand moves behind the back or in front of the belly; each row is the mean of trainings with several seeds. The
poses are the truth's, or fitted to detections that are left alone, filled as in the paper where its rule finds hands missing, or
filled as by default.
PSNR, SSIM and LPIPS are of whole held-out frames on black, LPIPS of images in 0..1, as published; the hands' PSNR is a column of
its own. LPIPS is a dash without its weights (`gsac models add`).
"""

from __future__ import annotations

from pathlib import Path

from gsac.benchmarks import training
from gsac.benchmarks.clip_runs import render_clip
from gsac.pipeline.command_parser import CommandParser

GIVEN = "poses given"
"""The row of the truth's body in place of the fitted one."""
FILLS = {GIVEN: (), "detections as they are": ("handgap.method=none",),
         "paper's fill": ("handgap.method=paper", "handgap.rule=paper"), "our fill": ()}
"""Row -> settings of the run up to the body fit."""
HIDDEN = ("left_front", "right_back")
"""The turntable's `hidden_hand` of even and of odd seeds, so that a part that runs on its own (`--beside`) has the same clips."""


def parser() -> CommandParser:
    out = CommandParser(prog="gsac bench paper-table", description=(__doc__ or "").partition("\n")[0])
    out.add_argument("--seeds", type=int, nargs="*", default=[41, 42], metavar="N", help="clips to render (default: 41 42)")
    out.add_argument("--frames", type=int, default=60, help="frames of a clip (default: 60)")
    out.add_argument("--recipe", default="fast", choices=["fast", "paper"], help="recipe of the trainings (default: fast)")
    out.add_argument("--device", default="cpu", choices=["cpu", "cuda"], help="where training runs (default: cpu)")
    out.add_argument("--repeats", type=int, default=5, metavar="N", help="trainings of each, with seeds 0 to N-1 (default: 5)")
    out.add_argument("--fills", nargs="+", default=list(FILLS), choices=FILLS, help="rows of each clip (default: all)")
    out.add_argument("--beside", type=Path, action="append", default=[], metavar="CSV",
                     help="paper_table.csv of a part that ran on its own, told and written with these rows; may be repeated; with "
                          "--seeds and no number after it nothing else is measured")
    out.add_argument("--steps", type=int, default=None, help="steps of a training (default: the recipe's)")
    out.add_argument("--height", type=int, default=None, help="px that are trained on (default: the frames' own)")
    out.add_argument("--out", type=Path, default=Path("bench-paper-table"), metavar="DIR", help="default: ./bench-paper-table")
    return out


def main(argv: list[str] | None = None) -> int:
    options = parser().parse_args(argv)
    from gsac.benchmarks.paper_table import table
    from gsac.pipeline.journal import plain_journal

    say = plain_journal()
    options.out.mkdir(parents=True, exist_ok=True)
    beside = [table.read_csv(path) for path in options.beside]
    rows: table.Rows = {}
    for seed in options.seeds:
        hidden = HIDDEN[seed % len(HIDDEN)]
        clip = render_clip(training.clip_folder(options.out, f"seed{seed}_{hidden}_{options.frames}"), say, seed=seed,
                           frames=options.frames, hidden_hand=hidden)
        for fill in options.fills:
            settings = FILLS[fill]
            case = training.fit_clip(options.out, clip, fill.replace(" ", "_").replace("'", "") if settings else "", say, settings)
            if fill == GIVEN:
                case = training.with_truth(case, clip, options.out)
            for repeat in range(options.repeats):
                folder = options.out / "trainings" / f"{case.name}_{repeat}"
                rows.setdefault((clip.name, fill), []).append(training.train(
                    case, folder, recipe=options.recipe, steps=options.steps, height=options.height, device=options.device,
                    seed=repeat))
                table.write_csv(rows, options.out / "paper_table.csv")
            say.note(f"{clip.name}, {fill}: {table.cells(rows[clip.name, fill])}")
    rows = table.join(*beside, rows, order=list(FILLS))
    table.write_csv(rows, options.out / "paper_table.csv")
    words = table.text(rows)
    print(words)
    (options.out / "paper_table.txt").write_text(words + "\n")
    return 0

"""gsac bench hidden-hand: people who hold a hand behind the back, how far off the arm is and its skin beside the mask.

A case is SEED:SIDE:FRAMES, a rendered person whose hand lies on the back for so many of 60 frames, until the person faces the
camera, or SEED, the same person's clean turn. The stages before `smplx` run once and are kept in the cache; the fit is made anew
each time.
"""

from __future__ import annotations

import csv
from pathlib import Path

from gsac.pipeline.command_parser import CommandParser

LOOKED_AT = ("41:left:17", "101:left:8", "102:right:24", "103:left:17", "201:left:24", "11:left:36", "302:right:24")
"""People by whom constants of the fit were set, or who were looked at for the causes of their errors."""
APART = ("301:left:8", "303:left:17", "304:left:24", "305:right:17", "306:left:8", "307:right:24")
"""People by whom nothing was set."""
CLEAN = ("201", "305")


def main(argv: list[str] | None = None) -> int:
    parser = CommandParser(prog="gsac bench hidden-hand", description="The fit's error of arms whose hand lies behind the back.")
    parser.add_argument("--cases", nargs="+", default=[*LOOKED_AT, *APART, *CLEAN], metavar="CASE",
                        help="SEED:SIDE:FRAMES, or SEED for a clean turn")
    parser.add_argument("--out", type=Path, default=Path("bench-hidden-hand"), metavar="DIR", help="default: ./bench-hidden-hand")
    parser.add_argument("--clips", type=Path, metavar="DIR", help="where rendered clips are kept (default: OUT/clips)")
    options = parser.parse_args(argv)
    from gsac.benchmarks.fit.clips import prepare_case
    from gsac.benchmarks.hidden_hand.cases import HiddenHand
    from gsac.benchmarks.hidden_hand.score import fit, measure
    from gsac.benchmarks.hidden_hand.table import text
    from gsac.cache.store import Store
    from gsac.pipeline.journal import plain_journal
    from gsac.stages.smplx.stage import run
    from gsac.stages.smplx.warmup import rehearse

    say = plain_journal()
    hands = [HiddenHand.parse(case) for case in options.cases]
    store = Store.open(say=say.note)
    rehearse(run)
    rows = []
    for hand in hands:
        folder = hand.render(options.clips or options.out / "clips", say)
        case = prepare_case(folder, store, options.out / "runs" / hand.name, say)
        body_file = options.out / "fits" / hand.name / "body.npz"
        rows.append(measure(hand, case, body_file, *fit(case, body_file)))
        say.note(text(rows[-1:]).splitlines()[1])
    with open(options.out / "hidden-hand.csv", "w", newline="") as f:
        sheet = csv.DictWriter(f, vars(rows[0]).keys())
        sheet.writeheader()
        sheet.writerows({name: round(value, 4) if isinstance(value, float) else value for name, value in vars(row).items()}
                        for row in rows)
    print(text(rows))
    return 0

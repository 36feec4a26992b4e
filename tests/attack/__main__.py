"""`make attack`: long versions of what `make test` tries in small, and a table of the trials."""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from support.toy import Toy

from .batches import kill_in_batches
from .kills import kill_at_calls, kill_at_random
from .subjects import FitBatch, FitRun, SmallRun, ToyBatch
from .tally import Tally, write_table


def _kill(how: Callable[..., Tally], subject: Callable, attack: str, trials: int, seed: int, end: float) -> Tally:
    with tempfile.TemporaryDirectory(prefix="gsac-attack-") as folder:
        return how(subject(Path(folder)), trials, seed, attack, end)


ATTACKS: dict[str, tuple[int, Callable[[int, int, float], Tally]]] = {
    "kill-toy": (1000, partial(_kill, kill_at_random, Toy, "SIGKILL of toy runs at random moments")),
    "kill-small": (200, partial(_kill, kill_at_random, SmallRun, "SIGKILL of whole runs, eight stages, at random moments")),
    "kill-fit": (1000, partial(_kill, kill_at_random, FitRun, "SIGKILL of runs of six stages, to the body fit, at random moments")),
    "batch-toy": (400, partial(_kill, kill_in_batches, ToyBatch, "SIGKILL in batches of three toy clips")),
    "batch-fit": (200, partial(_kill, kill_in_batches, FitBatch, "SIGKILL in batches of three clips, to the body fit")),
    "calls-toy": (200, partial(_kill, kill_at_calls, Toy, "SIGKILL of toy runs at single system calls")),
    "calls-small": (100, partial(_kill, kill_at_calls, SmallRun, "SIGKILL of whole runs at single system calls")),
}
"""Name -> trials unless told, and the attack: of trials, seed, and the time.monotonic at which it stops early."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m attack", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[*ATTACKS, []], metavar="NAME", help=f"default: all of {', '.join(ATTACKS)}")
    parser.add_argument("--trials", type=int, metavar="N", help="of each; default: " + ", ".join(
        f"{name} {trials}" for name, (trials, _) in ATTACKS.items()))
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.add_argument("--minutes", type=float, default=float("inf"), metavar="N", help="stop each after this time")
    arguments = parser.parse_args()
    tallies = []
    for name in arguments.names or ATTACKS:
        trials, attack = ATTACKS[name]
        tallies.append(attack(arguments.trials or trials, arguments.seed, time.monotonic() + 60 * arguments.minutes))
        for example in tallies[-1].examples:
            print(f"  {name}: {example}")
        print(f"  {name}: a process outlived its killed run by at most {tallies[-1].longest_s:.2f} s")
        print(write_table(tallies[-1:]), flush=True)
    print(write_table(tallies))
    raise SystemExit(any(tally.faults for tally in tallies))


if __name__ == "__main__":
    main()

"""gsac bench stability: faults put into truth clips at severities 1 to 5, what is left of the fit, and what failed without a word.

Each fault acts where it is born: on the person, the pictures, the points, the masks or the fit. Both methods get the same input.
A seed is a clip and a place of the fault in it: seed k takes the k-th clip. What is finished is in OUT/trials.jsonl; the same
command goes on from there.
"""

from __future__ import annotations

import argparse
import json
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from gsac.pipeline.command_parser import CommandParser

if TYPE_CHECKING:
    from gsac.benchmarks.stability.fault import Fault
    from gsac.benchmarks.stability.trial import Task
    from gsac.pipeline.journal import Journal

TINY = {"frames": 8, "height": 320}
"""Of the clip of --quick."""
CPU_SECONDS = {"default": 0.3, "paper": 1.7}
"""Method -> CPU seconds of one frame of a trial, 20 frames of 480 px, mean of a few faults."""


def parser() -> CommandParser:
    from gsac.benchmarks.stability.faults import FAULTS
    from gsac.benchmarks.stability.trial import DEFAULT, METHODS

    out = CommandParser(prog="gsac bench stability", description=(__doc__ or "").partition("\n")[0])
    out.add_argument("--fault", nargs="+", default=None, choices=list(FAULTS), metavar="NAME", help=f"of {', '.join(FAULTS)}")
    out.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2], metavar="N", help="default: 0 1 2")
    out.add_argument("--severities", type=int, nargs="+", default=None, choices=range(1, 6), metavar="N", help="default: 1 to 5")
    out.add_argument("--methods", nargs="+", default=None, choices=list(METHODS),
                     help=f"default: all, {DEFAULT} first; --quick: {DEFAULT}")
    out.add_argument("--until", default="smplx", choices=["smplx", "train"], help="train: also a short training (default: smplx)")
    out.add_argument("--clip", type=Path, action="append", default=[], metavar="DIR",
                     help="a truth clip: a folder with clip.mp4, mask/ and truth.npz; may be repeated (default: seeds 31 to 33); "
                          "faults of the person need the seed that it was rendered with, and a name seedN that tells it")
    out.add_argument("--frames", type=int, default=30, help="kept of each clip, evenly (default: 30)")
    out.add_argument("--kept", type=int, default=None, metavar="N",
                     help="that the run keeps of those frames, and `gsac check` then its own number, as of clips that people film "
                          "(default: all, and check looks at the same)")
    out.add_argument("--height", type=int, default=640, help="px (default: 640)")
    out.add_argument("--jobs", type=int, default=1, metavar="N", help="trials side by side (default: 1)")
    out.add_argument("--limit", type=float, default=600, metavar="S", help="seconds after which a trial hangs (default: 600)")
    out.add_argument("--until-s", type=float, default=None, metavar="S", help="begin no trial after so many seconds")
    out.add_argument("--dry-run", action="store_true", help="only say how many trials there are and what they may take")
    out.add_argument("--quick", action="store_true", help="a few faults at severity 3 on a tiny clip")
    out.add_argument("--out", type=Path, default=Path("bench-stability"), metavar="DIR", help="default: ./bench-stability")
    return out


def main(argv: list[str] | None = None) -> int:
    options = parser().parse_args(argv)
    from gsac.benchmarks.stability import chart, table
    from gsac.benchmarks.stability.outcome import draw_curves, find_outcomes
    from gsac.benchmarks.stability.pairs import describe_pairs, find_pairs
    from gsac.benchmarks.stability.trial import hash_results
    from gsac.pipeline.journal import plain_journal

    say = plain_journal()
    options.out.mkdir(parents=True, exist_ok=True)
    keep_settings(options)
    lines = options.out / "trials.jsonl"
    tasks = list_open(options, lines, say)
    say.note(forecast(tasks, options.jobs))
    if options.dry_run:
        return 0
    measure(options, tasks, lines, say)
    trials = [t for t in table.read_lines(lines) if t.code == hash_results(options.until)]
    outcomes = find_outcomes(trials)
    curves, compared = draw_curves(outcomes), describe_pairs(find_pairs(trials))
    if not curves:
        say.note("no trial with a fault was finished")
        return 0
    table.write_csv(outcomes, options.out / "stability.csv")
    words = table.text(curves, compared)
    print(words)
    (options.out / "stability.txt").write_text(words + "\n")
    (options.out / "stability.md").write_text(table.markdown(curves, compared))
    chart.draw(curves, options.out)
    return 0


def keep_settings(options: argparse.Namespace) -> None:
    """Notes in OUT/settings.json what its trials share. Raises BadInput where OUT holds trials of other settings."""
    from gsac.stages.contract import BadInput

    path = options.out / "settings.json"
    own = {name: getattr(options, name) for name in ("frames", "kept", "height", "until", "quick")}
    if path.is_file() and (kept := {"kept": None} | json.loads(path.read_text())) != own:
        raise BadInput(f"{options.out} holds trials of other settings ({kept}, not {own}); give another --out")
    path.write_text(json.dumps(own) + "\n")


def list_open(options: argparse.Namespace, lines: Path, say: Journal) -> list[Task]:
    """Tasks that the file of lines has no trial of by today's code."""
    from gsac.benchmarks.stability import table
    from gsac.benchmarks.stability.trial import hash_results

    kept, code = table.read_lines(lines), hash_results(options.until)
    done = {(t.clip, t.fault, t.severity, t.seed, t.method) for t in kept if t.code == code}
    if others := sum(t.code != code for t in kept):
        say.note(f"{lines} holds {others} trials of other code; they do not count, and run again where they are asked for")
    return [t for t in list_tasks(options, say) if (t.clip.name, t.fault, t.severity, t.seed, t.method) not in done]


def forecast(tasks: list[Task], jobs: int) -> str:
    """A sentence: how many trials, and the minutes that they may take."""
    minutes = sum(CPU_SECONDS[t.method] * t.frames for t in tasks) / 60
    return f"{len(tasks)} trials, about {minutes:.0f} CPU minutes, {minutes / max(1, jobs):.0f} with {jobs} side by side"


def measure(options: argparse.Namespace, tasks: list[Task], lines: Path, say: Journal) -> None:
    """Runs the tasks and appends each to the file of lines as it ends."""
    from gsac.benchmarks.stability import table, workers
    from gsac.benchmarks.stability.trial import Trial

    lock = threading.Lock()

    def tell(trial: Trial) -> None:
        with lock:
            table.add_line(trial, lines)
            figure = "-" if trial.mean_mm is None else f"{trial.mean_mm:.0f} mm"
            say.note(f"{trial.clip} {trial.fault} {trial.severity} {trial.method}: {trial.end} {trial.message} {figure}, "
                     f"{trial.seconds:.0f} s, {trial.cpu_seconds:.0f} CPU s")

    workers.run_all(tasks, options.jobs, options.limit, tell, options.until_s)


def list_tasks(options: argparse.Namespace, say: Journal) -> list[Task]:
    """Tasks in the order in which they should be done: methods, clean clips before faults, severities 3, 5, 1, 4, 2, then seeds.

    So a sweep that ends early has all persons at the severities that it came to.
    """
    from gsac.benchmarks.clip_runs import render_clip
    from gsac.benchmarks.stability.fault import Origin
    from gsac.benchmarks.stability.faults import FAULTS, QUICK
    from gsac.benchmarks.stability.trial import CLEAN, DEFAULT, METHODS, Task

    quick = options.quick
    faults = [FAULTS[name] for name in options.fault or (QUICK if quick else FAULTS)]
    if options.until != "train":
        faults = [fault for fault in faults if fault.origin is not Origin.BODY]
    if options.clip:
        clips = options.clip
    elif quick:
        from gsac.turntable.clip import make_clip
        from gsac.turntable.options import TurntableOptions

        clips = [options.out / "clips" / "seed31"]
        if not (clips[0] / "truth.npz").is_file():
            make_clip(clips[0], TurntableOptions(seed=31, supersample=1, frames=TINY["frames"], height=TINY["height"]))
    else:
        clips = [render_clip(options.out / "clips" / f"seed{seed}", say, seed=seed) for seed in (31, 32, 33)]
    seeds = [0] if quick else options.seeds
    severities = [s for s in (3, 5, 1, 4, 2) if s in (options.severities or ([3] if quick else range(1, 6)))]
    sizes = TINY if quick else {"frames": options.frames, "height": options.height}

    seedless = find_seedless(faults, clips, options.fault or [], say)

    def task(fault: str, severity: int, seed: int, method: str) -> Task:
        return Task(clips[seed % len(clips)].resolve(), fault, severity, seed, method, options.out.resolve(), **sizes,
                    until=options.until, kept=options.kept)

    return [each for method in options.methods or ([DEFAULT] if quick else METHODS)
            for each in ([task(CLEAN, 0, seed, method) for seed in seeds[:len(clips)]]
                         + [task(f.name, severity, seed, method) for severity in severities for seed in seeds for f in faults
                            if f.origin is not Origin.PERSON or clips[seed % len(clips)] not in seedless])]


def find_seedless(faults: list[Fault], clips: list[Path], asked: list[str], say: Journal) -> list[Path]:
    """Clips whose person cannot be rendered anew, since their names tell no seed; says which of the faults they are spared.

    asked: faults that the user named. Raises BadInput where one of them needs the seed.
    """
    from gsac.benchmarks.stability.fault import Origin
    from gsac.benchmarks.stability.trial import seed_of
    from gsac.stages.contract import BadInput

    seedless = [clip for clip in clips if seed_of(clip.resolve()) is None]
    anew = [fault.name for fault in faults if fault.origin is Origin.PERSON]
    if not seedless or not anew:
        return seedless
    why = "their person is rendered anew with the clip's seed, and only a folder named seedN tells it"
    folders = ", ".join(map(str, seedless))
    if named := [name for name in anew if name in asked]:
        raise BadInput(f"{folders}: no clip for {', '.join(named)}: {why}")
    say.note(f"{folders}: {', '.join(anew)} left out: {why}")
    return seedless

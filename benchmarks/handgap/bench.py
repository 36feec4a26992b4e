"""gsac bench handgap: errors of finding and filling hidden hands, against the truth of turning bodies.

Bodies and motion are the turntable's, with sway and arm swing; nothing is rendered. A detector's errors are added: white noise, and
a systematic error that depends on the yaw, both as large as measured on rendered clips. Windows are masked inside the clip and at
its ends, and every method fills the same windows. --runs does the same with real detections: RUN is a run's folder
(keypoints/keypoints.npz), TRUTH the clip's truth.npz.
"""

from __future__ import annotations

from pathlib import Path

from gsac.pipeline.command_parser import CommandParser

SEEDS = (1, 2, 3, 4, 5)


def main(argv: list[str] | None = None) -> int:
    parser = CommandParser(prog="gsac bench handgap", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("bench-handgap"), metavar="DIR", help="default: ./bench-handgap")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    parser.add_argument("--runs", type=Path, nargs="*", default=[], metavar="RUN TRUTH", help="real detections, by pairs")
    options = parser.parse_args(argv)
    from gsac.benchmarks.handgap.clips import make_turning_body, read_detections
    from gsac.benchmarks.handgap.failures import find_own_failures, measure_detection
    from gsac.benchmarks.handgap.gaps import measure, summarise
    from gsac.benchmarks.handgap.table import draw, text, write_csv

    options.out.mkdir(parents=True, exist_ok=True)
    sources = {"bodies": {f"seed {s}": make_turning_body(s) for s in options.seeds}}
    if options.runs:
        sources["detections"] = {str(r): read_detections(r, t) for r, t in zip(options.runs[::2], options.runs[1::2], strict=True)}
    for name, clips in sources.items():
        rows = summarise(measure(clips))
        write_csv(rows, options.out / f"handgap-{name}.csv")
        draw(rows, options.out / f"handgap-{name}.png")
        print(text(rows, name))
    found = measure_detection(sources["bodies"]) + measure_detection(sources.get("detections", {}), find_own_failures)
    write_csv(found, options.out / "handgap-found.csv")
    for row in found:
        print(f"{row['failure']:38} recall {row['recall']:.3f} of {row['wrong']:4d}   false alarms {row['false_alarms']:.4f}")
    return 0

"""`python -m gsac.benchmarks.verdict RUN...`: the figures that the verdict goes by, a JSON row a run, for docs/lab/verdict.json."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from gsac.pipeline.report.pictures import RunPictures
from gsac.pipeline.report.results import Results
from gsac.pipeline.report.sheets import alpha_sheet
from gsac.pipeline.report.verdict import NAMES, give_verdict

FACTS = ("brightness", "sharpness")
FIGURES = ("likeness", "seen_area", "stray_alpha", "torn_alpha")


def row_of(run: Path) -> dict[str, Any]:
    """Figures of a run's folder and the verdict as it stands, to be set right by eye."""
    results = Results(run)
    metrics = {name: results.metrics.get(name) for name in FIGURES}
    facts = {name: value for name, value in alpha_sheet(RunPictures(results)).facts.items() if name in FACTS}
    given = give_verdict(metrics, facts)
    told = {part: next(p.grade.word for p in given.parts if p.name == name) for part, name in NAMES.items()}
    judged = {"whole": given.grade.word} | told
    return {"set": "unseen", "what": run.name, "seen_by_eye": "", "judged": judged, "facts": facts, "metrics": metrics}


def main(runs: list[str]) -> None:
    """Prints a row of each run."""
    for run in runs:
        print(json.dumps(row_of(Path(run)), ensure_ascii=False))


if __name__ == "__main__":
    main(sys.argv[1:])

"""Reads a run's folder: its results, or why one is absent."""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Any

from gsac.pipeline.graph import CLIP, Graph
from gsac.pipeline.outcomes import Outcome
from gsac.pipeline.project import Project
from gsac.pipeline.rows import Row, read_json, result_row, rows_of, timings_of
from gsac.pipeline.run_folder import DAG, RUN
from gsac.pipeline.timings import add_timings
from gsac.stages.contract import StageError


class AbsentError(Exception):
    """A section's result is not there; the message is the sentence shown instead."""


class Results:
    """The folder of one run; any file in it may be missing, torn or of an earlier run."""

    def __init__(self, root: Path):
        self.root = Path(root).absolute()
        run = read_json(self.root / RUN)
        self.has_run = isinstance(run, dict)
        self.run: dict[str, Any] = run if isinstance(run, dict) else {}
        self.rows = rows_of(run)

    @cached_property
    def project(self) -> Project:
        """The stages at hand, joined as the folder's own dvc.yaml says where it has one."""
        at_hand = Project.at_hand()
        try:
            return Project(at_hand.package, self.root / DAG) if (self.root / DAG).is_file() else at_hand
        except StageError:
            return at_hand

    @cached_property
    def order(self) -> list[str]:
        """Names of all stages, first to last."""
        try:
            graph: Graph = self.project.graph
            return [*graph.steps, *(name for name in self.rows if name not in graph.steps)]
        except StageError:
            return list(self.rows)

    @cached_property
    def ports(self) -> dict[str, tuple[str, ...]]:
        """Stage -> ports of its outputs; {} where the folder's dvc.yaml cannot be read."""
        try:
            return {name: step.outs for name, step in self.project.graph.steps.items()}
        except StageError:
            return {}

    @cached_property
    def failed(self) -> tuple[str, str] | None:
        """Stage and its error, where the run failed."""
        for name, row in self.rows.items():
            if row.get("status") == Outcome.FAILED.value:
                return name, str(row.get("error") or "no reason is recorded")
        return None

    @cached_property
    def clip_name(self) -> str:
        """File or folder name of the source, without its path, which a report must not give away."""
        named = str(self.run.get("clip") or "")
        link = self.root / CLIP
        return Path(named).name or (link.resolve().name if link.exists() else "") or self.root.name

    @cached_property
    def metrics(self) -> dict[str, Any]:
        """metrics.json of train, with the timings of its run. AbsentError where there is none."""
        path = self.path("train/metrics.json")
        content = read_json(path)
        if not isinstance(content, dict):
            raise AbsentError(f"{path.name} of train cannot be read.")
        return add_timings(content, timings_of(self.rows.get("train")))

    def done(self, stage: str) -> bool:
        """Whether there is a result of the stage, of the last run or an earlier one; without run.json it counts as done."""
        return not self.has_run or self.result(stage) is not None

    def result(self, stage: str) -> Row | None:
        """The row of the stage's result, which is an earlier one where the stage failed in the last run."""
        return result_row(self.rows.get(stage))

    def holds(self, stage: str) -> bool:
        """Whether the stage's result is recorded and its files are there."""
        ports = self.ports.get(stage, ())
        return self.result(stage) is not None and bool(ports) and all((self.root / port).exists() for port in ports)

    def caveat(self, stage: str) -> str:
        """What is to be known of a result that is not of the last run, or not made from what lies in the folder; else empty."""
        row, result = self.rows.get(stage), self.result(stage)
        if row is None or result is None:
            return ""
        words = [f"Stage {stage} failed in the last run: this is an earlier result."] if row is not result else []
        if result.get("stale"):
            words.append(f"This result was {result.get('stale_reason')}.")
        return " ".join(words)

    def path(self, port: str) -> Path:
        """File or folder of a port that this run made; without run.json whatever lies there. AbsentError says why not."""
        stage = port.partition("/")[0]
        path = self.root / port
        if self.failed and self.failed[0] == stage and not self.done(stage):
            raise AbsentError(f"Stage {stage} failed: {self.failed[1]}")
        if not self.done(stage):
            why = f"not reached: stage {self.failed[0]} failed" if self.failed else "not part of this run"
            earlier = " What lies in its folder is of an earlier run and is not shown." if path.exists() else ""
            raise AbsentError(f"Stage {stage} was {why}.{earlier}")
        if not path.exists():
            raise AbsentError(f"{port} is absent from the run's folder.")
        return path

    def size(self, stage: str) -> int | None:
        """Bytes of a stage's outputs on disk; None where there are none of this run."""
        folder = self.root / stage
        if not (self.done(stage) and folder.is_dir()):
            return None
        return sum(tree_size(entry) for entry in folder.iterdir())


def tree_size(path: Path) -> int:
    """Bytes of a file or folder, the first link followed; 0 for a dead link."""
    path = path.resolve()
    if path.is_dir():
        return sum(p.lstat().st_size for p in path.rglob("*") if p.is_file())
    return path.stat().st_size if path.exists() else 0


def number(value: Any) -> float | None:
    """A finite number, or None."""
    usable = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    return float(value) if usable else None

"""The stages at hand: a package of stage folders and the dvc.yaml that joins them."""

from __future__ import annotations

import importlib
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from gsac.pipeline.graph import Graph, Step
from gsac.stages.contract import BadInput, Stage

OWN_STAGES = "GSAC_STAGES"
"""Environment variable: a package below `gsac` with a dvc.yaml beside its `__init__.py`, instead of `gsac.stages`."""


@dataclass(frozen=True)
class Project:
    """package: holds `<stage>/__init__.py` with STAGE and `<stage>/stage.py` with run; dag: the dvc.yaml."""

    package: str
    dag: Path

    @classmethod
    def at_hand(cls) -> Project:
        """gsac's own stages, or those that GSAC_STAGES names."""
        package = os.environ.get(OWN_STAGES)
        if not package:
            return cls("gsac.stages", shipped_dag())
        try:
            module = importlib.import_module(package)
        except ImportError as e:
            raise BadInput(f"{OWN_STAGES}={package}: cannot be imported ({e})") from e
        return cls(package, Path(module.__path__[0]) / "dvc.yaml")

    @cached_property
    def graph(self) -> Graph:
        return Graph.load(self.dag)

    def stage(self, name: str) -> Stage:
        """The stage's declaration; BadInput where it and dvc.yaml disagree."""
        step = self.graph.step(name)
        try:
            stage = importlib.import_module(f"{self.package}.{name}").STAGE
        except (ImportError, AttributeError) as e:
            raise BadInput(f"stage {name} of {self.dag} has no declaration in {self.package}.{name} ({e})") from e
        check_agreement(step, stage)
        return stage

    def outputs(self, name: str) -> tuple[str, ...]:
        """Relative paths of the outputs that a stage declares."""
        return tuple(output.path for output in self.stage(name).outputs)

    def entry(self, name: str) -> str:
        """Module whose `run` does the work."""
        return f"{self.package}.{name}.stage"


def check_agreement(step: Step, stage: Stage) -> None:
    """BadInput where dvc.yaml and STAGE name different ports."""
    outs = {f"{stage.name}/{output.path}" for output in stage.outputs}
    for what, declared, listed in (
        ("name", {stage.name}, {step.name}),
        ("inputs", set(stage.inputs), set(step.deps)),
        ("outputs", outs, set(step.outs)),
    ):
        if declared != listed:
            raise BadInput(
                f"stage {step.name}: its {what} are {', '.join(sorted(declared))} in its module, "
                f"but {', '.join(sorted(listed))} in dvc.yaml"
            )


def shipped_dag() -> Path:
    """dvc.yaml of the checkout; in an installed wheel the copy beside this file."""
    here = Path(__file__).resolve().parent
    checkout = here.parent / "dvc.yaml"
    return checkout if checkout.is_file() else here / "dvc.yaml"

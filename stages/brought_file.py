"""Reads a model file that a parameter names, as the user brought it; an error names the parameter and the file's fault."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from gsac.stages.contract import BadInput, Job

Content = TypeVar("Content")
NONE = "none"
"""The word for no file, where a parameter may name one."""


def read_brought(job: Job, stage: str, parameter: str, reader: Callable[[Path], Content]) -> Content:
    """What the reader makes of the file that `stage.parameter` names. Raises BadInput."""
    from gsac.avatar.artifacts import ArtifactError

    name = getattr(job.config, parameter)
    try:
        return reader(job.models[name])
    except ArtifactError as error:
        raise BadInput(f"{stage}.{parameter} is {name}: {error}") from error

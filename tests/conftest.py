"""Fixtures that tests of several packages share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from support.axe import axe  # noqa: F401
from support.figure import exported, figure, node_package, person, shadowed  # noqa: F401
from support.official_body import bent_arm, official_body  # noqa: F401
from support.toy import Toy

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Threads of small matrices wait for each other where the machine is busy; the stages allow themselves one as well."""


@pytest.fixture
def toy(tmp_path: Path) -> Toy:
    return Toy(tmp_path)


EVERYTHING = ["cut", "left", "right", "join"]


@pytest.fixture
def everything() -> list[str]:
    """All stages of the toy project, in running order."""
    return list(EVERYTHING)

"""Real DVC in a folder."""

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest


class Dvc:
    """DVC in a workspace; the test skips where it is not installed."""

    def __init__(self, folder: Path, env: Mapping[str, str]):
        pytest.importorskip("dvc", reason="DVC is not installed (pip install 'gsac[dev]')")
        self.folder, self.env = folder, env
        self("init", "--no-scm", "-q")

    def __call__(self, *arguments: str) -> str:
        done = subprocess.run([sys.executable, "-m", "dvc", *arguments], cwd=self.folder, env=self.env, text=True,
                              capture_output=True, timeout=300)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    @property
    def is_clean(self) -> bool:
        return "up to date" in self("status")

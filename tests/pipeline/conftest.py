"""Commands on a toy project in this process: a Python that starts for each would take most of a test's time."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from gsac.pipeline.cli import execute
from gsac.pipeline.sharing import results_at
from support.toy import Done, Toy


@pytest.fixture
def inside(monkeypatch, capsys) -> Callable[..., Done]:
    """inside(toy, *words, **env): `gsac` with these words in the toy's folder."""

    def call(toy: Toy, *words: object, **env: str) -> Done:
        with monkeypatch.context() as patch, toy.importable():
            for name in ("GSAC_STAGES", "GSAC_CACHE", "TOY_RUNS"):
                patch.setenv(name, toy.env[name])
            for name, value in env.items():
                patch.setenv(name, value)
            patch.chdir(toy.root)
            results_at.cache_clear()
            capsys.readouterr()
            code = execute([str(word) for word in words])
        said = capsys.readouterr()
        return Done(int(code), said.out, said.err)

    return call

"""A server in this process, and clients of it that lose patience soon."""

from __future__ import annotations

import pytest

from gsac.cache.remote import bucket as bucket_module
from gsac.cache.store import Store
from support.s3 import serving


@pytest.fixture
def server(monkeypatch):
    """An S3 server with an empty bucket, named by the environment."""
    pytest.importorskip("obstore")
    for name, seconds in (("CONNECT_S", 1.0), ("SMALL_S", 1.0), ("LARGE_S", 1.0), ("RETRIES", 1)):
        monkeypatch.setattr(bucket_module, name, seconds)
    with serving() as held:
        for name, value in held.env.items():
            monkeypatch.setenv(name, value)
        yield held


@pytest.fixture
def shared(server):
    """shared(): the server's results, as a machine sees them that knows nothing yet."""
    from gsac.cache.remote.results import Results

    return lambda: Results(bucket_module.Bucket("s3://bucket/prefix"))


@pytest.fixture
def elsewhere(tmp_path):
    """elsewhere(name): the store of another machine, and what it has said."""

    def make_store(name: str = "elsewhere") -> tuple[Store, list[str]]:
        said: list[str] = []
        return Store(tmp_path / name, said.append), said

    return make_store

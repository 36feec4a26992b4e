"""Where the store lies when nobody says otherwise."""

from pathlib import Path

import pytest

from gsac.avatar.cuda import kernels
from gsac.cache.root import default_root


@pytest.mark.parametrize("named", ["", "~/elsewhere", "relative", "/absolute"])
def test_the_gpus_kernels_are_kept_below_the_root_of_the_store(monkeypatch, named):
    monkeypatch.setenv("GSAC_CACHE", named)
    assert kernels.folder() == default_root() / "kernels"


def test_the_root_is_gsac_cache_or_a_folder_in_the_users_home(monkeypatch):
    monkeypatch.setenv("GSAC_CACHE", "~/elsewhere")
    assert default_root() == Path.home() / "elsewhere"
    monkeypatch.delenv("GSAC_CACHE")
    assert default_root() == Path.home() / ".cache" / "gsac"

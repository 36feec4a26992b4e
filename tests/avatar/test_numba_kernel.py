"""numba's disk cache must not outlive the code it was made from."""

from __future__ import annotations

from pathlib import Path

import pytest

from gsac.avatar import numba_kernel
from gsac.avatar.raster import forward


def test_every_file_that_has_kernels_or_is_used_by_them_is_in_the_digest():
    folder = Path(numba_kernel.__file__).parent
    using = {p.relative_to(folder).as_posix() for p in folder.rglob("*.py") if "avatar.numba_kernel import" in p.read_text()}
    assert using <= set(numba_kernel.SOURCES)
    assert {"draw_rule.py", "simd.py", "raster/forward.py", "raster/backward.py"} <= set(numba_kernel.SOURCES)


@pytest.mark.parametrize("name", numba_kernel.SOURCES)
def test_an_edit_of_any_kernel_file_gives_another_digest(tmp_path, name):
    folder = Path(numba_kernel.__file__).parent
    (tmp_path / "raster").mkdir()
    for source in numba_kernel.SOURCES:
        (tmp_path / source).write_bytes((folder / source).read_bytes())
    assert numba_kernel.digest(tmp_path) == numba_kernel.DIGEST
    (tmp_path / name).write_bytes((folder / name).read_bytes() + b"\n")
    assert numba_kernel.digest(tmp_path) != numba_kernel.DIGEST


def test_the_digest_is_part_of_a_kernels_name_in_the_cache():
    assert numba_kernel.DIGEST in forward.composite.py_func.__qualname__

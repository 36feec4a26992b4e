"""numba's disk cache must not outlive the code it was made from."""

from __future__ import annotations

from pathlib import Path

import pytest

from gsac.avatar import kernel
from gsac.avatar.raster import forward


def test_every_file_that_has_kernels_or_is_used_by_them_is_in_the_digest():
    folder = Path(kernel.__file__).parent
    using = {p.relative_to(folder).as_posix() for p in folder.rglob("*.py") if "avatar.kernel import" in p.read_text()}
    assert using <= set(kernel.SOURCES)
    assert {"blend.py", "simd.py", "raster/forward.py", "raster/backward.py"} <= set(kernel.SOURCES)


@pytest.mark.parametrize("name", kernel.SOURCES)
def test_an_edit_of_any_kernel_file_gives_another_digest(tmp_path, name):
    folder = Path(kernel.__file__).parent
    (tmp_path / "raster").mkdir()
    for source in kernel.SOURCES:
        (tmp_path / source).write_bytes((folder / source).read_bytes())
    assert kernel.digest(tmp_path) == kernel.DIGEST
    (tmp_path / name).write_bytes((folder / name).read_bytes() + b"\n")
    assert kernel.digest(tmp_path) != kernel.DIGEST


def test_the_digest_is_part_of_a_kernels_name_in_the_cache():
    assert kernel.DIGEST in forward.composite.py_func.__qualname__

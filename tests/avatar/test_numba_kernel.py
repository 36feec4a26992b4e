"""numba's disk cache must not outlive the code it was made from."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from gsac.avatar import numba_kernel
from gsac.avatar.raster import forward


def test_every_file_that_has_kernels_or_is_used_by_them_is_in_the_digest():
    folder = Path(numba_kernel.__file__).parent
    using = {p.relative_to(folder).as_posix() for p in folder.rglob("*.py") if "avatar.numba_kernel import kernel" in p.read_text()}
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


def own_kernels() -> list[Path]:
    """Files of ours with kernels that take nothing from other files."""
    root = Path(numba_kernel.__file__).parents[1]
    return [file for package in ("avatar", "stages", "turntable") for file in (root / package).rglob("*.py")
            if "import own_kernel" in file.read_text()]


@pytest.mark.parametrize("file", own_kernels(), ids=lambda file: file.stem)
def test_a_kernel_that_bears_the_digest_of_its_file_alone_takes_nothing_from_another(file):
    tree = ast.parse(file.read_text())
    others = {alias.asname or alias.name for node in tree.body if isinstance(node, ast.ImportFrom)
              and str(node.module).startswith("gsac.") for alias in node.names}
    kernels = [node for node in tree.body if isinstance(node, ast.FunctionDef)
               and any("own_kernel" in ast.unparse(decorator) for decorator in node.decorator_list)]
    assert kernels
    for node in kernels:
        assert not others & {name.id for line in node.body for name in ast.walk(line) if isinstance(name, ast.Name)}, node.name


def test_an_edit_that_keeps_size_and_time_never_runs_the_old_kernel(tmp_path):
    module = tmp_path / "numbers_of_ours.py"
    module.write_text("from gsac.avatar.numba_kernel import own_kernel\n\n\n@own_kernel()\ndef answer():\n    return 41\n")
    stat = module.stat()
    command = [sys.executable, "-c", "from numbers_of_ours import answer; print(answer())"]
    env = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]),
                        "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    for text, answer in (("41", "41"), ("42", "42")):
        module.write_text(module.read_text().replace("41", text))
        os.utime(module, ns=(stat.st_atime_ns, stat.st_mtime_ns))
        assert subprocess.run(command, env=env, capture_output=True, text=True, check=True).stdout.strip() == answer

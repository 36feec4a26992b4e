"""Guards that notice when the inner loops lose their SIMD instructions or slip into double precision."""

from __future__ import annotations

import platform
import re

import numba
import numpy as np
import pytest
from llvmlite import binding as llvm

from gsac.avatar import raster
from gsac.avatar.raster import backward, forward, project

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64") or not llvm.get_host_cpu_features().get("fma"),
                       reason="reads x86 assembly with FMA"),
]


@pytest.fixture
def assembly(make_scene):
    """Assembly of a kernel's float32 version, freshly compiled: what comes from numba's cache cannot be read."""
    scene = make_scene(5, 16, 16, 0)
    rendering = raster.render(*(a.astype(np.float32) for a in scene.arguments), scene.camera, low_pass=scene.low_pass)
    raster.render_backward(rendering.state, scene.grad_rgb, scene.grad_alpha)

    def compile_fresh(kernel) -> str:
        single = [s for s in kernel.nopython_signatures if "float64" not in str(s)]
        assert single, "production uses a version without any float64 argument"
        fresh = numba.njit(**{k: v for k, v in kernel.targetoptions.items() if k in ("nogil", "fastmath", "error_model")})(
            kernel.py_func)
        fresh.compile(single[0].args)
        return next(iter(fresh.inspect_asm().values()))

    return compile_fresh


LANES = {"z": 16, "y": 8, "x": 4}
"""Of a zmm, ymm and xmm register: processors with wider ones need fewer instructions for the same work."""


@pytest.mark.parametrize(("kernel", "least"), [(forward.composite, 160), (backward.composite_backward, 240)])
def test_compositing_is_packed_single_precision_arithmetic(assembly, kernel, least):
    asm = assembly(kernel)
    packed = sum(LANES[register] for register in re.findall(r"vfn?m(?:add|sub)\d+ps\s.*?%([xyz])mm", asm))
    assert packed >= least, f"packed fused multiply-adds of {packed} lanes"
    assert not re.search(r"\b(?:call|jmp)\S*\s+\S*expf?\b", asm), "exp is a polynomial, not a call"
    assert not re.search(r"vfn?m(?:add|sub)\d+[ps]d\s|v(?:mul|add|sub|div|sqrt)[ps]d\s", asm), "double precision"


@pytest.mark.parametrize("kernel", [project.project, project.project_backward])
def test_projection_stays_in_single_precision(assembly, kernel):
    assert not re.search(r"vfn?m(?:add|sub)\d+[ps]d\s|v(?:mul|add|sub|div|sqrt)[ps]d\s", assembly(kernel))

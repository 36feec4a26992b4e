"""The kernels' source and machine code: compiled by NVRTC for the GPU at hand, cached by source and architecture."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path

from gsac.avatar.cuda.structs import declarations
from gsac.avatar.draw_rule import cuda_constants

SOURCES = ("formulas.cuh", "paper_formulas.cuh", "geometry.cuh", "blend.cuh", "image.cuh", "perceptual.cuh", "update.cuh",
           "offsets.cuh", "shape.cuh", "paper.cuh", "equations.cuh")
KERNELS = ("skin", "project", "allocate", "fill", "blend", "compare", "cut_window", "image_gradient", "blend_backward",
           "gaussian_step", "gather", "joint_step", "offset_step", "shape_gradient", "shape_step", "expression_step",
           "place_joints", "dice", "pose_gaussians", "nearest", "neighbourhood", "paper_step",
           "residuals", "pose_hessian", "keep_equations")
OPTIONS = ("--std=c++17", "--extra-device-vectorization")


class CompileError(Exception):
    """NVRTC refused the kernels; the message is its log."""


def source() -> str:
    """The CUDA text of all kernels, struct declarations included."""
    folder = Path(__file__).parent
    first, *rest = ((folder / name).read_text().replace("#pragma once\n", "") for name in SOURCES)
    return "\n".join([cuda_constants(), first, declarations(), *rest])


def folder() -> Path:
    """$GSAC_CACHE/kernels, else ~/.cache/gsac/kernels: below the root of gsac.cache, which is not imported here."""
    return Path(os.environ.get("GSAC_CACHE") or "~/.cache/gsac").expanduser().absolute() / "kernels"


def cubin(architecture: str) -> bytes:
    """Machine code for an architecture such as sm_90; compiles (about 2 s) where the cache has none."""
    from cuda.bindings import nvrtc

    text = source()
    version = "{1}.{2}".format(*nvrtc.nvrtcVersion())
    key = hashlib.sha256("\0".join([architecture, version, *OPTIONS, text]).encode()).hexdigest()[:32]
    kept = folder() / f"{key}.cubin"
    if kept.is_file():
        return kept.read_bytes()
    code = compile_source(text, architecture)
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=kept.parent, delete=False) as half:
            half.write(code)
        os.replace(half.name, kept)
    except OSError:
        pass  # a read-only home costs two seconds, not the run
    return code


def compile_source(text: str, architecture: str) -> bytes:
    """Machine code of a CUDA text. Raises CompileError."""
    from cuda.bindings import nvrtc

    _, program = nvrtc.nvrtcCreateProgram(text.encode(), b"gsac.cu", 0, [], [])
    options = [option.encode() for option in (f"--gpu-architecture={architecture}", *OPTIONS)]
    error, = nvrtc.nvrtcCompileProgram(program, len(options), options)
    if error != nvrtc.nvrtcResult.NVRTC_SUCCESS:
        log = b" " * nvrtc.nvrtcGetProgramLogSize(program)[1]
        nvrtc.nvrtcGetProgramLog(program, log)
        raise CompileError(f"NVRTC cannot compile the kernels for {architecture}: {log.decode(errors='replace')}")
    code = b" " * nvrtc.nvrtcGetCUBINSize(program)[1]
    nvrtc.nvrtcGetCUBIN(program, code)
    nvrtc.nvrtcDestroyProgram(program)
    return code

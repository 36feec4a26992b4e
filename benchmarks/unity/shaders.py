"""Compiles the Unity package's HLSL with glslang."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from gsac.benchmarks.unity.spirv import Program
from gsac.viewer.wgsl import CORE, compile_spirv

PROGRAMS = {"glslangValidator": "glslang-tools", "spirv-val": "spirv-tools"}
STEREO = Path(__file__).parent / "stereo"
"""Folder with a stand-in for Unity's own shader file, as in a headset."""
KERNELS = ("Skin", "Bind", "SortBlocks", "SortAcross", "SortMerge", "Correct")
JOIN = "Join"
"""The kernel of GsacJoin.compute."""
EYES = ("Vertex", "Fragment")
TEXTURES = ("--shift-texture-binding", "20", "--shift-sampler-binding", "30")
"""Options of glslangValidator: a fragment program's textures keep clear of its vertex program's buffers."""


def missing_packages() -> list[str]:
    """Debian packages that compiling needs and this machine lacks."""
    return sorted({package for program, package in PROGRAMS.items() if not shutil.which(program)})


def compile_hlsl(source: Path, entry: str, stage: str, folder: Path, include: Sequence[Path] = (CORE,)) -> Program:
    """Compiles an entry point to `folder`/ENTRY.spv and validates it for Vulkan 1.0.

    Raises ShaderError or AssertionError with the tools' words.
    """
    out = compile_spirv(Path(source), entry, stage, Path(folder) / f"{entry}.spv", *TEXTURES, *(f"-I{i}" for i in include))
    done = subprocess.run(["spirv-val", "--target-env", "vulkan1.0", str(out)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return Program(out.read_bytes())


def shader_passes(path: Path = CORE / "GsacSplats.shader") -> dict[str, str]:
    """Reads a ShaderLab file: render pipeline ("" for the built-in one) -> HLSL of its pass."""
    passes = {}
    for part in Path(path).read_text().split("SubShader\n")[1:]:
        pipeline = re.search(r'"RenderPipeline" = "(\w+)"', part)
        passes[pipeline[1] if pipeline else ""] = part.split("HLSLPROGRAM")[1].split("ENDHLSL")[0]
    return passes


def compile_pass(text: str, folder: Path, *stand_ins: Path, entries: tuple[str, str] = EYES) -> tuple[Program, Program]:
    """Compiles a pass to its vertex and fragment program. stand_ins: folders of stand-ins for the render pipeline's files."""
    source = Path(folder) / "pass.hlsl"
    source.write_text(text)
    vertex, fragment = (compile_hlsl(source, entry, stage, folder, (CORE, *stand_ins))
                        for entry, stage in zip(entries, ("vert", "frag"), strict=True))
    return vertex, fragment


def compile_frame(folder: Path) -> None:
    """Compiles all shaders of a headset's frame to files that `read_frame` reads, also on a machine without a compiler."""
    for name in KERNELS:
        compile_hlsl(CORE / "Gsac.compute", name, "comp", folder)
    compile_hlsl(CORE / "GsacJoin.compute", JOIN, "comp", folder)
    compile_pass(shader_passes()[""], folder, STEREO)


def read_frame(folder: Path) -> dict[str, Program]:
    """Reads the files of `compile_frame`: entry point -> Program."""
    return {name: Program((Path(folder) / f"{name}.spv").read_bytes()) for name in (*KERNELS, JOIN, *EYES)}

"""Compiles the Unity package's HLSL with glslang."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

from gsac.benchmarks.unity.spirv import Program
from gsac.stages import export

PROGRAMS = {"glslangValidator": "glslang-tools", "spirv-val": "spirv-tools"}
PACKAGE = Path(export.__file__).parent / "unity" / "Runtime" / "Resources" / "Gsac"
STEREO = Path(__file__).parent / "stereo"
"""Stands for Unity's own shader file in a headset."""
KERNELS = ("Skin", "Bind", "SortBlocks", "SortAcross", "SortMerge")
EYES = ("Vertex", "Fragment")


def missing_packages() -> list[str]:
    """Debian packages that compiling needs and that are not there."""
    return sorted({package for program, package in PROGRAMS.items() if not shutil.which(program)})


def compile_hlsl(source: Path, entry: str, stage: str, folder: Path, include=(PACKAGE,)) -> Program:
    """Validated for Vulkan 1.0, left in `folder` as ENTRY.spv. AssertionError with the compiler's words."""
    out = Path(folder) / f"{entry}.spv"
    command = ["glslangValidator", "-D", "-V", "-S", stage, "-e", entry, "--source-entrypoint", entry, "--auto-map-bindings",
               "--auto-map-locations", *(f"-I{i}" for i in (Path(source).parent, *include)), str(source), "-o", str(out)]
    for step in (command, ["spirv-val", "--target-env", "vulkan1.0", str(out)]):
        done = subprocess.run(step, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return Program(out.read_bytes())


def shader_passes(path: Path = PACKAGE / "GsacSplats.shader") -> dict[str, str]:
    """Render pipeline ("" for the built-in one) -> HLSL of its pass, from a ShaderLab file."""
    passes = {}
    for part in Path(path).read_text().split("SubShader\n")[1:]:
        pipeline = re.search(r'"RenderPipeline" = "(\w+)"', part)
        passes[pipeline[1] if pipeline else ""] = part.split("HLSLPROGRAM")[1].split("ENDHLSL")[0]
    return passes


def compile_pass(text: str, folder: Path, stand_in: Path) -> tuple[Program, Program]:
    """Vertex and fragment program of a pass; stand_in: folder of what stands for the pipeline's files."""
    source = Path(folder) / "pass.hlsl"
    source.write_text(text)
    vertex, fragment = (compile_hlsl(source, entry, stage, folder, (PACKAGE, stand_in))
                        for entry, stage in zip(EYES, ("vert", "frag"), strict=True))
    return vertex, fragment


def compile_frame(folder: Path) -> None:
    """All that a frame for a headset runs, as files that `read_frame` reads on a machine without a compiler."""
    for name in KERNELS:
        compile_hlsl(PACKAGE / "Gsac.compute", name, "comp", folder)
    compile_pass(shader_passes()[""], folder, STEREO)


def read_frame(folder: Path) -> dict[str, Program]:
    """Entry point -> Program."""
    return {name: Program((Path(folder) / f"{name}.spv").read_bytes()) for name in (*KERNELS, *EYES)}

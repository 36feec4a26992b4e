"""Translates the Unity package's HLSL to WGSL for viewer.html: `python -m gsac.viewer.wgsl` writes viewer/shaders.js.

glslang makes SPIR-V of the HLSL, naga (npm's naga-wasm) WGSL of that. Only this module needs the two: shaders.js is committed.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import gsac.unity

HERE = Path(__file__).parent
CORE = Path(gsac.unity.__file__).parent / "Runtime" / "Resources" / "Gsac"
SOURCES = (CORE / "GsacCore.hlsl", CORE / "Gsac.compute", CORE / "GsacDraw.hlsl", HERE / "page.hlsl")
WRITTEN = HERE / "shaders.js"
NAGA = "naga-wasm@30.1.0"
ENTRIES = {"Skin": "comp", "Bind": "comp", "SortBlocks": "comp", "SortAcross": "comp", "SortMerge": "comp", "Correct": "comp",
           "SplatVertex": "vert", "SplatFragment": "frag", "FloorVertex": "vert", "FloorFragment": "frag"}
"""Entry point -> kind of shader, as glslangValidator names it."""
_SIZES = {"u32": 4, "f32": 4, "vec2<f32>": 8, "vec4<f32>": 16}
"""Size of a member of a uniform block, bytes, which is its alignment too."""
_TRANSLATE = """
import { parseSpirv, validate, writeWgsl } from "naga-wasm";
import { readFileSync } from "node:fs";
const texts = {};
for (const path of process.argv.slice(2)) {
  const module = parseSpirv(readFileSync(path));
  texts[path] = writeWgsl(module, validate(module), {});
}
console.log(JSON.stringify(texts));
"""


class ShaderError(Exception):
    """A tool that translates the shaders is missing or fails; the message names it and gives its words."""


def hash_sources() -> str:
    """SHA-256 of the HLSL from which shaders.js is made, in hex."""
    return hashlib.sha256(b"\0".join(source.read_bytes() for source in SOURCES)).hexdigest()


def glslang_version() -> str:
    """The version of glslang, as shaders.js names it; ShaderError where it is not installed."""
    if not shutil.which("glslangValidator"):
        raise ShaderError("writing the viewer's shaders needs glslangValidator (Debian package glslang-tools)")
    words = subprocess.run(["glslangValidator", "--version"], capture_output=True, text=True).stdout
    return re.search(r"Glslang Version: \S*?([\d.]+)", words)[1]


def compile_spirv(source: Path, entry: str, stage: str, out: Path, *options: str) -> Path:
    """Compiles one entry point of an HLSL file for Vulkan 1.0. Returns `out`; ShaderError with the compiler's words.

    stage: `vert`, `frag` or `comp`; options: further ones of glslangValidator.
    """
    _run(["glslangValidator", "-D", "-V", "-S", stage, "-e", entry, "--source-entrypoint", entry, "--auto-map-bindings",
          "--auto-map-locations", *options, f"-I{source.parent}", str(source), "-o", str(out)])
    return out


def translate(node_modules: Path) -> dict[str, str]:
    """Entry point -> WGSL without indentation. node_modules: the folder in which npm has installed naga-wasm."""
    with tempfile.TemporaryDirectory(dir=node_modules.parent) as folder:
        files = {entry: compile_spirv(SOURCES[1] if stage == "comp" else SOURCES[3], entry, stage, Path(folder) / f"{entry}.spv",
                              "--shift-ssbo-binding", "1")
                 for entry, stage in ENTRIES.items()}
        script = Path(folder) / "translate.mjs"
        script.write_text(_TRANSLATE)
        texts = json.loads(_run(["node", str(script), *map(str, files.values())]))
        return {entry: re.sub(r"(?m)^ +| +$", "", texts[str(file)].replace("u0040_", "")) for entry, file in files.items()}


def parse_places(text: str) -> tuple[dict[str, int], dict[str, int]]:
    """From WGSL: buffer -> binding, and parameter -> byte in the uniform block, whose buffer is called `parameters`."""
    bindings, parameters = {}, {}
    for number, kind, name, block in re.findall(r"@binding\((\d+)\)\s*var<(\w+)[^>]*> (\w+): (\w+);", text):
        if kind == "storage":
            bindings[re.sub(r"_\d+$", "", name)] = int(number)
            continue
        bindings["parameters"], at = int(number), 0
        for member, type_ in re.findall(r"(\w+): ([^,]+),", re.search(rf"struct {block} {{(.*?)}}", text, re.DOTALL)[1]):
            size = _SIZES[type_]
            at = -(-at // size) * size
            parameters[member.rstrip("_")] = at
            at += size
    return bindings, parameters


def format_script(texts: dict[str, str]) -> str:
    """The text of shaders.js. texts: entry point -> WGSL."""
    lines = ["// Written by `python -m gsac.viewer.wgsl` from the HLSL of the Unity package and page.hlsl. Do not edit.",
             f"// glslang {glslang_version()}, {NAGA}, HLSL {hash_sources()}", "", "export const SHADERS = {"]
    for entry, text in texts.items():
        bindings, parameters = parse_places(text)
        lines.append(f"  {entry}: {{ bindings: {json.dumps(bindings)}, parameters: {json.dumps(parameters)}, code: `\n{text}` }},")
    return "\n".join([*lines, "};", ""])


def _run(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise ShaderError(f"{command[0]} failed: {(done.stdout + done.stderr).strip()}")
    return done.stdout


def main() -> int:
    """Writes shaders.js."""
    if not shutil.which("npm"):
        raise ShaderError("writing the viewer's shaders needs npm (Debian package npm)")
    with tempfile.TemporaryDirectory() as folder:
        _run(["npm", "install", "--silent", "--no-audit", "--no-fund", "--prefix", folder, NAGA])
        WRITTEN.write_text(format_script(translate(Path(folder) / "node_modules")))
    print(f"wrote {WRITTEN}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())

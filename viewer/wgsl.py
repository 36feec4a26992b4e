"""The Unity package's HLSL as WGSL for viewer.html: `python -m gsac.viewer.wgsl` writes viewer/shaders.js anew.

HLSL -> SPIR-V by glslang -> WGSL by naga (npm's naga-wasm). Both are needed here only: what is written is kept with the sources.
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
ENTRIES = {"Skin": "comp", "Bind": "comp", "SortBlocks": "comp", "SortAcross": "comp", "SortMerge": "comp",
           "SplatVertex": "vert", "SplatFragment": "frag", "FloorVertex": "vert", "FloorFragment": "frag"}
SIZES = {"u32": 4, "f32": 4, "vec2<f32>": 8, "vec4<f32>": 16}
"""Bytes of a member of a uniform block; WGSL aligns it to as many."""
TRANSLATE = """
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
    """A tool that writes the shaders is missing, or refuses them; says which and why."""


def digest() -> str:
    """Of the HLSL that the shaders come from."""
    return hashlib.sha256(b"\0".join(source.read_bytes() for source in SOURCES)).hexdigest()


def glslang_version() -> str:
    """The front end's version, as shaders.js names it; ShaderError where it is not installed."""
    if not shutil.which("glslangValidator"):
        raise ShaderError("writing the viewer's shaders needs glslangValidator (Debian package glslang-tools)")
    words = subprocess.run(["glslangValidator", "--version"], capture_output=True, text=True).stdout
    return re.search(r"Glslang Version: \S*?([\d.]+)", words)[1]


def spirv(source: Path, entry: str, stage: str, out: Path, *options: str) -> Path:
    """Compiles one entry point of HLSL for Vulkan 1.0; ShaderError with the compiler's words. options: more of glslang's."""
    _run(["glslangValidator", "-D", "-V", "-S", stage, "-e", entry, "--source-entrypoint", entry, "--auto-map-bindings",
          "--auto-map-locations", *options, f"-I{source.parent}", str(source), "-o", str(out)])
    return out


def wgsl(node_modules: Path) -> dict[str, str]:
    """Entry point -> WGSL without indents. node_modules: where naga-wasm is installed."""
    with tempfile.TemporaryDirectory(dir=node_modules.parent) as folder:
        files = {entry: spirv(SOURCES[1] if stage == "comp" else SOURCES[3], entry, stage, Path(folder) / f"{entry}.spv",
                              "--shift-ssbo-binding", "1")
                 for entry, stage in ENTRIES.items()}
        script = Path(folder) / "translate.mjs"
        script.write_text(TRANSLATE)
        texts = json.loads(_run(["node", str(script), *map(str, files.values())]))
        return {entry: re.sub(r"(?m)^ +| +$", "", texts[str(file)].replace("u0040_", "")) for entry, file in files.items()}


def places(text: str) -> tuple[dict[str, int], dict[str, int]]:
    """Buffer -> binding, parameter -> byte in the uniform block (whose buffer is called `parameters`)."""
    bindings, parameters = {}, {}
    for number, kind, name, block in re.findall(r"@binding\((\d+)\)\s*var<(\w+)[^>]*> (\w+): (\w+);", text):
        if kind == "storage":
            bindings[re.sub(r"_\d+$", "", name)] = int(number)
            continue
        bindings["parameters"], at = int(number), 0
        for member, type_ in re.findall(r"(\w+): ([^,]+),", re.search(rf"struct {block} {{(.*?)}}", text, re.S)[1]):
            size = SIZES[type_]
            at = -(-at // size) * size
            parameters[member.rstrip("_")] = at
            at += size
    return bindings, parameters


def script(texts: dict[str, str]) -> str:
    """shaders.js."""
    lines = ["// Written by `python -m gsac.viewer.wgsl` from the HLSL of the Unity package and page.hlsl. Do not edit.",
             f"// glslang {glslang_version()}, {NAGA}, HLSL {digest()}", "", "export const SHADERS = {"]
    for entry, text in texts.items():
        bindings, parameters = places(text)
        lines.append(f"  {entry}: {{ bindings: {json.dumps(bindings)}, parameters: {json.dumps(parameters)}, code: `\n{text}` }},")
    return "\n".join([*lines, "};", ""])


def _run(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise ShaderError(f"{command[0]} failed: {(done.stdout + done.stderr).strip()}")
    return done.stdout


def main() -> int:
    if not shutil.which("npm"):
        raise ShaderError("writing the viewer's shaders needs npm (Debian package npm)")
    with tempfile.TemporaryDirectory() as folder:
        _run(["npm", "install", "--silent", "--no-audit", "--no-fund", "--prefix", folder, NAGA])
        WRITTEN.write_text(script(wgsl(Path(folder) / "node_modules")))
    print(f"wrote {WRITTEN}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())

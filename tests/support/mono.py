"""Compiles the package's C# with Mono's `mcs`, warnings as errors, and runs programs of the tests with it."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

HERE = Path(__file__).parents[1] / "unity"
PROGRAMS = {"mcs": "mono-mcs", "mono": "mono-runtime"}


def missing_packages():
    return sorted(package for program, package in PROGRAMS.items() if not shutil.which(program))


def compile_csharp(sources, out, *options):
    """out: .exe or .dll. AssertionError with the compiler's words."""
    kind = "library" if Path(out).suffix == ".dll" else "exe"
    done = subprocess.run(["mcs", "-langversion:latest", "-warnaserror", f"-target:{kind}", f"-out:{out}", *options,
                           *map(str, sources)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def run(program, *args, heap="256m", collector=""):
    """Standard output; heap: what the program may allocate before it is ended with an error."""
    done = subprocess.run(["mono", "--debug", str(program), *map(str, args)], capture_output=True, text=True,
                          env=os.environ | {"MONO_GC_PARAMS": f"max-heap-size={heap}{collector}"})
    assert done.returncode == 0, (done.stdout[-2000:], done.stderr[-2000:])
    return done.stdout


def compile_package(package, out):
    """The package with its samples over the stubs of Unity; players' assemblies without the editor's. The tests' program."""
    stubs, editor = (set((HERE / "stubs").glob(f"{kind}*.cs")) for kind in ("", "UnityEditor"))
    compile_csharp(sorted(stubs - editor), out / "UnityEngine.dll")
    options = [f"-r:{out / 'UnityEngine.dll'}"]
    compile_csharp(sorted((HERE / "stubs" / "packages").glob("*.cs")), out / "Packages.dll", *options)
    options.append(f"-r:{out / 'Packages.dll'}")
    for name, sources in in_order(package):
        if name == "Gsac.Editor":
            compile_csharp(sorted(editor), out / "UnityEditor.dll", *options)
            options.append(f"-r:{out / 'UnityEditor.dll'}")
        compile_csharp(sources, out / f"{name}.dll", *options)
        options.append(f"-r:{out / name}.dll")
    return compile_csharp(sorted((HERE / "programs").glob("[ADP]*.cs")), out / "Play.exe", *options)


def in_order(package):
    """(name, sources) of each assembly of the package, after those that it names; the editor's last."""
    folders = {path.parent: json.loads(path.read_text()) for path in Path(package).rglob("*.asmdef")}
    sources = {assembly["name"]: [] for assembly in folders.values()}
    for path in sorted(Path(package).rglob("*.cs")):
        sources[next(folders[folder] for folder in path.parents if folder in folders)["name"]].append(path)
    waiting = sorted(folders.values(), key=lambda assembly: (assembly["includePlatforms"] == ["Editor"], assembly["name"]))
    done = []
    while waiting:
        ready = next(one for one in waiting if not set(one["references"]) & {other["name"] for other in waiting})
        waiting.remove(ready)
        done.append((ready["name"], sources[ready["name"]]))
    return done


def arrays(path):
    """Name -> array of what programs/Dump.cs wrote."""
    raw, at, out = Path(path).read_bytes(), 0, {}
    while at < len(raw):
        end = raw.index(b"\n", at)
        name, kind, count = raw[at:end].decode().rsplit(" ", 2)
        out[name] = np.frombuffer(raw, f"<{kind}4", int(count), end + 1)
        at = end + 1 + 4 * int(count)
    return out

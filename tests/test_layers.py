"""The packages import one way, modules in no circle, and tools see all of them under gsac.*."""

from __future__ import annotations

import ast
import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
BELOW = {
    "cache": set(),
    "avatar": set(),
    "unity": set(),
    "viewer": {"avatar", "unity"},
    "turntable": {"avatar"},
    "stages": {"avatar", "unity", "viewer"},
    "pipeline": {"avatar", "cache", "stages", "turntable", "unity", "viewer"},
    "benchmarks": {"avatar", "cache", "pipeline", "stages", "turntable", "unity", "viewer"},
}
"""Package -> those it may import; lowest first."""
SHARED_BY_STAGES = {"contract", "body_choice", "brought_file", "counting", "findings", "first_look", "frame_names", "mask_place",
                    "missing_frames", "person_seen", "severity", "turn_pace"}


def modules(package: str) -> dict[str, Path]:
    """Name -> file, of a package's modules."""
    return {".".join(("gsac", *file.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__"): file
            for file in sorted((ROOT / package).rglob("*.py"))}


MODULES = {name: file for package in BELOW for name, file in modules(package).items()}


def imports(name: str, file: Path) -> set[str]:
    """First-party modules that a module imports anywhere: at its top, in functions, under TYPE_CHECKING."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{file}:{node.lineno}: imports are absolute"
            found |= {f"{node.module}.{alias.name}" if f"{node.module}.{alias.name}" in MODULES else node.module or ""
                      for alias in node.names}
    return {module for module in found if module.startswith("gsac.")} - {name}


IMPORTS = {name: imports(name, file) for name, file in MODULES.items()}


@pytest.mark.parametrize("package", BELOW)
def test_a_package_imports_only_what_stands_below_it(package):
    against = [f"{name} imports {module}" for name in MODULES if name.split(".")[1] == package
               for module in IMPORTS[name] if module.split(".")[1] not in BELOW[package] | {package}]
    assert not against


def test_a_stage_knows_no_other_stage():
    against = [f"{name} imports {module}" for name in MODULES if name.startswith("gsac.stages.") for module in IMPORTS[name]
               if module.startswith("gsac.stages.") and module.split(".")[2] not in SHARED_BY_STAGES | {name.split(".")[2]}]
    assert not against


def test_no_modules_import_each_other_in_a_circle():
    done: set[str] = set()

    def walk(name: str, way: tuple[str, ...]) -> None:
        assert name not in way, " -> ".join((*way[way.index(name):], name))
        if name not in done:
            for module in sorted(IMPORTS.get(name, ())):
                walk(module, (*way, name))
            done.add(name)

    for name in MODULES:
        walk(name, ())


def test_every_package_is_linked_below_src_and_nothing_else_is_there():
    linked = {link.name: os.readlink(link) for link in (ROOT / "src" / "gsac").iterdir()}
    assert linked == {package: f"../../{package}" for package in BELOW}
    assert [entry.name for entry in (ROOT / "src").iterdir() if not entry.name.endswith(".egg-info")] == ["gsac"]


def test_the_bare_package_names_are_never_imported():
    bare = re.compile(rf"^\s*(from|import) ({'|'.join(BELOW)})\b", re.MULTILINE)
    for file in (file for folder in (*BELOW, "tests", "tools") for file in (ROOT / folder).rglob("*.py")):
        assert not bare.search(file.read_text()), file


def test_no_package_holds_much_more_than_a_quarter_of_the_lines_and_train_at_most_sixteen_rooms():
    ours = {".py", ".js", ".cs", ".hlsl", ".compute", ".shader", ".cuh", ".jinja", ".css", ".html"}
    lines = {package: sum(len(file.read_text().splitlines()) for file in (ROOT / package).rglob("*") if file.suffix in ours)
             for package in (*BELOW, "tools")}
    assert max(lines.values()) <= 0.29 * sum(lines.values()), lines
    rooms = [entry for entry in (ROOT / "stages" / "train").iterdir() if entry.suffix == ".py" or entry.is_dir()]
    assert len([room for room in rooms if room.name not in ("__init__.py", "__pycache__")]) <= 16

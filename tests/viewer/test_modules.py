"""The viewer's ES modules: each imports what it uses, exports what is used, and stands behind what it imports."""

import json
import re
import subprocess

import pytest

from gsac.viewer import joint_names
from gsac.viewer.package import NPM
from gsac.viewer.page import HERE, MODULES, join_modules
from support.page_modules import copy_modules

IMPORT = re.compile(r'^import \{ ([\w, ]+) \} from "\./(\w+\.js)";$', re.MULTILINE)
DECLARED = re.compile(r"^(export )?(?:async )?(?:function|class|const|let) (\w+)", re.MULTILINE)
TYPES = "typescript@5.9.3 @webgpu/types@0.1.74 @types/webxr@0.5.24"
OPTIONS = {"lib": ["es2023", "dom", "dom.iterable"], "types": ["@webgpu/types", "webxr"], "module": "es2022", "target": "es2022",
           "moduleResolution": "bundler", "allowJs": True, "checkJs": True, "noEmit": True, "strict": False, "noImplicitAny": False}


def code_of(text):
    """A module's text with comments, strings and the fixed parts of templates blanked; what stands in `${...}` stays."""
    out, inside, i = [], [], 0
    while i < len(text):
        c = text[i]
        if inside and inside[-1] == "`":
            if c == "\\":
                i += 1
            elif c == "`":
                inside.pop()
            elif text.startswith("${", i):
                inside.append("${")
                i += 1
            out.append("\n" if c == "\n" else " ")
        elif text.startswith("//", i):
            i = text.index("\n", i) - 1
        elif text.startswith("/*", i):
            i = text.index("*/", i) + 1
        elif c in "'\"":
            i = re.compile(rf"(\\.|[^\\{c}])*").match(text, i + 1).end()
            out.append('""')
        else:
            if c in "`{":
                inside.append(c)
            out.append(" " if c == "`" or (c == "}" and inside.pop() == "${") else c)
        i += 1
    return "".join(out)


TEXTS = {name: (HERE / name).read_text() for name in MODULES}
CODES = {name: code_of(text) for name, text in TEXTS.items()}
EXPORTS = {name: {found[2] for found in DECLARED.finditer(code) if found[1]} for name, code in CODES.items()}
IMPORTS = {name: {home: set(names.split(", ")) for names, home in IMPORT.findall(text)} for name, text in TEXTS.items()}


def uses(code, name):
    """Whether the name stands in the code other than as a property or a key."""
    return re.search(rf"(?<![\w.])(?:\.\.\.)?{name}\b(?!:)", code) is not None


def test_every_module_of_the_folder_is_in_the_page():
    assert sorted(MODULES) == sorted(path.name for path in HERE.glob("*.js")) and len(set(MODULES)) == len(MODULES)


@pytest.mark.parametrize("module", MODULES)
def test_a_module_stands_after_those_that_it_imports_and_they_export_it(module):
    for home, names in IMPORTS[module].items():
        assert MODULES.index(home) < MODULES.index(module)
        assert names <= EXPORTS[home], home


@pytest.mark.parametrize("module", MODULES)
def test_a_module_imports_what_it_uses_of_others_and_nothing_else(module):
    body = re.sub(r"^import .*$", "", CODES[module], flags=re.MULTILINE)
    used = {name for home in MODULES if home != module for name in EXPORTS[home] if uses(body, name)}
    assert used == {name for names in IMPORTS[module].values() for name in names}


def test_whatever_is_exported_is_imported():
    imported = {name for found in IMPORTS.values() for names in found.values() for name in names}
    imported |= {name for path in NPM.glob("*.js") for names, _ in IMPORT.findall(path.read_text()) for name in names.split(", ")}
    assert {name for names in EXPORTS.values() for name in names} == imported


def test_top_level_names_are_unique_over_all_modules():
    names = [found[2] for code in CODES.values() for found in DECLARED.finditer(code)]
    assert sorted(names) == sorted(set(names)), "joined modules share one scope"


def test_in_the_page_no_import_or_export_is_left():
    joined = code_of(join_modules(MODULES))
    assert not re.search(r"^\s*(import|export)\b|\bimport\(", joined, re.MULTILINE)
    assert "</script" not in join_modules(MODULES)


def test_joint_names_are_those_of_the_motion_package():
    assert joint_names.WRITTEN.read_text() == joint_names.format_script(), "run `python -m gsac.viewer.joint_names`"


@pytest.mark.slow
def test_typescript_finds_no_fault(node_package, tmp_path):
    modules = node_package(TYPES) / "node_modules"
    (copy_modules(tmp_path) / "node_modules").symlink_to(modules)
    (tmp_path / "tsconfig.json").write_text(json.dumps({"compilerOptions": OPTIONS, "files": list(MODULES)}))
    done = subprocess.run(["node", modules / "typescript" / "bin" / "tsc", "-p", tmp_path], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout

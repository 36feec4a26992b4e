import os
import subprocess
import sys
from pathlib import Path

import pytest

from gsac.cache import code, memo
from gsac.cache.code import code_parts
from gsac.cache.errors import CacheError

STAGE = '''"""A stage."""
import gsac.avatar.body
from gsac.avatar import binding
from . import method
from .config import Config

TABLE = {"gp": "gsac.stages.fill.gp"}
KERNEL = "blend.cu"

def run(job, size=1, *, names=("a", "b")):
    """Runs."""
    from gsac.avatar.raster import fast
    total = size + 2  # metres
    return fast(total)
'''


@pytest.fixture
def tree(tmp_path, store):
    """Folders of two top packages, with modules that cannot be imported."""
    sources = {
        "stages/__init__.py": "",
        "stages/contract.py": "UNREACHED = 1\n",
        "stages/fill/__init__.py": "LIGHT = 1\n",
        "stages/fill/stage.py": STAGE,
        "stages/fill/config.py": "class Config:\n    size: int = 3\n    'pixels'\n",
        "stages/fill/method.py": "raise SystemExit('imported!')\n",
        "stages/fill/gp.py": "from ..contract import nothing\n",
        "stages/fill/blend.cu": "__global__ void blend() {}\n",
        "stages/other.py": "VALUE = 1\n",
        "avatar/body.py": "import numpy\nBODY = HERE / 'open' / 'body.npz'\nMODEL = 'smplx.npz'\n",
        "avatar/open/body.npz": "weights",
        "avatar/other.npz": "weights",
        "avatar/binding.py": "K = 0.5\n",
        "avatar/raster/__init__.py": "def fast(x):\n    return x\n",
    }
    for name, text in sources.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def parts(tree: Path, *extra: str) -> dict[str, str]:
    packages = {"gsac.stages": tree / "stages", "gsac.avatar": tree / "avatar"}
    return code_parts("gsac.stages.fill.stage", extra, packages=packages)


def edit(file: Path, old: str, new: str) -> None:
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))


def test_the_closure_is_every_module_that_imports_reach_and_nothing_is_imported(tree):
    assert list(parts(tree)) == [
        "gsac.avatar.binding",
        "gsac.avatar.body",
        "gsac.avatar.body/open/body.npz",
        "gsac.avatar.raster",
        "gsac.stages",
        "gsac.stages.contract",
        "gsac.stages.fill",
        "gsac.stages.fill.config",
        "gsac.stages.fill.gp",
        "gsac.stages.fill.method",
        "gsac.stages.fill.stage",
        "gsac.stages.fill.stage/blend.cu",
    ]


@pytest.mark.parametrize(
    "old, new",
    [
        ("  # metres", ""),
        ("  # metres", "  # feet\n\n    # and more"),
        ('"""Runs."""', '"""Runs, and says more."""'),
        ('    """Runs."""\n', ""),
        ('"""A stage."""', "'''Another\nstage.'''"),
        ("size + 2", "(size\n        + 2)"),
        ('("a", "b")', "('a', 'b',)"),
        ('"blend.cu"', 'u"blend.cu"'),
    ],
)
def test_a_comment_docstring_or_formatting_edit_does_not_change_the_code(tree, old, new):
    before = parts(tree)
    edit(tree / "stages/fill/stage.py", old, new)
    assert parts(tree) == before


def test_the_line_that_documents_a_field_is_not_code(tree):
    before = parts(tree)
    edit(tree / "stages/fill/config.py", "'pixels'", '"""Width in pixels."""')
    assert parts(tree) == before


@pytest.mark.parametrize(
    "file, old, new, module",
    [
        ("stages/fill/stage.py", "size + 2", "size - 2", "gsac.stages.fill.stage"),
        ("stages/fill/stage.py", "size + 2", "size + 2.0", "gsac.stages.fill.stage"),
        ("stages/fill/stage.py", "size=1", "size=True", "gsac.stages.fill.stage"),
        ("stages/fill/stage.py", "size=1", "size=None", "gsac.stages.fill.stage"),
        ("stages/fill/stage.py", '("a", "b")', '("b", "a")', "gsac.stages.fill.stage"),
        ("stages/fill/stage.py", '("a", "b")', '("a", b"b")', "gsac.stages.fill.stage"),
        ("stages/fill/stage.py", ", *,", ",", "gsac.stages.fill.stage"),
        ("stages/fill/stage.py", "def run", "async def run", "gsac.stages.fill.stage"),
        ("stages/fill/config.py", "3", "4", "gsac.stages.fill.config"),
        ("stages/fill/__init__.py", "1", "2", "gsac.stages.fill"),
        ("stages/fill/gp.py", "nothing", "something", "gsac.stages.fill.gp"),
        ("stages/contract.py", "1", "2", "gsac.stages.contract"),
        ("stages/fill/blend.cu", "{}", "{ }", "gsac.stages.fill.stage/blend.cu"),
        ("avatar/open/body.npz", "weights", "waits", "gsac.avatar.body/open/body.npz"),
        ("avatar/binding.py", "0.5", "0.25", "gsac.avatar.binding"),
        ("avatar/raster/__init__.py", "return x", "return -x", "gsac.avatar.raster"),
    ],
)
def test_changed_code_anywhere_in_the_closure_changes_exactly_that_part(tree, file, old, new, module):
    before = parts(tree)
    edit(tree / file, old, new)
    after = parts(tree)
    assert {name for name in before if before[name] != after[name]} == {module}


def test_modules_and_files_that_nothing_reaches_are_not_code(tree):
    before = parts(tree)
    (tree / "stages/other.py").write_text("VALUE = 2\n")
    (tree / "avatar/other.npz").write_text("other weights")
    assert parts(tree) == before


def test_a_file_whose_name_begins_like_a_module_is_a_file(tree):
    """As the viewer's `gsac.js`."""
    edit(tree / "avatar/body.py", "MODEL = 'smplx.npz'", "PAGE = 'gsac.js'")
    (tree / "avatar/gsac.js").write_text("draw()")
    before = parts(tree)
    assert "gsac.avatar.body/gsac.js" in before
    edit(tree / "avatar/gsac.js", "draw", "paint")
    assert {name for name, digest in parts(tree).items() if before[name] != digest} == {"gsac.avatar.body/gsac.js"}


def test_extra_modules_bring_their_own_closure(tree):
    assert set(parts(tree, "gsac.stages.other")) - set(parts(tree)) == {"gsac.stages.other"}


def test_a_source_that_cannot_be_parsed_still_counts(tree):
    (tree / "avatar/binding.py").write_text("K = = 1\n")
    before = parts(tree)
    (tree / "avatar/binding.py").write_text("K = = 2\n")
    assert before["gsac.avatar.binding"] != parts(tree)["gsac.avatar.binding"]


def test_a_module_that_does_not_exist_is_named(store):
    with pytest.raises(CacheError, match="gsac.stages.nothing"):
        code_parts("gsac.stages.nothing")


def test_an_unchanged_module_is_not_parsed_again_and_an_edit_is_noticed(tree, monkeypatch):
    monkeypatch.setattr(memo, "SETTLED_NS", -(10**18))
    parsed = []
    true = code.read_source
    monkeypatch.setattr(code, "read_source", lambda *a: parsed.append(1) or true(*a))
    before = parts(tree)
    assert len(parsed) == 10
    assert parts(tree) == before
    assert len(parsed) == 10
    edit(tree / "avatar/binding.py", "0.5", "0.6")
    assert parts(tree) != before
    assert len(parsed) == 11


def test_what_is_remembered_of_a_stage_s_code_is_written_at_once(tree, monkeypatch):
    monkeypatch.setattr(memo, "SETTLED_NS", -(10**18))
    written = []
    flush = memo.Memo.flush
    monkeypatch.setattr(memo.Memo, "flush", lambda self: written.append(len(self._pending)) or flush(self))
    parts(tree)
    assert len(written) == 1 and written[0] >= 10, "each writing waits for the disk"


def test_the_digests_are_the_same_in_every_process(tmp_path):
    command = "from gsac.cache.code import code_parts; print(code_parts('gsac.cache.store'))"
    printed = set()
    for seed in ("1", "2"):
        env = {**os.environ, "PYTHONHASHSEED": seed, "GSAC_CACHE": str(tmp_path / seed)}
        printed.add(subprocess.run([sys.executable, "-c", command], env=env, capture_output=True, check=True).stdout)
    assert len(printed) == 1


def test_whatever_python_imports_is_in_the_closure(store):
    command = "import sys, gsac.cache.gc, gsac.cache.verify; print(*[m for m in sys.modules if m.startswith('gsac.')])"
    imported = subprocess.run([sys.executable, "-c", command], capture_output=True, check=True, text=True).stdout.split()
    assert len(imported) > 10
    assert set(imported) <= set(code_parts("gsac.cache.gc", ("gsac.cache.verify",)))

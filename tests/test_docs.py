"""What the documents name is there: files, links, modules, commands, the graph of the stages."""

from __future__ import annotations

import argparse
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from gsac.pipeline.cli import execute
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted({*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("benchmarks/**/*.md"), *ROOT.glob("tools/*.md"),
                ROOT / "unity" / "README.md"})
REFERENCE = ROOT / "docs" / "cli.md"
"""Written from the commands themselves; `[...]` in it is no command line."""
GUIDES = [page for page in PAGES if page.parent in (ROOT, ROOT / "docs", ROOT / "docs" / "lab") and page != REFERENCE]
"""Those whose commands are checked; the others tell of runs of their time."""
HISTORY = ROOT / "CHANGELOG.md"
"""Names paths that are gone."""
PACKAGES = sorted(link.name for link in (ROOT / "src" / "gsac").iterdir())
TOPS = {*PACKAGES, "docker", "docs", "src", "tests", "tools"}
DESCRIPTION = 31
"""Column at which the tree's descriptions begin."""


class Block(NamedTuple):
    language: str
    text: str


def blocks(page: Path) -> list[Block]:
    return [Block(*found) for found in re.findall(r"^```(\w*)\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)]


def prose(page: Path) -> str:
    """The page without its code blocks."""
    return re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)


def inline(page: Path) -> list[str]:
    """Code in running text, `like this`."""
    return re.findall(r"`([^`\n]+)`", prose(page))


def anchors(page: Path) -> set[str]:
    """As GitHub makes them of headings."""
    headings = re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_relative_link_leads_to_a_file_and_a_heading_in_it(page):
    dead = []
    for link in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if re.match(r"\w+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        if not target.exists() or anchor and anchor not in anchors(target):
            dead.append(link)
    assert not dead


@pytest.mark.parametrize("page", [page for page in PAGES if page != HISTORY], ids=lambda page: str(page.relative_to(ROOT)))
def test_every_path_of_the_repository_that_is_named_exists(page):
    """A path begins with a folder of the root; `*` stands for some names."""
    named = [word.rstrip("/") for word in inline(page) if re.fullmatch(r"[\w.*-]+/[\w./*-]*", word) and word.split("/")[0] in TOPS]
    assert not [path for path in named if not any(ROOT.glob(path))]


@pytest.mark.parametrize("page", GUIDES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_module_that_is_named_exists(page):
    text = page.read_text() if page != HISTORY else ""
    named = re.findall(r"python -m gsac\.([\w.]*\w)", text)
    assert not [name for name in named if not any(ROOT.glob(f"{name.replace('.', '/')}{end}") for end in (".py", "/__main__.py"))]


class Parsed(BaseException):
    """Ends a command before it begins; passes by every `except Exception`."""


def parse(argv: list[str], monkeypatch) -> argparse.Namespace:
    """The arguments as the real command reads them; fails where it refuses them."""
    whole = argparse.ArgumentParser.parse_args

    def parse_args(self, *arguments):
        raise Parsed(whole(self, *arguments))

    with monkeypatch.context() as patch:
        patch.setattr(argparse.ArgumentParser, "parse_args", parse_args)
        try:
            ended = execute(argv)
        except Parsed as seen:
            return seen.args[0]
        except SystemExit as refused:
            ended = refused.code
    pytest.fail(f"gsac {' '.join(argv)}: ended with {ended} before it began")


def commands(page: Path) -> Iterator[list[str]]:
    """Command lines in code blocks, as words without comments."""
    for block in blocks(page):
        for line in block.text.splitlines():
            if match := re.match(r"(?:\.venv/bin/)?gsac (.*)", line):
                yield shlex.split(match[1], comments=True)


@pytest.mark.parametrize("argv", [argv for page in GUIDES for argv in commands(page)], ids=" ".join)
def test_every_command_line_is_understood(argv, monkeypatch):
    given = parse(argv, monkeypatch)
    project = Project.at_hand()
    resolve(project, None, getattr(given, "set", ()))
    for stage in (getattr(given, "until", None), getattr(given, "stage", None)):
        assert stage is None or project.graph.step(stage)
    if argv[0] == "bench":
        assert (ROOT / "benchmarks" / argv[1].replace("-", "_") / "bench.py").is_file()


def test_the_picture_of_the_stages_is_the_graph_of_dvc_yaml():
    drawn = next(block.text for block in blocks(ROOT / "docs" / "architecture.md") if block.language == "mermaid")
    graph = Project.at_hand().graph
    arrows = {(before, after) for before, after in re.findall(r"(\w+)(?:\(\[\w+\]\))? --> (\w+)", drawn)}
    assert arrows == {("clip", "split")} | {(parent, name) for name in graph.steps for parent in graph.parents(name)}


def test_picture_and_table_of_the_house_show_every_package():
    table = re.findall(r"^\| `(\w+)` \|", prose(ROOT / "docs" / "architecture.md"), re.MULTILINE)
    assert sorted(table) == PACKAGES
    assert set(re.findall(r'class="name">(\w+)<', (ROOT / "docs" / "house.svg").read_text())) == set(PACKAGES)


def tree() -> list[Path]:
    """Every path that the tree of architecture.md names."""
    lines = blocks(ROOT / "docs" / "architecture.md")[-1].text.splitlines()
    way: list[str] = []
    found = []
    for line in lines:
        depth = (len(line) - len(line.lstrip())) // 2
        for name in line[:DESCRIPTION].split():
            way[depth:] = [name]
            found.append(Path(*way))
    return found


def test_everything_in_the_tree_exists():
    assert not [str(path) for path in tree() if not (ROOT / path).exists()]


@pytest.mark.parametrize("package", ["avatar", "cache", "pipeline", "stages"])
def test_the_tree_names_every_module_that_stands_at_the_top_of_a_package(package):
    """A module has a line of its own or stands in the description of another."""
    drawn = blocks(ROOT / "docs" / "architecture.md")[-1].text
    section = re.search(rf"^{package}/.*\n(?:  .*\n)*", drawn, re.MULTILINE)
    assert section, package
    missing = {path.name for path in (ROOT / package).glob("*.py")} - {"__init__.py"} - set(re.findall(r"\w+\.py\b", section[0]))
    assert not missing


def test_the_tree_names_every_folder_of_the_packages():
    """And of each stage."""
    named = set(tree())
    folders = {path.relative_to(ROOT) for package in PACKAGES for path in (ROOT / package, *(ROOT / package).glob("*/"))}
    folders |= {path.relative_to(ROOT) for path in (ROOT / "stages").glob("*/*/")}
    missing = {str(folder) for folder in folders - named if folder.name != "__pycache__"}
    assert not missing

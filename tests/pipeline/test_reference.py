"""The reference pages say what the code says."""

import argparse

import pytest

from gsac.pipeline import commands
from gsac.pipeline.clip_check import ClipCheck, Prospect
from gsac.pipeline.project import Project, shipped_dag
from gsac.pipeline.reference import CHECK, FINDING, cli_page, pages, stage_page
from gsac.stages.findings import Code, Finding
from gsac.stages.first_look import FirstLook
from gsac.stages.severity import Severity

DOCS = shipped_dag().with_name("docs")
PROJECT = Project("gsac.stages", shipped_dag())


@pytest.fixture(scope="module")
def made():
    assert not commands.not_installed(commands.load_added()), "run `make setup`"
    return pages(PROJECT)


def test_the_pages_in_docs_are_those_that_the_code_gives(made):
    for path, text in made.items():
        assert (DOCS / path).is_file() and (DOCS / path).read_text() == text, f"docs/{path} is not up to date: run `make docs`"


def test_there_is_a_page_for_each_stage_and_for_nothing_else(made):
    assert {f"stages/{page.name}" for page in (DOCS / "stages").iterdir()} == set(made) - {
        "cli.md", "quality.md", "events.md", "findings.md"}


@pytest.mark.parametrize("name", commands.COMMANDS)
def test_every_argument_of_every_command_is_named_with_its_meaning(name, made):
    section = made["cli.md"].split(f"## gsac {name}\n")[1].split("\n## ")[0]
    parser = argparse.ArgumentParser(add_help=False)
    commands.load(name).declare(parser)
    parsers = [parser, *(one for action in parser._actions for one in (action.choices or {}).values())]
    for action in (action for one in parsers for action in one._actions):
        for option in set(action.option_strings) - {"-h", "--help"}:
            assert f"| `{option}" in section or f"`, `{option}" in section, option
    assert "|  |" not in section, "an argument has no help"


def test_every_parameter_stands_on_its_stages_page_with_default_and_meaning(made):
    page = made["stages/split.md"]
    assert "| `split.count` | int or null | `120` | Most frames kept in all" in page
    assert "`frames`" in page and "[keypoints](keypoints.md)" in page


@pytest.mark.parametrize("code", Code)
def test_every_code_of_a_finding_stands_on_its_page_with_severity_and_advice(code, made):
    row = next(line for line in made["findings.md"].splitlines() if line.startswith(f"| `{code.word}` |"))
    assert row.startswith(f"| `{code.word}` | `{code.value.severity.value}` | ") and row.endswith(f" | {code.value.advice} |")


def test_every_field_of_a_finding_and_of_a_check_has_its_meaning(made):
    look = FirstLook(1, 1, 1.0, 360.0, 1.0, 1.0)
    assert list(FINDING) == list(Finding.of(Code.FACE_AT_REST).to_json())
    assert list(CHECK) == list(ClipCheck(look, None, []).to_json())
    for word in (*FINDING, *CHECK, *vars(look), *Severity, *(prospect.value for prospect in Prospect)):
        assert f"| `{word}` | " in made["findings.md"], word
    assert "|  |\n" not in made["findings.md"].split("## What `gsac check")[1].replace("| field |  |\n", "")


def test_a_stage_of_another_project_has_its_page(toy):
    toy.edit("left/__init__.py", "from dataclasses", '"""left: spells a word.\n\nin capitals | only <so>\n"""\nfrom dataclasses')
    with toy.importable():
        page = stage_page(Project("gsac.toy", toy.package / "dvc.yaml"), "left")
    assert page.startswith("# left\n") and "Spells a word." in page
    assert "| `left.word` | str | `first` | Which word: `first` or `last`. |" in page
    assert "| `cut/words` | [cut](cut.md) |" in page and "| `out.txt` | [join](join.md) |" in page
    assert "- versions of packages: toyware" in page


def test_commands_by_entry_point_stand_on_the_page(monkeypatch):
    class Shout:
        HELP = "say it loudly"

        @staticmethod
        def declare(command: argparse.ArgumentParser) -> None:
            command.add_argument("word", metavar="WORD", help="what to say, `a|b` or <c>")

    monkeypatch.setattr(commands, "load_added", lambda: {"shout": Shout})
    monkeypatch.setattr(commands, "not_installed", lambda added: set())
    page = cli_page()
    assert "## gsac shout\n\nSay it loudly.\n\n```\ngsac shout WORD\n```" in page
    assert "| `WORD` | what to say, `a\\|b` or &lt;c> |" in page

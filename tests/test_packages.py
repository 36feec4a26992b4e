"""Every package of others earns its place: the code imports it, and the documents say what for."""

import importlib.metadata
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
NEEDED = {re.match(r"[\w-]+", requirement)[0] for requirement in PROJECT["dependencies"]}
EXTRAS = {re.match(r"[\w-]+", requirement)[0]
          for extra, requirements in PROJECT["optional-dependencies"].items() if extra != "dev" for requirement in requirements}
COMMANDS = ("avatar", "benchmarks", "cache", "pipeline", "stages", "turntable", "unity", "viewer")
"""Our packages, which the command is made of; what tests alone use belongs to the extra dev."""


def described() -> set[str]:
    section = (ROOT / "docs" / "licences.md").read_text().split("\n## What each package of others is for\n")[1].split("\n## ")[0]
    return {name for row in re.findall(r"^\| (`.*?) \|", section, re.MULTILINE) for name in re.findall(r"`([\w-]+)`", row)}


def test_the_documents_say_of_each_package_what_it_is_for_and_of_no_other():
    assert described() == NEEDED | EXTRAS


@pytest.fixture(scope="module")
def imported():
    """First words of all that our packages import, lazily or not, or look for."""
    sources = "\n".join(file.read_text() for package in COMMANDS for file in (ROOT / package).rglob("*.py"))
    return {word for found in re.findall(r'^\s*(?:import|from) (\w+)|find_spec\("(\w+)"', sources, re.MULTILINE) for word in found}


@pytest.mark.parametrize("package", sorted(NEEDED))
def test_a_package_that_every_user_installs_is_imported_by_a_command(imported, package):
    owned = {module for module, owners in importlib.metadata.packages_distributions().items()
             if package.lower() in {re.sub(r"[-_.]+", "-", owner).lower() for owner in owners}}
    assert (owned | {package, package.replace("-", "_")}) & imported

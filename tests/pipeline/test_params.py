from __future__ import annotations

from dataclasses import dataclass

import pytest
import yaml

from gsac.pipeline.params import meanings, resolve, to_yaml
from gsac.pipeline.project import Project
from gsac.stages.contract import BadInput, Stage, make_config


@dataclass
class Config:
    rate: float = 4e-5
    """Step size."""
    count: int | None = 120
    """How many,
    at most."""
    name: str = "on"
    """A word that YAML might take for a truth."""
    loud: bool = False
    """Whether to shout."""

    def check(self) -> None:
        if self.rate <= 0:
            raise BadInput(f"toy.rate is {self.rate}; expected a positive number")


STAGE = Stage(name="toy", inputs=(), outputs=(), config=Config)


def test_yaml_of_a_config_reads_back_as_the_same_values():
    text = to_yaml({"toy": Config(), "loud": Config(loud=True, count=None)})
    assert yaml.safe_load(text) == {
        "toy": {"rate": 4e-5, "count": 120, "name": "on", "loud": False},
        "loud": {"rate": 4e-5, "count": None, "name": "on", "loud": True},
    }


def test_every_parameter_carries_its_meaning():
    assert meanings(Config)["count"] == "How many, at most."
    assert "  # Step size.\n  rate: " in to_yaml({"toy": Config()})


@pytest.mark.parametrize(("values", "expected"), [
    ({"rate": 1}, 1.0), ({"rate": "4e-4"}, 4e-4), ({"rate": 0.25}, 0.25),
])
def test_numbers_become_floats_so_that_equal_values_have_equal_keys(values, expected):
    rate = make_config(STAGE, values).rate
    assert rate == expected and isinstance(rate, float)


@pytest.mark.parametrize(("values", "words"), [
    ({"rat": 1}, ["toy.rat", "count, loud, name, rate"]),
    ({"rate": "fast"}, ["toy.rate", "'fast'", "float"]),
    ({"rate": True}, ["toy.rate", "True", "float"]),
    ({"count": 1.5}, ["toy.count", "1.5", "int or null"]),
    ({"loud": "yes"}, ["toy.loud", "'yes'", "bool"]),
    ({"name": 3}, ["toy.name", "3", "str"]),
    ({"rate": None}, ["toy.rate", "None", "float"]),
    ({"rate": -1}, ["toy.rate", "-1"]),
])
def test_a_wrong_parameter_is_named_with_its_value_and_what_was_expected(values, words):
    with pytest.raises(BadInput) as error:
        make_config(STAGE, values)
    for word in words:
        assert word in str(error.value)


def test_later_sources_win_and_types_are_those_of_yaml(toy):
    file = toy.root / "mine.yaml"
    file.write_text("left: {word: last}\nright: {word: last, keep: 3}\n")
    rows = toy.run("--params", file, "--set", "right.word=first", "--set", "cut.keep=2").json["stages"]
    params = {row["name"]: row["params"] for row in rows}
    assert params["left"]["word"] == "last" and params["right"] == params["left"] | {"word": "first", "keep": 3}
    assert params["cut"]["keep"] == 2
    assert yaml.safe_load((toy.out / "params.yaml").read_text()) == params


@pytest.mark.parametrize(("content", "words"), [
    ("left: {wrd: x}", ["mine.yaml", "left.wrd", "known: keep, model, pause_s, trouble, word"]),
    ("left: {word: middle}", ["mine.yaml", "left.word", "middle", "first, last"]),
    ("leftt: {word: last}", ["mine.yaml", "leftt", "cut, left, right, join"]),
    ("left: {1: 2}", ["mine.yaml", "unknown parameter left.1; known: keep"]),
    ("1: {word: last}", ["mine.yaml", "unknown section '1'; known: cut"]),
    ("left: 3", ["mine.yaml", "left", "3"]),
    ("left:\n  word: last\n  word: first\n", ["mine.yaml", "line 3", "word", "second time"]),
    ("left: {word: last}\nleft: {keep: 1}\n", ["mine.yaml", "line 2", "left", "second time"]),
    ("left: [", ["mine.yaml", "YAML"]),
    ("- 1", ["mine.yaml", "sections"]),
    (b"\xff\xfe\x00", ["mine.yaml", "cannot be read"]),
])
def test_a_bad_parameter_file_is_named_with_what_is_wrong(toy, content, words):
    file = toy.root / "mine.yaml"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    done = toy.gsac("run", toy.clip, "--params", file)
    assert done.code == 2
    for word in [*words]:
        assert word in done.err
    assert "Traceback" not in done.err and toy.runs == []


@pytest.mark.parametrize("text", ["left", "left.word", "=3", "left=3", "left.wrd=1", "lft.word=last", "left.keep={"])
def test_a_bad_set_is_named(toy, text):
    done = toy.gsac("run", toy.clip, "--set", text)
    assert done.code == 2 and f"--set {text}" in done.err and toy.runs == []


def test_parameters_that_need_each_other_may_come_in_any_order():
    project = Project.at_hand()
    two = ("face.method=deca", "face.flame=mine")
    assert resolve(project, sets=two)["face"] == resolve(project, sets=two[::-1])["face"]
    with pytest.raises(BadInput, match="--set face.method=deca: face.method is deca, but face.flame is none"):
        resolve(project, sets=("face.doubt=2", "face.method=deca"))

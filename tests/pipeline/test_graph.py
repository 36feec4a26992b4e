import pytest

from gsac.pipeline.graph import Graph, parse_yaml
from gsac.stages.contract import BadInput

CHAIN = """
stages:
  c: {cmd: gsac stage c, deps: [b/y, a/x], outs: [c/z: {cache: false}]}
  b: {cmd: gsac stage b, deps: [a/x], params: [b], outs: [b/y]}
  a: {cmd: gsac stage a, deps: [clip], outs: [a/x]}
  d: {cmd: gsac stage d, deps: [a/x], outs: [d/w]}
"""


def load(tmp_path, text) -> Graph:
    file = tmp_path / "dvc.yaml"
    file.write_text(text)
    return Graph.load(file)


def test_steps_come_after_what_they_read(tmp_path):
    graph = load(tmp_path, CHAIN)
    order = list(graph.steps)
    for name, step in graph.steps.items():
        assert all(order.index(parent) < order.index(name) for parent in graph.parents(name))
        assert step.name == name


def test_above_and_below_follow_the_edges(tmp_path):
    graph = load(tmp_path, CHAIN)
    assert graph.above("c") == {"a", "b"} and graph.above("a") == set()
    assert graph.below("a") == {"b", "c", "d"} and graph.below("d") == set()


def test_what_dvc_shows_of_the_results_is_left_to_dvc(tmp_path):
    assert load(tmp_path, CHAIN + "metrics: [m.json]\nplots: [p: {y: {m.json: loss}}]\n").steps.keys() == set("abcd")


@pytest.mark.parametrize(("text", "words"), [
    ("stages: {a: {foreach: [1], do: {cmd: x}}}", ["step a", "'foreach'"]),
    ("stages: {a: {cmd: gsac stage a, wdir: x}}", ["step a", "'wdir'"]),
    ("stages: {a: {cmd: gsac stage a}}\nvars: [x]", ["'vars'"]),
    ("stages: {a: {cmd: python train.py}}", ["step a", "'python train.py'", "gsac stage a"]),
    ("stages: {a: {cmd: gsac stage a, outs: [a/x: {persist: true}]}}", ["a/x", "'persist'"]),
    ("stages: {a: {cmd: gsac stage a, outs: [x]}}", ["step a", "x", "a/"]),
    ("stages: {a: {cmd: gsac stage a, params: [b]}}", ["step a", "'b'"]),
    ("stages: {a: {cmd: gsac stage a, params: [{other.yaml: [a]}]}}", ["step a", "params"]),
    ("stages: {a: {cmd: gsac stage a, deps: [b/x]}}", ["step a", "b/x"]),
    ("stages: {a: {cmd: gsac stage a, deps: [b/x], outs: [a/x]}, b: {cmd: gsac stage b, deps: [a/x], outs: [b/x]}}",
     ["a, b", "circle"]),
    ("stages: [", ["not valid YAML"]),
    ("- 1", ["stages"]),
])
def test_what_it_does_not_read_is_named(tmp_path, text, words):
    with pytest.raises(BadInput) as error:
        load(tmp_path, text)
    for word in ["dvc.yaml", *words]:
        assert word in str(error.value)


LAUGHS = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n" for before, name in zip("abcdefghi", "bcdefghij", strict=True))


@pytest.mark.parametrize(("text", "words"), [
    (LAUGHS, "line 6: with its aliases written out it has more than 1048576 characters"),
    ("a: &a [*a]", r"line 1: \*a names nothing that ends before it"),
    ("[" * 100_000, "line 1: it is more than 50 levels deep"), ("{" * 100_000, "line 1: it is more than 50 levels deep"),
    ("- " * 20_000, "line 1: it is more than 50 levels deep"), ("x" * (1 << 20) + "y", "it has more than 1048576 characters"),
    ("a:\n  b: " + "9" * 5000, "line 2: a number of 5000 digits; at most 40 are read"),
    ("a: 2001-99-99", "not valid YAML .month"), ("a: !!int ''", "not valid YAML"), ("a: !!timestamp x", "not valid YAML"),
    ("a: !!bool x", "not valid YAML")])
def test_a_hostile_text_is_answered_at_once_with_the_bound(text, words):
    with pytest.raises(BadInput, match=f"mine.yaml: {words}"):
        parse_yaml(text, "mine.yaml")


@pytest.mark.parametrize("number", ["010", "-012", "00", "1:30", "190:20:30.15"])
def test_a_number_that_yamls_versions_read_differently_is_refused(number):
    with pytest.raises(BadInput, match=f"line 2: {number} is another number to some readers of YAML"):
        parse_yaml(f"split:\n  count: {number}", "mine.yaml")
    assert parse_yaml(f"'{number}'", "mine.yaml") == number


def test_anchors_and_plain_numbers_are_read():
    text = "a: &few {count: 10, rate: 0.5, mask: 0x1F}\nb: {<<: *few, count: -0}\nc: *few"
    few = {"count": 10, "rate": 0.5, "mask": 31}
    assert parse_yaml(text, "mine.yaml") == {"a": few, "b": few | {"count": 0}, "c": few}

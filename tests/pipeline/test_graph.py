import pytest

from gsac.pipeline.graph import Graph
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

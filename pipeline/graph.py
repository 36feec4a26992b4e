"""dvc.yaml as a graph: steps in running order, and which needs which.

Reads the part of DVC's format that one clip needs, and refuses the rest by name:
`cmd: gsac stage NAME`, `deps`, `params` (whole sections), `outs` (optionally `cache: false`), `desc`. Beside the stages
`metrics` and `plots` may say what DVC shows; gsac leaves those to DVC.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gsac.stages.contract import BadInput, did_you_mean

CLIP = "clip"
"""The port of the source clip; no step makes it."""
TOP_KEYS = ("stages", "metrics", "plots")
STEP_KEYS = ("cmd", "deps", "params", "outs", "desc")
OUT_OPTIONS = ("cache",)
MOST_CHARACTERS = 1 << 20
"""Of a YAML text, and of what it says once its aliases are written out."""
MOST_DEPTH = 50
MOST_DIGITS = 40
OLD_NUMBER = re.compile(r"[-+]?0[0-9_]+|[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?")
"""Numbers that YAML 1.1 counts in eights or in sixties, and YAML 1.2 and people do not."""


@dataclass(frozen=True)
class Step:
    """One entry of dvc.yaml."""

    name: str
    cmd: str
    deps: tuple[str, ...]
    """Ports read: `clip` or `<step>/<output path>`."""
    params: tuple[str, ...]
    """Sections of params.yaml."""
    outs: tuple[str, ...]
    """Ports written, `<name>/<output path>`."""


class Graph:
    """Steps by name, each after the steps whose outputs it reads."""

    def __init__(self, steps: list[Step], source: str = "dvc.yaml"):
        self.source = source
        self.producer: dict[str, str] = {}
        for step in steps:
            for port in step.outs:
                if port in self.producer:
                    raise BadInput(f"{source}: {port} is made by both {self.producer[port]} and {step.name}")
                self.producer[port] = step.name
        for step in steps:
            for port in step.deps:
                if port != CLIP and port not in self.producer:
                    raise BadInput(f"{source}: step {step.name} reads {port}, which no step makes")
        self.steps = self._ordered(steps)

    @classmethod
    def load(cls, path: Path) -> Graph:
        """The graph of a dvc.yaml. BadInput names the file, the step and the key that is not understood."""
        return cls(_parse(read_yaml(path), str(path)), str(path))

    def _ordered(self, steps: list[Step]) -> dict[str, Step]:
        done: dict[str, Step] = {}
        waiting = list(steps)
        while waiting:
            ready = next((s for s in waiting if all(p == CLIP or self.producer[p] in done for p in s.deps)), None)
            if ready is None:
                raise BadInput(f"{self.source}: {', '.join(s.name for s in waiting)} need each other in a circle")
            done[ready.name] = ready
            waiting.remove(ready)
        return done

    def step(self, name: str) -> Step:
        """The step of a name; BadInput where there is none."""
        if name not in self.steps:
            raise BadInput(f"unknown stage {name}{did_you_mean(name, self.steps)}; known: {', '.join(self.steps)}")
        return self.steps[name]

    def parents(self, name: str) -> set[str]:
        """Steps whose outputs `name` reads."""
        return {self.producer[p] for p in self.step(name).deps if p != CLIP}

    def above(self, name: str) -> set[str]:
        """Every step that `name` needs, directly or not."""
        found: set[str] = set()
        todo = [name]
        while todo:
            new = self.parents(todo.pop()) - found
            found |= new
            todo.extend(new)
        return found

    def below(self, name: str) -> set[str]:
        """Every step that needs `name`, directly or not."""
        self.step(name)
        return {other for other in self.steps if name in self.above(other)}


def read_yaml(path: Path) -> dict[str, Any]:
    """Mapping of a YAML file; {} for an empty one."""
    try:
        with Path(path).open() as file:
            text = file.read(MOST_CHARACTERS + 1)
    except (OSError, UnicodeDecodeError) as e:
        raise BadInput(f"{path}: cannot be read ({getattr(e, 'strerror', None) or e})") from e
    return parse_yaml(text, str(path)) or {}


def parse_yaml(text: str, source: str) -> Any:
    """The value of a YAML text. BadInput where it is not YAML, is larger or deeper than is read, has a number that YAML's versions
    read differently, or a key is given twice (YAML would keep the last)."""
    import yaml

    base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

    class Loader(base):
        def construct_mapping(self, node: Any, deep: bool = False) -> dict:
            seen = set()
            for key, _ in node.value:
                if str(key.value) in seen:
                    raise BadInput(f"{source}: line {key.start_mark.line + 1}: {key.value} is given a second time; keep one")
                seen.add(str(key.value))
            return super().construct_mapping(node, deep)

        def construct_scalar(self, node: Any) -> Any:
            value = super().construct_scalar(node)
            where = f"{source}: line {node.start_mark.line + 1}"
            if node.tag.endswith((":int", ":float")) and len(value) > MOST_DIGITS:
                raise BadInput(f"{where}: a number of {len(value)} digits; at most {MOST_DIGITS} are read")
            if not node.style and node.tag.endswith((":int", ":float")) and OLD_NUMBER.fullmatch(value):
                raise BadInput(f"{where}: {value} is another number to some readers of YAML (a leading 0 counts in eights, a colon "
                               "in sixties); write it plainly, or in quotes where it is text")
            return value

    try:
        _check_bounds(text, Loader, source)
        return yaml.load(text, Loader)  # noqa: S506, both base loaders are safe ones
    except BadInput:
        raise
    except Exception as e:  # beside its own errors yaml raises what Python does of an odd number or date
        if isinstance(e, yaml.MarkedYAMLError) and "nesting depth" in str(e):  # its own bound, which it meets by looking ahead
            mark = e.problem_mark or e.context_mark
            raise too_deep(f"{source}: line {mark.line + 1}" if mark else source) from e
        raise BadInput(f"{source}: not valid YAML ({' '.join(str(e).split()) or type(e).__name__})") from e


def too_deep(where: str) -> BadInput:
    """The error of a text with more levels than are read. where: file and line."""
    return BadInput(f"{where}: it is more than {MOST_DEPTH} levels deep, which is the most that is read")


def _check_bounds(text: str, loader: Any, source: str) -> None:
    """BadInput where the text is too long or too deep; before a value is made, since the parser's own recursion has no bound."""
    import yaml

    if len(text) > MOST_CHARACTERS:
        raise BadInput(f"{source}: it has more than {MOST_CHARACTERS} characters, which is the most that is read")
    says, sizes, opened = 0, {}, []  # characters so far; of each anchor; of each collection around, its anchor and where it began
    for event in yaml.parse(text, loader):
        if isinstance(event, yaml.CollectionEndEvent):
            anchor, began = opened.pop()
            sizes[anchor] = says - began
            continue
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in sizes:
                raise BadInput(f"{source}: line {event.start_mark.line + 1}: *{event.anchor} names nothing that ends before it")
            says += sizes[event.anchor]
        elif isinstance(event, yaml.ScalarEvent):
            says += len(event.value) + 1
            sizes[event.anchor] = len(event.value) + 1
        elif isinstance(event, yaml.CollectionStartEvent):
            opened.append((event.anchor, says))
            says += 1
        where = f"{source}: line {event.start_mark.line + 1}"
        if len(opened) > MOST_DEPTH:
            raise too_deep(where)
        if says > MOST_CHARACTERS:
            raise BadInput(f"{where}: with its aliases written out it has more than {MOST_CHARACTERS} characters, which is the "
                           "most that is read")


def _parse(document: Any, source: str) -> list[Step]:
    if not isinstance(document, dict) or not isinstance(document.get("stages"), dict):
        raise BadInput(f"{source}: expected a mapping with `stages`")
    _only(document, TOP_KEYS, source, "the file")
    return [_step(name, body, source) for name, body in document["stages"].items()]


def _step(name: str, body: Any, source: str) -> Step:
    where = f"step {name}"
    if not isinstance(body, dict):
        raise BadInput(f"{source}: {where} must be a mapping")
    _only(body, STEP_KEYS, source, where)
    cmd = f"gsac stage {name}"
    if body.get("cmd") != cmd:
        raise BadInput(f"{source}: {where} has the command {body.get('cmd')!r}; gsac only reads `{cmd}`")
    outs = tuple(_out(out, source, where) for out in _list(body, "outs", source, where))
    for out in outs:
        if not out.startswith(f"{name}/"):
            raise BadInput(f"{source}: {where} makes {out}; outputs must lie in {name}/")
    deps = tuple(_text(d, "deps", source, where) for d in _list(body, "deps", source, where))
    params = tuple(_text(p, "params", source, where) for p in _list(body, "params", source, where))
    for section in params:
        if section != name:
            raise BadInput(f"{source}: {where} reads the parameters {section!r}; it may only read its section {name!r}")
    return Step(name, cmd, deps, params, outs)


def _only(mapping: dict, known: tuple[str, ...], source: str, where: str) -> None:
    for key in mapping:
        if key not in known:
            raise BadInput(f"{source}: {where} uses {key!r}, which gsac does not read; it reads {', '.join(known)}")


def _list(body: dict, key: str, source: str, where: str) -> list:
    value = body.get(key) or []
    if not isinstance(value, list):
        raise BadInput(f"{source}: {where}: {key} must be a list")
    return value


def _text(value: Any, key: str, source: str, where: str) -> str:
    if not isinstance(value, str):
        raise BadInput(f"{source}: {where}: {key} has the entry {value!r}; gsac only reads plain names there")
    return value


def _out(value: Any, source: str, where: str) -> str:
    if isinstance(value, dict) and len(value) == 1:
        path, options = next(iter(value.items()))
        if not isinstance(options, dict):
            raise BadInput(f"{source}: {where}: output {path}: options must be a mapping")
        _only(options, OUT_OPTIONS, source, f"{where}: output {path}")
        value = path
    return _text(value, "outs", source, where)

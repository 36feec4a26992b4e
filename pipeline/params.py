"""Parameters: defaults of the stages' dataclasses, overridden by --quality, --params FILE, then --set; and params.yaml, made from
them."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from gsac.pipeline.graph import parse_yaml, read_yaml
from gsac.pipeline.project import Project
from gsac.stages.contract import BadInput, did_you_mean, make_config

HEAD = "# Every parameter, its default and its meaning. Written by `python -m gsac.pipeline.params` from them.\n\n"
Values = dict[str, dict[str, Any]]
"""Section -> parameter -> value."""


def resolve(project: Project, file: Path | None = None, sets: Iterable[str] = (), only: str = "",
            options: Mapping[str, Values] | None = None, below: Mapping[str, Values] | None = None) -> dict[str, Any]:
    """Config instance of every stage, or of `only` one. options: values by the option that gave them, which come after the file and
    before `sets`; below: the same, which come before the file. BadInput names the parameter and its source."""
    wanted = [only] if only else list(project.graph.steps)
    sources: list[tuple[str, Values]] = list((below or {}).items())
    if file is not None:
        sources.append((str(file), _sections(read_yaml(file), str(file))))
    sources.extend((options or {}).items())
    sources.extend((f"--set {text}", _assignment(text)) for text in sets)
    values: Values = {name: {} for name in project.graph.steps}
    configs, faults = {}, {}
    for source, sections in sources:
        for section, parameters in sections.items():
            if section not in values:
                known = ", ".join(project.graph.steps)
                raise BadInput(f"{source}: unknown section {section!r}{did_you_mean(section, values)}; known: {known}")
            if section not in wanted:
                continue
            values[section] |= parameters
            try:
                configs[section] = make_config(project.stage(section), values[section])
                faults.pop(section, None)  # a later value may mend what an earlier one alone makes no sense without
            except BadInput as e:
                faults.setdefault(section, (source, e))
    for source, fault in faults.values():
        raise BadInput(f"{source}: {fault}") from fault
    return {name: configs.get(name) or make_config(project.stage(name), {}) for name in wanted}


def config_values(config: Any) -> dict[str, Any]:
    """Config instance as parameter -> value."""
    return dataclasses.asdict(config)


def to_yaml(configs: dict[str, Any], notes: bool = True) -> str:
    """params.yaml with every parameter; notes: with the meaning of each above it."""
    blocks = []
    for section, config in configs.items():
        values = config_values(config)
        if not values:
            blocks.append(f"{section}: {{}}\n")
            continue
        meaning = meanings(type(config)) if notes else {}
        lines = [f"{section}:"]
        for name, value in zip(values, _scalars(values.values()), strict=True):
            if name in meaning:
                lines.extend(textwrap.wrap(meaning[name], 116, initial_indent="  # ", subsequent_indent="  # "))
            lines.append(f"  {name}: {value}")
        blocks.append("\n".join(lines) + "\n")
    return "\n".join(blocks)


def defaults_yaml(project: Project) -> str:
    """Text of the params.yaml that is shipped."""
    return HEAD + to_yaml(resolve(project))


def meanings(config: type) -> dict[str, str]:
    """Field -> the line of meaning under it in the source of a dataclass, or of an enum."""
    declaration = ast.parse(textwrap.dedent(inspect.getsource(config))).body[0]
    assert isinstance(declaration, ast.ClassDef)
    found = {}
    for field, after in itertools.pairwise(declaration.body):
        target = field.target if isinstance(field, ast.AnnAssign) else field.targets[0] if isinstance(field, ast.Assign) else None
        if isinstance(target, ast.Name) and isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            found[target.id] = " ".join(str(after.value.value).split())
    return found


def _scalars(values: Iterable[Any]) -> list[str]:
    """YAML of values, a line each."""
    import yaml

    text = yaml.dump_all(values, Dumper=getattr(yaml, "CSafeDumper", yaml.SafeDumper), default_flow_style=True, width=10**6,
                         explicit_start=True)
    return [line.removeprefix("--- ") for line in text.splitlines() if line != "..."]


def _sections(document: Any, source: str) -> Values:
    if not isinstance(document, dict):
        raise BadInput(f"{source}: expected sections of parameters, found {type(document).__name__}")
    for section, parameters in document.items():
        if parameters is not None and not isinstance(parameters, dict):
            raise BadInput(f"{source}: section {section} must hold parameters, found {parameters!r}")
    return {str(section): {str(name): value for name, value in (parameters or {}).items()}  # YAML takes 1 and off for no words
            for section, parameters in document.items()}


def _assignment(text: str) -> Values:
    name, equals, value = text.partition("=")
    section, dot, parameter = name.strip().partition(".")
    if not (equals and dot and section and parameter):
        raise BadInput(f"--set {text}: expected stage.parameter=value, for example split.fps=8")
    return {section: {parameter: parse_yaml(value, f"--set {text}")}}


def main() -> None:
    """Rewrites params.yaml beside the checkout's dvc.yaml."""
    project = Project.at_hand()
    project.dag.with_name("params.yaml").write_text(defaults_yaml(project))


if __name__ == "__main__":
    main()

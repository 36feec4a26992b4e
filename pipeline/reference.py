"""Writes the reference pages from the code: docs/cli.md of all commands, docs/quality.md of the presets, docs/events.md of what
runs tell, docs/findings.md of what stages find wrong with a clip, docs/stages/<name>.md of each stage."""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import inspect
import re
import types
import typing
from collections.abc import Iterable, Iterator
from typing import Any

from gsac.pipeline import commands
from gsac.pipeline.cli import make_parser
from gsac.pipeline.clip_check import FRAMES, Prospect
from gsac.pipeline.cost_model import stage_cost
from gsac.pipeline.event_file import LIMIT, PROGRESS_GAP_S
from gsac.pipeline.events import KINDS, LONGEST, Event, StageEvent
from gsac.pipeline.footage import Footage, keep
from gsac.pipeline.graph import CLIP
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.pipeline.pace import duration
from gsac.pipeline.params import Values, config_values, meanings, resolve
from gsac.pipeline.plan import Reason
from gsac.pipeline.project import Project
from gsac.pipeline.quality import QUALITIES, dial_names
from gsac.pipeline.run_folder import EVENTS, OLDER_EVENTS
from gsac.stages.contract import BadInput, Stage
from gsac.stages.findings import Code
from gsac.stages.first_look import FirstLook
from gsac.stages.severity import Severity

WRITTEN = "<!-- Written by `make docs` from the code; edit the docstrings there. -->\n"


EVENTS_LEAD = f"""\
Whatever a run or a batch tells is an event: the terminal, `batch.json`, `batch.prom` and traces are drawn from the same stream.

- `{EVENTS}` in the folder of a run or a batch holds them, a JSON object a line; later runs append. From {LIMIT >> 20} MB on it goes
  on in a new file, and the one before is `{OLDER_EVENTS}`. A batch's file leaves progress and lines of logs to those of its clips;
  a clip's keeps the progress of a stage every {PROGRESS_GAP_S:g} s at most.
- `gsac events [DIR]` prints them as a person reads them, progress and lines of logs only with `--follow` or `-v`.
- `gsac run --events` and `gsac batch --events` print them on stdout as they happen, before the result.
- With `pip install 'gsac[otel]'` and `OTEL_EXPORTER_OTLP_ENDPOINT=http://HOST:4318` they become a trace, sent over HTTP: a span
  for the batch, in it one a clip, in it one a stage, with key, outcome, device and figures. `OTEL_*` is all its configuration.
  Names of clips and errors stay out unless `OTEL_RESOURCE_ATTRIBUTES` has `gsac.names=true`.

The field `event` holds the kind, by the names below. A field that holds what it holds without being told (empty, 0, null, the first
attempt) is left out. A text of more than {LONGEST:,} characters is cut to that, its last one `…`. Readers pass over kinds and
fields that they do not know, and over a line that is no JSON: a kill cuts the last one off."""


FINDINGS_LEAD = """\
What a stage finds wrong with a clip is a sentence for people and a finding for programs.

- `run.json` in the folder of a run, and `--json` of `gsac run`, have in each stage of `stages` the sentences as `warnings` and
  their findings, in the same order, as `findings`. A result that an older version computed may have sentences alone.
- `events.jsonl` has code and severity with each warning ([events](events.md#stage_warning)); `batch.prom` counts warnings by code.
- `gsac check --json` has the findings of all stages in one list, each with its sentence (`message`)."""
FINDING = {
    "code": "One of the [codes](#codes).",
    "severity": "Of the code.",
    "frames": "The frames concerned: runs of them, `[first, last]`, from 0; empty where it is the clip as a whole.",
    "figure": "How much or how many, `{figure}` of the sentence, a share as 0..1; null where there is none.",
}
"""Field of a finding -> its meaning."""
CHECK = {
    "prospect": "One of the words below.",
    "seen": "The clip at a glance, below.",
    "times_s": f"When the {FRAMES} frames or fewer that were looked at lie in the clip, s; null for photos.",
    "findings": "Each with `message`. Their frames count among those that were looked at.",
}
"""Field of `gsac check --json`, besides those of every command -> its meaning."""


EXAMPLE, EXAMPLE_CORES = Footage(60, 720, 1280), 2
"""Frames and cores that the times of the presets are given for."""


def pages(project: Project) -> dict[str, str]:
    """Path below docs/ -> text, of every page."""
    return {"cli.md": cli_page(), "quality.md": quality_page(project), "events.md": events_page(),
            "findings.md": findings_page(),
            **{f"stages/{name}.md": stage_page(project, name) for name in project.graph.steps}}


def cli_page() -> str:
    """The command line: global options, every command, exit codes, and the words of --json."""
    added = commands.load_added()
    if missing := commands.not_installed(added):
        raise BadInput(f"{', '.join(sorted(missing))}: {commands.SETUP}")
    helps = commands.COMMANDS | {name: module.HELP for name, module in added.items()}
    blocks = ["# Command line", WRITTEN.strip(), "`gsac COMMAND ...`, with these options before the command's name or after it:",
              _argument_table(_arguments(make_parser([]))),
              _table(("command", ""), ((f"[{name}](#gsac-{name})", text) for name, text in helps.items()))]
    for name, text in helps.items():
        parser = argparse.ArgumentParser(prog=f"gsac {name}", add_help=False)
        (added.get(name) or commands.load(name)).declare(parser)
        blocks += [f"## gsac {name}", f"{text[0].upper()}{text[1:]}.", *_command(parser)]
    blocks += ["## Exit codes", _table(("code", ""), ((str(int(code)), code.sentence) for code in ExitCode)),
               "## Words of `--json`", "`status` of a stage:", _words(Outcome),
               "`reason`, why a stage has to run or need not:", _words(Reason)]
    return "\n\n".join(blocks) + "\n"


def events_page() -> str:
    """Every kind of event with its fields."""
    blocks = ["# Events", WRITTEN.strip(), EVENTS_LEAD, "## Every event", _fields(Event, ()),
              "## Events of a stage, besides", _fields(StageEvent, _own_fields(Event))]
    for kind in KINDS.values():
        base = StageEvent if issubclass(kind, StageEvent) else Event
        blocks += [f"## {kind.kind}", inspect.getdoc(kind) or "", _fields(kind, _own_fields(base))]
    return "\n\n".join(filter(None, blocks)) + "\n"


def findings_page() -> str:
    """Every code with severity, sentence and advice; the fields of a finding, and what `gsac check --json` has besides."""
    graves, seen = meanings(Severity), meanings(FirstLook)
    codes = ((f"`{code.word}`", f"`{code.value.severity.value}`", _plain(code.value.sentence), code.value.advice) for code in Code)
    prospects = ((f"`{word.value}`", word.sentence, str(int(word.exit_code))) for word in Prospect)
    blocks = ["# Findings", WRITTEN.strip(), FINDINGS_LEAD, _table(("field", ""), _as_code(FINDING)),
              "## Severities", _table(("severity", "what it takes from the avatar"),
                                      ((f"`{severity.value}`", graves[severity.name]) for severity in Severity)),
              "## Codes",
              "In the sentences `{frames}` are the frames concerned, `{figure}` is the figure; other names stand for "
              "words and numbers.", _table(("code", "severity", "sentence", "what to do"), codes),
              "## What `gsac check --json` has besides", _table(("field", ""), _as_code(CHECK)),
              "`prospect`, by the worst finding:", _table(("word", "", "exit code"), prospects),
              "`seen`; sizes in px, 0 where the part was never seen:",
              _table(("field", ""), _as_code({field.name: seen[field.name] for field in dataclasses.fields(FirstLook)}))]
    return "\n\n".join(blocks) + "\n"


def _as_code(rows: dict[str, str]) -> Iterator[tuple[str, str]]:
    return ((f"`{name}`", text) for name, text in rows.items())


def _plain(sentence: str) -> str:
    """A format string with the names of its words alone, as `code`."""
    return re.sub(r"\{(\w+)[^}]*\}", r"`{\1}`", sentence)


def _own_fields(kind: type[Event]) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(kind))


def _fields(kind: type[Event], without: tuple[str, ...]) -> str:
    """A table of a kind's fields; empty where it has none of its own."""
    hints, said = typing.get_type_hints(kind), meanings(kind)
    rows = [(f"`{name}`", _kind(hints[name]), said.get(name, "")) for name in _own_fields(kind) if name not in without]
    return _table(("field", "type", ""), rows) if rows else ""


def quality_page(project: Project) -> str:
    """The presets of --quality: what each is for, and the parameters that it sets."""
    blocks = ["# Quality", WRITTEN.strip(), "`gsac run CLIP --quality NAME`, also `gsac demo` and `gsac batch`, takes one of:",
              _table(("preset", "what it is for"), ((f"`{quality.name}`", quality.sentence) for quality in QUALITIES.values())),
              "A preset sets the parameters in bold and leaves all others as they are. What `--params` or `--set` says comes after "
              "it. `run.json` and the report tell the preset, and which of these parameters were set otherwise.",
              _presets(project, "cpu"), "Where training runs on a GPU:", _presets(project, "cuda"),
              "The times are what the cost model (`pipeline/cost_model.py`) says of the machine that it was measured on. Before it "
              "starts, a run tells its own: scaled by the clip, by the stages that have to run, and by what earlier runs took on "
              "the machine at hand, as far as the cache holds them. `--dry-run` tells it alone. `run.json` keeps the last forecast "
              "beside what its stages took (`forecast`, with `ratio` and `cpu_ratio`)."]
    return "\n\n".join(blocks) + "\n"


def _presets(project: Project, device: str) -> str:
    """Values of all parameters that a preset sets, in bold, the defaults of those that it leaves, and the time of a run."""
    rows: list[tuple[str, ...]] = []
    for stage, key in dial_names():
        given = [quality.on(device).get(stage, {}) for quality in QUALITIES.values()]
        default = _value(getattr(project.stage(stage).config(), key))
        rows.append((f"`{stage}.{key}`", *(f"**{_value(values[key])}**" if key in values else default for values in given)))
    times = (duration(_whole_run(project, quality.on(device), device)) for quality in QUALITIES.values())
    frames = f"{EXAMPLE.frames} frames of {EXAMPLE.width} x {EXAMPLE.height} px, {EXAMPLE_CORES} cores"
    return _table(("parameter", *QUALITIES), [*rows, (f"whole run, about ({frames})", *times)])


def _whole_run(project: Project, values: Values, device: str) -> float:
    """s, of the example with these parameters."""
    configs = resolve(project, below={"": values})
    kept = keep(EXAMPLE, configs["split"].count, configs["split"].max_height)
    costs = [stage_cost(name, config, kept, device) for name, config in configs.items()]
    return sum(cost.seconds(EXAMPLE_CORES) for cost in costs if cost is not None)


def stage_page(project: Project, name: str) -> str:
    """One stage: its module's docstring, ports, parameters, and the rest of its key."""
    stage = project.stage(name)
    lead, *rest = (inspect.getdoc(importlib.import_module(f"{project.package}.{name}")) or f"{name}: no docstring").split("\n\n")
    title, _, sentence = lead.partition(": ")
    blocks = [f"# {title}", WRITTEN.strip(), f"{sentence[0].upper()}{sentence[1:]}"]
    blocks += [f"```text\n{part}\n```" if part.startswith("takes") else part for part in rest]
    blocks += ["## Takes", _table(("port", "made by"), ((f"`{port}`", _maker(project, port)) for port in stage.inputs)),
               "## Gives", _table(("output", "read by"), ((f"`{output.path}`", _readers(project, f"{name}/{output.path}"))
                                                          for output in stage.outputs)),
               "## Parameters", _parameters(stage)]
    return "\n\n".join([*blocks, "## Also part of its key", _dependencies(stage)]) + "\n"


def _maker(project: Project, port: str) -> str:
    return "the user" if port == CLIP else _link(project.graph.producer[port])


def _readers(project: Project, port: str) -> str:
    return ", ".join(_link(step.name) for step in project.graph.steps.values() if port in step.deps) or "the user"


def _link(stage: str) -> str:
    return f"[{stage}]({stage}.md)"


def _parameters(stage: Stage) -> str:
    config = stage.config()
    if not config_values(config):
        return "None."
    meaning, kinds = meanings(stage.config), typing.get_type_hints(stage.config)
    return _table(("parameter", "type", "default", "meaning"),
                  ((f"`{stage.name}.{name}`", _kind(kinds[name]), f"`{_value(value)}`", meaning[name])
                   for name, value in config_values(config).items()))


def _kind(hint: Any) -> str:
    """`float or null`"""
    if typing.get_origin(hint) is typing.Literal:
        return " or ".join(f"`{choice}`" for choice in typing.get_args(hint))
    kinds = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    return " or ".join("null" if kind is type(None) else getattr(kind, "__name__", str(kind)) for kind in kinds)


def _value(value: Any) -> str:
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value) or '""'


def _dependencies(stage: Stage) -> str:
    config = stage.config()
    rows = {"model files, with the defaults": stage.models(config),
            "model files, where they are here": stage.wishes(config),
            "versions of packages": stage.packages, "programs": tuple(stage.programs()),
            "device class": ("cpu or cuda",) if stage.uses_device(config) else ()}
    return "\n".join(["- its code, and the version of Python",
                      *(f"- {what}: {', '.join(names)}" for what, names in rows.items() if names)])


def _command(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Synopsis and arguments of a command, then those of its sub-commands."""
    below = next((action for action in parser._actions if isinstance(action, argparse._SubParsersAction)), None)
    if below is None:
        arguments = _arguments(parser)
        yield f"```\n{' '.join([parser.prog, *map(_synopsis, arguments)])}\n```"
        if arguments:
            yield _argument_table(arguments)
        return
    helps = {action.dest: action.help or action.dest for action in below._choices_actions}
    for name, one in below.choices.items():
        yield f"### {parser.prog} {name}"
        yield f"{helps[name][0].upper()}{helps[name][1:]}."
        one.prog = f"{parser.prog} {name}"
        yield from _command(one)


def _arguments(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    return [action for action in parser._actions if not isinstance(action, (argparse._HelpAction, argparse._SubParsersAction))]


def _synopsis(action: argparse.Action) -> str:
    """`[--out DIR]`, `--out FILE` where it is required, `CLIP`, `[NAME ...]`"""
    words = " ".join(filter(None, [*action.option_strings[-1:], _operand(action)]))
    may_miss = not action.required if action.option_strings else action.nargs in ("?", "*")
    return f"[{words}]" if may_miss else words


def _operand(action: argparse.Action) -> str:
    if action.nargs == 0:
        return ""
    name = str(action.metavar or action.dest.upper())
    return f"{name} ..." if action.nargs in ("*", "+", argparse.REMAINDER) else name


def _argument_table(arguments: Iterable[argparse.Action]) -> str:
    rows = ((", ".join(f"`{' '.join(filter(None, [option, _operand(action)]))}`" for option in action.option_strings)
             or f"`{_operand(action)}`", action.help or "") for action in arguments)
    return _table(("argument", "meaning"), rows)


def _words(words: type[Outcome] | type[Reason]) -> str:
    return _table(("word", ""), ((f"`{word.value}`", word.sentence) for word in words))


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *(tuple(map(_cell, row)) for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(text: str) -> str:
    """Escapes what Markdown would take for a table's border, and outside of `code` for a tag."""
    pieces = text.replace("|", "\\|").split("`")
    return "`".join(piece if at % 2 else piece.replace("<", "&lt;") for at, piece in enumerate(pieces))


def main() -> None:
    """Writes the pages into docs/ beside the checkout's dvc.yaml; removes pages of stages that are gone."""
    project = Project.at_hand()
    docs = project.dag.with_name("docs")
    written = {docs / path: text for path, text in pages(project).items()}
    for path, text in written.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    for old in set((docs / "stages").glob("*.md")) - written.keys():
        old.unlink()


if __name__ == "__main__":
    main()

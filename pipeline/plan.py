"""Which stages have to run, and why."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from enum import Enum

from gsac.cache.key import Change, ChangeKind, KeyParts
from gsac.cache.record import Record
from gsac.cache.store import Store
from gsac.pipeline.graph import Graph


class Reason(Enum):
    """Why a stage has to run, or need not; the value is the word of `--json`."""

    UP_TO_DATE = "up to date"
    FORCED = "forced"
    FIRST_RUN = "first run"
    INPUT = "input changed"
    PARAM = "parameter changed"
    CODE = "code changed"
    MODEL = "model file changed"
    PACKAGE = "package changed"
    DEVICE = "device changed"
    UPSTREAM = "upstream"
    OUTPUT = "output changed"
    NOT_SHOWN = "not in the folder"
    LOST = "result lost"
    STOPPED = "stopped before"

    @property
    def sentence(self) -> str:
        return _SENTENCES[self]


_SENTENCES = {
    Reason.UP_TO_DATE: "its result is in the cache",
    Reason.FORCED: "--force asks for it",
    Reason.FIRST_RUN: "there is no result of it in the cache yet",
    Reason.INPUT: "an input is not the one of any earlier run",
    Reason.PARAM: "a parameter has another value",
    Reason.CODE: "its code is another",
    Reason.MODEL: "a model file is another",
    Reason.PACKAGE: "a package has another version",
    Reason.DEVICE: "the device class is another",
    Reason.UPSTREAM: "it runs if the result of a stage above changes",
    Reason.OUTPUT: "the output in the folder is not the one in the cache",
    Reason.NOT_SHOWN: "its result is in the cache, and not all of it in the folder; `gsac run` puts it there",
    Reason.LOST: "its result was there and is no longer in the cache: damaged, or removed",
    Reason.STOPPED: "a run of it was stopped; it goes on from what that left",
}
_BY_CHANGE = {
    ChangeKind.INPUT: Reason.INPUT, ChangeKind.PARAM: Reason.PARAM, ChangeKind.CODE: Reason.CODE,
    ChangeKind.MODEL: Reason.MODEL, ChangeKind.PACKAGE: Reason.PACKAGE, ChangeKind.DEVICE: Reason.DEVICE,
}
LEADING = (Reason.PARAM, Reason.CODE, Reason.MODEL, Reason.PACKAGE, Reason.DEVICE, Reason.INPUT)
"""Of several reasons the one that a person can act on is named first."""


@dataclass(frozen=True)
class StagePlan:
    """Whether one stage has to run and why, before anything runs."""

    stage: str
    reason: Reason
    parts: KeyParts | None = None
    """None where an input is not known yet."""
    record: Record | None = None
    """The finished run that stands for it."""
    changes: list[Change] = field(default_factory=list)
    """From the most similar earlier run to this one."""
    detail: str = ""

    @property
    def up_to_date(self) -> bool:
        return self.reason is Reason.UP_TO_DATE

    @property
    def cached(self) -> Record | None:
        """The record of the result, where the stage need not run."""
        return self.record if self.up_to_date else None

    @property
    def sentence(self) -> str:
        if self.detail:
            return self.detail
        if self.changes:
            return "; ".join(change.sentence for change in self.changes)
        return self.reason.sentence


def plan_stage(
    store: Store, parts: KeyParts, outputs: Collection[str], forced: bool = False, shown: str | None = None,
) -> StagePlan:
    """Whether the result of this key is in the cache; if not, what differs from the most similar earlier run.

    outputs: those that the stage declares; shown: key of the result that the folder of the run showed last.
    """
    known = shown == parts.key or store.record_path(parts.stage, parts.key).is_file()
    record = store.lookup(parts.key, outputs)
    if forced:
        return StagePlan(parts.stage, Reason.FORCED, parts, record)
    if record is not None:
        return StagePlan(parts.stage, Reason.UP_TO_DATE, parts, record)
    if store.partial(parts.key).exists():
        return StagePlan(parts.stage, Reason.STOPPED, parts)
    if known:
        return StagePlan(parts.stage, Reason.LOST, parts)
    before = store.previous(parts.stage, parts) if shown is not None else None  # a folder that showed none has nothing changed
    changes = before.parts.diff(parts) if before is not None else []
    if not changes:
        return StagePlan(parts.stage, Reason.FIRST_RUN, parts)
    reasons = {_BY_CHANGE[change.kind] for change in changes if change.kind in _BY_CHANGE}
    return StagePlan(parts.stage, next(r for r in LEADING if r in reasons), parts, changes=changes)


def plan_stages(graph: Graph, steps: list[str], digests: dict[str, str],
                plan: Callable[[str, dict[str, str]], StagePlan]) -> list[StagePlan]:
    """Plans of stages in running order, as far as their inputs are known.

    digests: of the ports that are known; those of cached stages join them. plan: of a stage, and the digests of its inputs.
    """
    plans = []
    for name in steps:
        inputs = graph.step(name).deps
        unknown = [port for port in inputs if port not in digests]
        if unknown:
            makers = {graph.producer[port] for port in unknown}
            plans.append(plan_waiting(name, [maker for maker in graph.steps if maker in makers]))
            continue
        plans.append(plan(name, {port: digests[port] for port in inputs}))
        if plans[-1].cached is not None:
            digests |= port_digests(plans[-1].cached)
    return plans


def port_digests(record: Record) -> dict[str, str]:
    """Port -> tree digest, of a stage's outputs."""
    return {f"{record.parts.stage}/{output}": digest for output, digest in record.outputs.items()}


def plan_waiting(stage: str, above: list[str]) -> StagePlan:
    """Of a stage whose inputs are not known before those above have run."""
    return StagePlan(stage, Reason.UPSTREAM, detail=f"runs if the result of {', '.join(above)} changes")

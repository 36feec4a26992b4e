"""Runs the stages of one clip, or says what would run."""

from __future__ import annotations

import contextlib
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gsac.cache.errors import CacheError, IntegrityError
from gsac.cache.key import KeyParts
from gsac.cache.lease import in_use
from gsac.cache.record import Record
from gsac.cache.root import named_remote
from gsac.cache.store import Store
from gsac.pipeline import dvc_sync
from gsac.pipeline.errors import NotUpToDateError, StageFailedError
from gsac.pipeline.graph import CLIP, Graph
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import Outcome
from gsac.pipeline.pace import Course
from gsac.pipeline.params import config_values
from gsac.pipeline.plan import StagePlan, plan_stage, plan_stages, port_digests
from gsac.pipeline.project import Project
from gsac.pipeline.quality import STANDARD, describe_quality, quality_entry
from gsac.pipeline.rows import Row, read_rows, result_row, write_rows
from gsac.pipeline.run_folder import LOGS, RunFolder
from gsac.pipeline.sources import Source, source_digest
from gsac.pipeline.stage_runner import StageRunner
from gsac.pipeline.timings import add_timings
from gsac.stages.contract import BadInput, StageError
from gsac.stages.severity import Severity

if TYPE_CHECKING:
    from gsac.pipeline.cost_forecast import Forecast
    from gsac.pipeline.journal import Journal

AHEAD = 2
"""Stages whose code is loaded while one is at work; one is not enough, since some stages end before the next has loaded."""

LAST = 2
"""Stages, the last ones, that others may use the time of: `train` takes most of a run, and leaves cores idle now and then."""

RECALLED = 110
"""Characters of a cached stage's warning at most."""


class HopelessClipError(BadInput):
    """A stage has found that nothing can come of the clip."""


@dataclass
class StageResult:
    """One row of run.json and --json."""

    name: str
    outcome: Outcome
    reason: str
    key: str = ""
    seconds: float = 0.0
    """Of the run that computed the result, this one or an earlier one."""
    cpu_seconds: float = 0.0
    peak_rss_mb: float = 0.0
    warnings: list[str] = field(default_factory=list)
    findings: list[dict[str, Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    params: dict[str, Any] = field(default_factory=dict)
    metrics: dict[str, Any] = field(default_factory=dict)
    """Timings among them."""
    timings: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    """Port -> tree digest."""
    outputs: dict[str, str] = field(default_factory=dict)
    """Port -> tree digest."""
    error: str | None = None
    killed: str = ""
    """Name of the signal that ended the stage's process."""

    @classmethod
    def of(cls, plan: StagePlan, outcome: Outcome, record: Record, config: Any) -> StageResult:
        """Of a stage that has a record."""
        info = record.info
        return cls(plan.stage, outcome, plan.sentence, record.key, info.seconds, info.cpu_seconds,
                   info.peak_rss_mb, info.warnings, info.findings, info.notes, config_values(config),
                   add_timings(info.metrics, info.timings), info.timings, record.parts.inputs, port_digests(record))

    def to_json(self) -> dict[str, Any]:
        """As run.json and --json hold it."""
        row = {
            "name": self.name, "status": self.outcome.value, "seconds": round(self.seconds, 3),
            "cpu_seconds": round(self.cpu_seconds, 3), "peak_rss_mb": round(self.peak_rss_mb, 1), "key": self.key,
            "reason": self.reason, "warnings": self.warnings, "findings": self.findings, "notes": self.notes,
            "params": self.params, "timings": self.timings,
            "inputs": self.inputs, "outputs": self.outputs,
        }
        return row | ({"error": self.error} if self.error else {}) | ({"killed": self.killed} if self.killed else {})


@dataclass
class Options:
    """Which stages, and how."""

    until: str | None = None
    """Last stage; what it does not need does not run."""
    start: str | None = None
    """First stage that may run; everything it needs must be in the cache (`--from`)."""
    force: tuple[str, ...] = ()
    """Stages that run whether their result is there or not."""
    quality: str = STANDARD
    """Preset that the parameters were made with."""
    anyway: bool = False
    """Whether the run goes on where nothing can come of the clip."""
    fleeting: bool = False
    """Whether the folder goes with the run's end, so that run.json, metrics.json and dvc.lock are left out."""


class ClipRun:
    """The stages of one clip, their results shown in one folder and kept in one store."""

    def __init__(self, project: Project, configs: dict[str, Any], store: Store, folder: RunFolder, journal: Journal | None = None,
                 keys: Keys | None = None):
        """journal: told what happens; None: nobody listens."""
        self.graph = project.graph
        self.configs = configs
        self.store = store
        self.folder = folder
        self._journal = journal
        self.keys = keys or Keys(project, configs, store)
        self.results: list[StageResult] = []
        self.metrics: dict[str, Any] = {}
        self.forecast: Forecast | None = None
        """Of the stages that have to run; None before it is known that one has to."""
        self.entries: Row = {}
        """Entries `quality` and `forecast` of run.json and --json, once the run has ended."""
        self._told: dict[str, Outcome] = {}
        """Key -> outcome, of the stages that this run has judged."""
        self._damaged: set[str] = set()
        """Ports whose files this run has found damaged."""

    @cached_property
    def journal(self) -> Journal:
        """Told what happens. Where nothing runs none is asked for, and its modules are not loaded."""
        if self._journal is None:
            from gsac.pipeline.journal import Journal

            return Journal()
        return self._journal

    def select(self, options: Options) -> list[str]:
        """Stages in running order. BadInput names a stage that is unknown or left out."""
        for name in (options.until, options.start, *options.force):
            if name is not None:
                self.graph.step(name)
        wanted = set(self.graph.steps)
        if options.until is not None:
            wanted = self.graph.above(options.until) | {options.until}
        for name in (options.start, *options.force):
            if name is not None and name not in wanted:
                raise BadInput(f"stage {name} does not run with --until {options.until}")
        return [name for name in self.graph.steps if name in wanted]

    def plan(self, clip: Path, options: Options) -> list[StagePlan]:
        """What would run and why, as far as it is known before anything runs."""
        return self.plan_of(source_digest(clip, self.store), options)

    def foresee_refusal(self, plans: Iterable[StagePlan], options: Options) -> None:
        """NotUpToDateError where a run of these plans is sure to end so; where results are shared only the run itself can tell."""
        if named_remote() is None:
            refuse_stale(self.graph, plans, options)

    def plan_of(self, digest: str, options: Options) -> list[StagePlan]:
        """The same of a clip by its tree digest, be it there or gone."""
        return self._plan_all(self.select(options), {CLIP: digest}, options)

    def _plan_all(self, steps: list[str], digests: dict[str, str], options: Options) -> list[StagePlan]:
        return plan_stages(self.graph, steps, digests,
                           lambda name, inputs: self._plan(self.keys.parts(name, inputs), options))

    def pull_models(self, clip: Path, options: Options) -> None:
        """Pulls the networks that are not here and that stages to be run need. BadInput where they cannot be had."""
        if self.keys.missing_models(self.select(options)):
            due = [plan.stage for plan in self.plan(clip, options) if plan.cached is None]
            self.keys.pull_models(due, self.journal.note)

    def run(self, clip: Path, options: Options, near_end: Callable[[list[str]], None] = lambda coming: None) -> None:
        """Runs the stages that are not up to date; fills `results`, `metrics` and the folder. near_end: called once one of the
        `LAST` stages is at work, with its name and those of the stages after it.

        Where an input of a stage that has to run is found damaged, the run goes back to the stage that made it.
        Raises StageFailedError, NotUpToDateError, CacheError; run.json and finished stages are kept in any case.
        """
        steps = self.select(options)
        source = Source(clip, self.store)
        digests = {CLIP: source.digest}
        paths = {CLIP: clip}
        runner = StageRunner(self.keys, self.store, self.journal, self.folder.root / LOGS)
        self.journal.follows(Course(steps, self.graph.above, self._expected_seconds))
        with in_use(self.store) as lease, self._writing_results(clip, source.digest, options), runner:
            at, plans = 0, {}
            while at < len(steps):
                name = steps[at]
                runner.on_start = partial(_use_time, runner, steps[at:], near_end)
                inputs = self.graph.step(name).deps
                parts = self.keys.parts(name, {port: digests[port] for port in inputs})
                lease.add(parts.key)
                plan = self._plan(parts, options)
                with self._recording_failure(plan, parts.key, runner):
                    if plan.cached is None and name not in options.force and runner.fetch(parts):
                        plan = self._plan(parts, options)
                plans[name] = plan
                outcome, record = Outcome.CACHED, plan.cached
                if record is None:
                    refuse_stale(self.graph, [plan], options)
                    maker = self._maker_of_damaged(name, paths)
                    if maker is not None:
                        at = steps.index(maker)
                        del self._told[self.results[at].key], self.results[at:]
                        continue
                    if self.forecast is None:
                        later = self._plan_all(steps[at + 1:], dict(digests), options)
                        self._tell_plans(self.foretell(clip, [*plans.values(), *later], options), [plan, *later])
                    with self._recording_failure(plan, parts.key, runner):
                        outcome, record = runner.run(
                            parts, plan.reason, {port: paths[port] for port in inputs}, forced=name in options.force,
                            sources=(source,) if CLIP in inputs else ())
                if outcome is Outcome.CACHED and parts.key in self._told:
                    outcome = self._told[parts.key]
                elif outcome is Outcome.CACHED:
                    self.journal.found(record)
                    self._recall_warnings(record)
                self._told[parts.key] = outcome
                self._record(plan, outcome, record)
                digests |= port_digests(record)
                paths |= {f"{name}/{output}": self.store.path(record, output) for output in record.outputs}
                at += 1
                if at < len(steps) and not options.anyway:
                    refuse_hopeless(record)

    def foretell(self, clip: Path, plans: list[StagePlan], options: Options) -> Forecast:
        """How long the stages that are not up to date will take; says it, too."""
        from gsac.pipeline.cost_forecast import Forecaster  # a run with nothing to do needs none

        self.forecast = Forecaster(self.keys, self.store).foretell(plans, clip)
        if self.forecast.worth_saying:
            self.journal.note(self.forecast.sentence(describe_quality(quality_entry(options.quality, self.configs))))
        return self.forecast

    def _tell_plans(self, forecast: Forecast, plans: list[StagePlan]) -> None:
        """Tells which stages have to be computed, or may have to."""
        for plan in plans:
            if plan.cached is None:
                expected = forecast.stages.get(plan.stage)
                self.journal.planned(plan.stage, plan.parts.key if plan.parts else "", plan.reason.value,
                                     expected.seconds if expected is not None else 0.0)

    def _recall_warnings(self, record: Record) -> None:
        """Tells the warnings of the run that computed a result, in short."""
        info = record.info
        findings = info.findings or [{}] * len(info.warnings)  # old records have none
        for message, finding in zip(info.warnings, findings, strict=False):
            self.journal.warning(record.parts.stage, first_sentence(message), finding.get("code", ""), finding.get("severity", ""))

    def _judged_forecast(self) -> Row:
        """Entry `forecast` of run.json, with what its stages took; {} where nothing had to run."""
        if self.forecast is None:
            return {}
        from gsac.pipeline.cost_forecast import Time

        took = {result.name: Time(result.seconds, result.cpu_seconds) for result in self.results if result.outcome is Outcome.RAN}
        return {"forecast": self.forecast.judged(took)}

    def _expected_seconds(self, stage: str) -> float | None:
        expected = self.forecast.stages.get(stage) if self.forecast is not None else None
        return expected.seconds if expected is not None else None

    def _maker_of_damaged(self, name: str, paths: dict[str, Path]) -> str | None:
        """The stage whose result has to be made again before a stage can read it; None where all inputs are whole.

        IntegrityError where that was done in this run already.
        """
        port = next((port for port in self.graph.step(name).deps if port != CLIP and not self.store.is_whole(paths[port])), None)
        if port is None:
            return None
        if port in self._damaged:
            raise IntegrityError(f"{port} was damaged in the cache {self.store.root} as soon as it was made again; check the disk")
        self._damaged.add(port)
        maker = self.graph.producer[port]
        self.journal.note(f"{name}: its input {port} was damaged in the cache; {maker} runs again first")
        return maker

    @cached_property
    def _shown(self) -> dict[str, str]:
        """Stage -> key of the result that the folder showed before this run."""
        results = {name: result_row(row) for name, row in read_rows(self.folder).items()}
        return {name: str(row.get("key")) for name, row in results.items() if row is not None}

    def _plan(self, parts: KeyParts, options: Options) -> StagePlan:
        forced = parts.stage in options.force and parts.key not in self._told
        return plan_stage(self.store, parts, self.keys.project.outputs(parts.stage), forced, self._shown.get(parts.stage))

    def _record(self, plan: StagePlan, outcome: Outcome, record: Record) -> None:
        self.results.append(StageResult.of(plan, outcome, record, self.configs[plan.stage]))
        self.metrics |= self.results[-1].metrics
        self.folder.place(self.store, record)

    @contextlib.contextmanager
    def _recording_failure(self, plan: StagePlan, key: str, runner: StageRunner) -> Iterator[None]:
        try:
            yield
        except (StageError, CacheError) as error:
            self.journal.failed(plan.stage, key, error)
            self.results.append(StageResult(plan.stage, Outcome.FAILED, plan.sentence, key,
                                            params=config_values(self.configs[plan.stage]), error=str(error),
                                            killed=getattr(error, "killed", "")))
            raise StageFailedError(plan.stage, error, runner.logs / f"{plan.stage}.log") from error

    @contextlib.contextmanager
    def _writing_results(self, clip: Path, digest: str, options: Options) -> Iterator[None]:
        """run.json, metrics.json and dvc.lock are written however the run ends, unless their folder goes with it."""
        try:
            yield
        finally:
            self.entries = {"quality": quality_entry(options.quality, self.configs)} | self._judged_forecast()
            if not options.fleeting:
                self._write_results(clip, digest)

    def _write_results(self, clip: Path, digest: str) -> None:
        write_rows(self.folder, self.graph, self.store, [result.to_json() for result in self.results],
                   {"clip": str(clip), "clip_digest": digest} | self.entries)
        digests = {port: digest for result in self.results for port, digest in (result.inputs | result.outputs).items()}
        dvc_sync.write_lock(self.folder, self.graph, self.finished, self.configs, self.store, digests)

    @property
    def finished(self) -> list[str]:
        """Stages whose results this run has found or made."""
        return [result.name for result in self.results if result.outcome is not Outcome.FAILED]

    def summary(self) -> dict[str, Any]:
        """The object of --json."""
        ports = [port for name in self.graph.steps if name in self.finished for port in self.graph.step(name).outs]
        return {
            "stages": [result.to_json() for result in self.results],
            "outputs": self.folder.outputs(ports),
            "metrics": self.metrics,
            **self.entries,
        }


def _use_time(runner: StageRunner, coming: list[str], near_end: Callable[[list[str]], None]) -> None:
    """What is done while a stage, the first of the coming ones, is at work."""
    runner.prepare(*coming[1:1 + AHEAD])
    if len(coming) <= LAST:
        near_end(coming)


def refuse_stale(graph: Graph, plans: Iterable[StagePlan], options: Options) -> None:
    """NotUpToDateError where a stage that the first one (`--from`) needs would have to run."""
    needed = graph.above(options.start) if options.start is not None else set()
    for plan in plans:
        if plan.stage in needed and plan.cached is None:
            raise NotUpToDateError(f"stage {plan.stage} is not up to date ({plan.sentence}); run without --from {options.start}")


def refuse_hopeless(record: Record) -> None:
    """HopelessClipError where the stage has found that nothing can come of the clip."""
    for message, finding in zip(record.info.warnings, record.info.findings, strict=False):  # old records have none
        if finding["severity"] == Severity.HOPELESS:
            raise HopelessClipError(f"{message} (--anyway goes on)")


def first_sentence(message: str) -> str:
    """A warning that was told in full when its stage ran, cut to its first sentence."""
    return textwrap.shorten(re.split(r"(?<=\.)\s", message, maxsplit=1)[0], RECALLED, placeholder=" …")

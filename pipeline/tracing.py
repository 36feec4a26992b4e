"""What is told as a trace of OpenTelemetry: a span for the batch, in it one a clip, in it one a stage. Extra `[otel]`.

The variables of OpenTelemetry's own specification say whether and where (`OTEL_EXPORTER_OTLP_ENDPOINT`, ...). Without an endpoint
nothing is loaded. Spans go out from a thread beside the run: a collector that is away or hangs costs FLUSH_S at the end at most.

Names of clips and errors, which may hold paths, are left out unless OTEL_RESOURCE_ATTRIBUTES has `gsac.names=true`.
"""

from __future__ import annotations

import contextlib
import importlib.util
import logging
import os
import threading
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, cast

from gsac.pipeline.outcomes import ExitCode, Outcome

if TYPE_CHECKING:
    from opentelemetry.trace import Span

    from gsac.pipeline.events import (
        BatchEnded,
        BatchStarted,
        ClipEnded,
        ClipStarted,
        Event,
        StageEvent,
        StageFailed,
        StageFinished,
        StageHit,
        StageStarted,
        StageWarning,
    )
    from gsac.pipeline.journal import Journal

ENDPOINTS = ("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT")
UNTRACED = {"OTEL_SDK_DISABLED": "true"}
"""Environment of a process of which another one traces what it tells."""
NAMES = "gsac.names"
"""Attribute of the resource that allows names and errors in spans."""
FLUSH_S = 3.0
"""s that the last spans have to go out."""
FIGURES = ("seconds", "cpu_seconds", "peak_rss_mb", "bytes", "device", "key", "reason", "code", "killed", "stages", "ran", "clips",
           "due", "executor", "failed")
"""Fields of events that become attributes, by these names after `gsac.`."""


def is_asked_for(environment: Mapping[str, str]) -> bool:
    """Whether an environment names a place for traces and does not turn them off."""
    off = environment.get("OTEL_SDK_DISABLED", "").lower() == "true" or environment.get("OTEL_TRACES_EXPORTER", "otlp") != "otlp"
    return not off and any(environment.get(name) for name in ENDPOINTS)


@contextlib.contextmanager
def traced(journal: Journal) -> Iterator[None]:
    """Traces what is told meanwhile, where the environment asks for it."""
    if not is_asked_for(os.environ):
        yield
        return
    if importlib.util.find_spec("opentelemetry") is None:
        journal.note("gsac: warning: OTEL_EXPORTER_OTLP_ENDPOINT asks for traces, which need pip install 'gsac[otel]'")
        yield
        return
    trace = Trace()
    try:
        with journal.heard_by(trace.take):
            yield
    finally:
        if not trace.close():
            journal.note("gsac: warning: the place of OTEL_EXPORTER_OTLP_ENDPOINT took no traces, or not all")


class Trace:
    """Makes spans of events, and sends them."""

    def __init__(self) -> None:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor

        log = logging.getLogger("opentelemetry")  # its words on a collector that is away would stand among those of the run
        log.addHandler(logging.NullHandler())
        log.propagate = False
        named = os.environ.get("OTEL_SERVICE_NAME") or "service.name=" in os.environ.get("OTEL_RESOURCE_ATTRIBUTES", "")
        resource = Resource.create({} if named else {"service.name": "gsac"})
        self._names = str(resource.attributes.get(NAMES, "")).lower() == "true"
        self._lost = _LostSpans(OTLPSpanExporter())
        self._provider = TracerProvider(resource=resource, shutdown_on_exit=False)
        self._provider.add_span_processor(BatchSpanProcessor(cast(Any, self._lost)))
        self._tracer = self._provider.get_tracer("gsac")
        self._batch: Span | None = None
        self._clips: dict[str, Span] = {}
        self._stages: dict[tuple[str, str], Span] = {}

    def take(self, event: Event) -> None:
        """Begins, fills or ends the span that the event is about, in the method of its kind."""
        getattr(self, f"_{event.kind}", lambda event: None)(event)

    def close(self) -> bool:
        """Ends what is open and sends what is left. Returns whether all went out in time."""
        for span in (*self._stages.values(), *self._clips.values(), *([self._batch] if self._batch is not None else [])):
            span.end()
        sender = threading.Thread(target=self._provider.shutdown, daemon=True)
        sender.start()
        sender.join(FLUSH_S)
        return not sender.is_alive() and not self._lost.any

    def _batch_started(self, event: BatchStarted) -> None:
        self._batch = self._begin("batch", None, event)

    def _batch_ended(self, event: BatchEnded) -> None:
        if self._batch is not None:
            self._end(self._batch, event, failed=event.failed > 0)
            self._batch = None

    def _clip_started(self, event: ClipStarted) -> None:
        if event.clip not in self._clips:
            self._clips[event.clip] = self._begin("clip", self._batch, event)

    def _clip_ended(self, event: ClipEnded) -> None:
        for at in [at for at in self._stages if at[0] == event.clip]:  # its process was killed
            self._end(self._stages.pop(at), event, failed=True)
        span = self._clips.pop(event.clip, None) or self._begin("clip", self._batch, event, event.time - event.seconds)
        figures = {f"gsac.metrics.{name}": value for name, value in event.metrics.items() if isinstance(value, (int, float))}
        span.set_attributes({"gsac.outcome": event.status, **figures})
        self._end(span, event, failed=event.code != ExitCode.OK, error=event.error)

    def _stage_started(self, event: StageStarted) -> None:
        self._stage(event)

    def _stage_hit(self, event: StageHit) -> None:
        self._end_stage(event, Outcome.CACHED)

    def _stage_finished(self, event: StageFinished) -> None:
        self._end_stage(event, Outcome.RAN)

    def _stage_failed(self, event: StageFailed) -> None:
        self._end_stage(event, Outcome.FAILED, event.error)

    def _stage_warning(self, event: StageWarning) -> None:
        span = self._stages.get((event.clip, event.stage)) or self._clips.get(event.clip)
        if span is not None:
            told = {"stage": event.stage, "code": event.code, "severity": event.severity}
            span.add_event("warning", {f"gsac.{name}": value for name, value in told.items()}, _nanoseconds(event.time))

    def _stage(self, event: StageEvent) -> Span:
        """A new span for a stage; one that is open is of a run that was killed."""
        old = self._stages.pop((event.clip, event.stage), None)
        if old is not None:
            self._end(old, event, failed=True)
        self._stages[event.clip, event.stage] = self._begin(event.stage, self._clips.get(event.clip), event)
        return self._stages[event.clip, event.stage]

    def _end_stage(self, event: StageEvent, outcome: Outcome, error: str = "") -> None:
        span = self._stages.get((event.clip, event.stage)) or self._stage(event)
        del self._stages[event.clip, event.stage]
        span.set_attributes({"gsac.outcome": outcome.value})
        self._end(span, event, outcome is Outcome.FAILED, error)

    def _begin(self, name: str, parent: Span | None, event: Event, at: float | None = None) -> Span:
        """at: s, Unix time, where it is not the event's."""
        from opentelemetry.context import Context
        from opentelemetry.trace import set_span_in_context

        context = set_span_in_context(parent, Context()) if parent is not None else Context()
        ids = {f"gsac.{name}": value for name in ("batch", "run", "attempt") if (value := getattr(event, name))}
        clip = {"gsac.clip": event.clip} if self._names and event.clip else {}
        return self._tracer.start_span(name, context, attributes=ids | clip | self._figures(event),
                                       start_time=_nanoseconds(event.time if at is None else at))

    def _end(self, span: Span, event: Event, failed: bool, error: str = "") -> None:
        from opentelemetry.trace import Status, StatusCode

        span.set_attributes(self._figures(event))
        if failed:
            span.set_status(Status(StatusCode.ERROR, error if self._names else None))
        span.end(_nanoseconds(event.time))

    def _figures(self, event: Event) -> dict[str, Any]:
        return {f"gsac.{name}": value for name in FIGURES if (value := getattr(event, name, None)) not in (None, "")}


class _LostSpans:
    """Passes spans to an exporter, and knows whether any could not be sent."""

    def __init__(self, exporter: Any):
        self._exporter = exporter
        self.any = False

    def export(self, spans: Any) -> Any:
        from opentelemetry.sdk.trace.export import SpanExportResult

        result = self._exporter.export(spans)
        self.any = self.any or result is not SpanExportResult.SUCCESS
        return result

    def __getattr__(self, name: str) -> Any:
        return getattr(self._exporter, name)


def _nanoseconds(seconds: float) -> int:
    return round(seconds * 1e9)

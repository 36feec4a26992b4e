"""Traces over OpenTelemetry's own protocol, taken by a server here."""

from __future__ import annotations

import http.server
import subprocess
import sys
import threading
import time

import pytest

from gsac.pipeline import tracing
from gsac.pipeline.commands.demo import make_truth_clip
from gsac.pipeline.events import BatchEnded, BatchStarted, ClipEnded, ClipStarted, StageFailed, StageHit, StageStarted, StageWarning
from gsac.pipeline.journal import Journal
from gsac.pipeline.tracing import is_asked_for, traced
from gsac.turntable import clip as turntable

SECRET = "anna at home"


@pytest.fixture
def collector(monkeypatch):
    """(spans that it got, event that lets its answers go; clear: it hangs); the environment names it."""
    pytest.importorskip("opentelemetry.exporter.otlp.proto.http", reason="needs pip install 'gsac[otel]'")
    from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

    spans, raw, answers = [], [], threading.Event()
    answers.set()

    class Collector(http.server.BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            answers.wait(30)
            raw.append(body)
            for resource in ExportTraceServiceRequest.FromString(body).resource_spans:
                for scope in resource.scope_spans:
                    spans.extend(scope.spans)
            self.send_response(200)
            self.end_headers()

        def log_message(self, *words):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Collector)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    for name in ("OTEL_SDK_DISABLED", "OTEL_TRACES_EXPORTER", "OTEL_RESOURCE_ATTRIBUTES", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", f"http://127.0.0.1:{server.server_port}")
    server.spans, server.raw, server.answers = spans, raw, answers
    yield server
    answers.set()
    server.shutdown()
    server.server_close()


def attributes(span):
    return {one.key: getattr(one.value, one.value.WhichOneof("value")) for one in span.attributes}


def tell_batch(said):
    """A batch of one clip whose train fails."""
    batch = Journal(said.append, of_batch=True)
    with traced(batch):
        batch.tell(BatchStarted(clips=1, due=1, executor="local"))
        run = Journal(lambda event: batch.relay(event, f"{SECRET}.mp4"))
        run.tell(ClipStarted())
        run.tell(StageHit(stage="split", key="k1", seconds=9.0, bytes=7))
        run.tell(StageStarted(stage="train", key="k2", device="cpu"))
        run.tell(StageWarning(stage="train", code="blur", message=f"/home/{SECRET}"))
        run.tell(StageFailed(stage="train", key="k2", error=f"/home/{SECRET}"))
        batch.tell(ClipEnded(clip=f"{SECRET}.mp4", status="failed", code=1, error=f"/home/{SECRET}", metrics={"psnr_fg": 23.5}))
        batch.tell(BatchEnded(failed=1))
    return batch


def test_a_batch_is_a_trace_of_clips_and_stages_and_names_nobody(collector):
    batch = tell_batch(said := [])
    spans = {span.name: span for span in collector.spans}
    assert set(spans) == {"batch", "clip", "split", "train"} and len({span.trace_id for span in collector.spans}) == 1
    assert spans["batch"].parent_span_id == b"" and spans["clip"].parent_span_id == spans["batch"].span_id
    assert spans["split"].parent_span_id == spans["train"].parent_span_id == spans["clip"].span_id
    assert attributes(spans["split"]).items() >= {"gsac.key": "k1", "gsac.outcome": "cached", "gsac.bytes": 7}.items()
    assert attributes(spans["train"]).items() >= {"gsac.key": "k2", "gsac.outcome": "failed", "gsac.device": "cpu"}.items()
    assert attributes(spans["clip"])["gsac.metrics.psnr_fg"] == 23.5 and attributes(spans["batch"])["gsac.batch"] == batch.batch
    assert [event.name for event in spans["train"].events] == ["warning"] and spans["train"].status.code == 2
    assert SECRET.encode() not in b"".join(collector.raw), "no name of a clip, no path leaves"
    assert not any("warning" in event.to_line() and "OTEL" in event.to_line() for event in said)


def test_the_demo_names_its_folder_to_people_and_not_to_the_trace(collector, tmp_path, monkeypatch):
    def make_clip(folder, seed, progress):
        folder.mkdir()
        return folder / "clip.mp4"

    monkeypatch.setattr(turntable, "make_clip", make_clip)
    with traced(journal := Journal((said := []).append)):
        make_truth_clip(tmp_path / SECRET, journal)
    assert [attributes(span)["gsac.reason"] for span in collector.spans] == ["no clip yet"]
    assert SECRET.encode() not in b"".join(collector.raw) and SECRET in said[0].message


def test_names_and_errors_leave_where_they_are_asked_for(collector, monkeypatch):
    monkeypatch.setenv("OTEL_RESOURCE_ATTRIBUTES", "gsac.names=true")
    tell_batch([])
    spans = {span.name: span for span in collector.spans}
    assert attributes(spans["clip"])["gsac.clip"] == f"{SECRET}.mp4" and spans["train"].status.message == f"/home/{SECRET}"


def test_a_collector_that_hangs_or_is_away_costs_seconds_and_a_line(collector, monkeypatch):
    monkeypatch.setattr(tracing, "FLUSH_S", 0.5)
    collector.answers.clear()
    for endpoint in (None, "http://127.0.0.1:1"):
        if endpoint:
            monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", endpoint)
        began = time.monotonic()
        tell_batch(said := [])
        assert time.monotonic() - began < 5 and "took no traces" in said[-1].message


def test_a_run_that_is_stopped_ends_its_open_spans(collector):
    with pytest.raises(KeyboardInterrupt), traced(journal := Journal()):
        journal.tell(ClipStarted(clip="a.mp4"))
        journal.tell(StageStarted(clip="a.mp4", stage="smplx"))
        raise KeyboardInterrupt
    assert {span.name for span in collector.spans} == {"clip", "smplx"}


@pytest.mark.parametrize("environment", [{}, {"OTEL_SERVICE_NAME": "x"}, {"OTEL_EXPORTER_OTLP_ENDPOINT": ""},
                                         {"OTEL_EXPORTER_OTLP_ENDPOINT": "http://x", "OTEL_SDK_DISABLED": "True"},
                                         {"OTEL_EXPORTER_OTLP_ENDPOINT": "http://x", "OTEL_TRACES_EXPORTER": "none"}])
def test_nothing_is_traced_unless_the_environment_names_a_place(environment):
    assert not is_asked_for(environment)
    assert is_asked_for({"OTEL_EXPORTER_OTLP_TRACES_ENDPOINT": "http://x/v1/traces"})


def test_without_the_extra_a_run_says_what_is_missing_and_goes_on(monkeypatch):
    monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", "http://127.0.0.1:1")
    monkeypatch.delenv("OTEL_SDK_DISABLED", raising=False)
    monkeypatch.setattr(tracing.importlib.util, "find_spec", lambda name: None)
    said = []
    with traced(journal := Journal(said.append)):
        journal.note("goes on")
    assert ["gsac[otel]" in event.message for event in said] == [True, False]


@pytest.mark.slow
def test_a_batch_of_processes_is_one_trace_and_each_stage_is_in_it_once(toy, collector):
    folder = toy.root / "clips"
    folder.mkdir()
    for name in ("one", "two"):
        (folder / f"{name}.mp4").write_text(f"{name} alpha")
    assert toy.gsac("batch", folder, "--out", toy.root / "avatars").code == 0
    by_id = {span.span_id: span for span in collector.spans}
    names = sorted((span.name, by_id[span.parent_span_id].name) for span in by_id.values() if span.parent_span_id)
    assert names == sorted([("clip", "batch")] * 2 + [(stage, "clip") for stage in ("cut", "left", "right", "join")] * 2)
    assert len({span.trace_id for span in by_id.values()}) == 1


@pytest.mark.slow
def test_a_run_without_a_place_for_traces_loads_nothing_of_opentelemetry_and_status_nothing_of_events(toy):
    toy.gsac("run", toy.clip, "--out", toy.out)
    seen = "import sys\nfrom gsac.pipeline.cli import execute\ncode = execute(sys.argv[1:])\nprint(*sys.modules)"
    run, status = (subprocess.run([sys.executable, "-P", "-c", seen, *map(str, words)], env=toy.env, cwd=toy.root, text=True,
                                  capture_output=True, check=True).stdout
                   for words in (("run", toy.clip, "--out", toy.out), ("status", toy.out)))
    assert "gsac.pipeline.journal" in run and "opentelemetry" not in run
    assert not {"gsac.pipeline.events", "gsac.pipeline.journal", "gsac.pipeline.event_file", "gsac.pipeline.tracing"} & set(
        status.split()), "an answer in a blink"

"""One stage, once: from the cache if it is there, else computed in a process of its own, checked and published."""

from __future__ import annotations

import datetime
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gsac.cache import objects
from gsac.cache.errors import FULL, CacheFullError
from gsac.cache.key import KeyParts
from gsac.cache.lease import single_flight
from gsac.cache.record import Record, RunInfo
from gsac.cache.store import Store
from gsac.pipeline.child import StageBugError, run_child, tail
from gsac.pipeline.events import PlainReporter
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import Outcome
from gsac.pipeline.params import plain
from gsac.pipeline.plan import Verdict
from gsac.stages.contract import BadInput, StageError

METRICS_OUTPUT = "metrics.json"
"""An output of this name is also kept in the action record."""
LITTLE_ROOM = 16 << 20
"""A stage that fails with fewer bytes than this left had no room: many libraries that write do not say so."""


@dataclass
class Actor:
    """Does stages for one run."""

    keys: Keys
    store: Store
    reporter: PlainReporter
    logs: Path
    """Folder for `<stage>.log`."""

    def act(self, verdict: Verdict, inputs: dict[str, Path], forced: bool = False,
            still_valid: Callable[[], None] = lambda: None) -> tuple[Outcome, Record]:
        """inputs: port -> read-only path. `still_valid` runs before publishing; it raises if inputs changed.

        Raises StageError or BadInput as the stage fails, CacheError as the store does; then nothing is published.
        """
        name, parts = verdict.stage, verdict.parts
        with single_flight(self.store, parts.key(), lambda: self._waiting(name)) as there:
            if there is not None and not forced:
                return Outcome.CACHED, there
            models = self.keys.models.need(parts.models, self.reporter.note)
            self.reporter.starts(name, verdict.reason.value)
            stage = self.keys.project.stage(name)
            scratch = self.store.partial(parts.key())
            if forced:
                objects.remove(scratch)
            with self.store.private(name) as folder:
                info = self._compute(parts, inputs, models, folder, scratch)
                still_valid()
                outputs = tuple(output.path for output in stage.outputs)
                if METRICS_OUTPUT in outputs:
                    info.metrics = json.loads((folder / METRICS_OUTPUT).read_text())
                record = self.store.publish(parts, folder, outputs, info, replace=forced)
            objects.remove(scratch)
        self.reporter.ends(name, Outcome.RAN, info.seconds)
        return Outcome.RAN, record

    def _compute(self, parts: KeyParts, inputs: dict[str, Path], models: dict[str, Path], folder: Path,
                 scratch: Path) -> RunInfo:
        name, project = parts.stage, self.keys.project
        now = datetime.datetime.now(datetime.UTC)
        info = RunInfo(started=now.isoformat(timespec="seconds"), device=parts.device or self.keys.device)

        def hear(event: dict[str, Any]) -> None:
            if event["event"] == "progress":
                self.reporter.progress(name, event["done"], event["total"], event["unit"])
            else:
                message = event["message"].removeprefix(f"{name}: ")  # the reporter names the stage
                info.warnings.append(message)
                self.reporter.warning(name, message)

        self.logs.mkdir(parents=True, exist_ok=True)
        log = self.logs / f"{name}.log"
        order = {
            "declaration": f"{project.package}.{name}", "entry": project.entry(name),
            "inputs": {port: str(path) for port, path in inputs.items()}, "out": str(folder),
            "scratch": str(scratch),
            "params": plain(self.keys.configs[name]), "models": {model: str(path) for model, path in models.items()},
            "device": info.device,
        }
        try:
            end = run_child(order, log, hear)
        except StageError as error:
            if not isinstance(error, BadInput) and shutil.disk_usage(folder).free < LITTLE_ROOM:
                raise CacheFullError(f"no room left in the cache folder {self.store.root} ({error})", FULL) from error
            if not isinstance(error, StageBugError):  # it would only come to the same end again
                objects.remove(scratch)
            raise
        info.seconds, info.cpu_seconds, info.peak_rss_mb = end["seconds"], end["cpu_seconds"], end["peak_rss_mb"]
        info.log_tail = tail(log)
        return info

    def _waiting(self, name: str) -> None:
        self.reporter.note(f"{name}: another run computes the same result; waiting for it")

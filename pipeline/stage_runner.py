"""Gets one stage's result: from the cache if it is there, else computed in a process of its own, checked and published."""

from __future__ import annotations

import contextlib
import datetime
import errno
import json
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gsac.cache import objects
from gsac.cache.errors import CacheError, no_room
from gsac.cache.half_made import half_made
from gsac.cache.key import KeyParts
from gsac.cache.lease import single_flight
from gsac.cache.publish import publish
from gsac.cache.record import Record, RunInfo
from gsac.cache.store import Store
from gsac.pipeline.child import Child, LogReader, NoRoomError, StageBugError, tail
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import Outcome
from gsac.pipeline.params import config_values
from gsac.pipeline.plan import Reason
from gsac.pipeline.sharing import Sharing, sharing
from gsac.pipeline.sources import Source
from gsac.stages.contract import BadInput, StageError

if TYPE_CHECKING:
    from gsac.pipeline.journal import Journal

METRICS_OUTPUT = "metrics.json"
"""An output of this name is also kept in the action record."""
READINGS = 3
"""How often a stage reads a file that is written or replaced meanwhile, before its run gives up."""
LITTLE_ROOM = 16 << 20
"""A stage that fails with fewer bytes than this free ran out of disk: many libraries do not say so themselves."""


@dataclass
class Prepared:
    """A process that has loaded a stage's code and waits for its order."""

    code: dict[str, str]
    """Digests of that code, before it was loaded."""
    child: Child


@dataclass
class StageRunner:
    """Runs stages of one run, one after another; as a context, it ends the processes it has started."""

    keys: Keys
    store: Store
    journal: Journal
    logs: Path
    """Folder for `<stage>.log`."""
    on_start: Callable[[], None] = lambda: None
    """Called once a stage's process has its order, for work that can be done meanwhile."""
    prepared: dict[str, Prepared] = field(default_factory=dict)
    """By stage."""
    leaving: list[Child] = field(default_factory=list)
    """Processes that may not have ended yet, which takes a while where they held much memory."""
    _kept: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)
    _shares: Sharing | None = None
    """What other machines get and give; None where nothing is shared."""
    _waiting_room: Path | None = None
    """Folder for the logs of prepared processes."""

    def __enter__(self) -> StageRunner:
        self._shares = self._kept.enter_context(sharing(self.store, self.journal))
        return self

    def __exit__(self, *exc) -> None:
        self._drop()
        while self.leaving:
            self.leaving.pop().close()
        self._kept.__exit__(*exc)

    def prepare(self, *names: str) -> None:
        """Starts a process a stage, which loads the stage's code while its inputs are made; ends the prepared ones of others."""
        self._drop(keep=names)
        for name in names:
            if name not in self.prepared:
                with contextlib.suppress(CacheError, BadInput):  # raised again when the stage's turn comes
                    code = self.keys.code(name)
                    self.prepared[name] = Prepared(code, self._child(name, self._early_log(name)))

    def _drop(self, keep: tuple[str, ...] = ()) -> None:
        for name in self.prepared.keys() - set(keep):
            child = self.prepared.pop(name).child
            child.close()
            child.log.unlink(missing_ok=True)

    def _child(self, name: str, log: Path) -> Child:
        self.logs.mkdir(exist_ok=True)
        project, device = self.keys.project, self.keys.device_of(name) or self.keys.device
        return Child(f"{project.package}.{name}", project.entry(name), device, log)

    def _log(self, name: str) -> Path:
        return self.logs / f"{name}.log"

    def _early_log(self, name: str) -> Path:
        if self._waiting_room is None:
            self.logs.mkdir(exist_ok=True)
            self._waiting_room, _ = self._kept.enter_context(half_made(self.logs))
        return self._waiting_room / self._log(name).name

    def _take_child(self, parts: KeyParts) -> Child:
        """A process for the stage: the prepared one, if it has loaded the code that the key names, else a new one."""
        name, log = parts.stage, self._log(parts.stage)
        if name in self.prepared and self.prepared[name].code == parts.code:
            child = self.prepared.pop(name).child
            child.rename_log(log)
            return child
        self._drop(keep=tuple(self.prepared.keys() - {name}))
        return self._child(name, log)

    def fetch(self, parts: KeyParts) -> bool:
        """Whether another machine's result of the key, which is not here, has been put into the store."""
        outputs = self.keys.project.outputs(parts.stage)
        return self._shares is not None and self._shares.fetch(parts, outputs, lambda: self._waiting(parts.stage)) is not None

    def run(self, parts: KeyParts, reason: Reason, inputs: dict[str, Path], forced: bool = False,
            sources: Iterable[Source] = ()) -> tuple[Outcome, Record]:
        """The stage's result: from the cache if it is there by now, else computed.

        inputs: port -> read-only path; sources: those of them that are the user's, and may be written while they are read.
        Raises StageError or BadInput as the stage fails, CacheError as the store does; then nothing is published.
        """
        name = parts.stage
        outputs = self.keys.project.outputs(name)
        with single_flight(self.store, parts.key, lambda: self._waiting(name), outputs) as there:
            if there is not None and not forced:
                return Outcome.CACHED, there
            shares = self._shares if not forced else None
            with shares.claimed(parts, outputs) if shares is not None else contextlib.nullcontext() as shared:
                if shared is not None:
                    return Outcome.CACHED, shared
                record = self._compute_whole(parts, reason, inputs, forced, sources)
                if self._shares is not None:
                    self._shares.upload(record)
        self.journal.computed(record)
        return Outcome.RAN, record

    def _compute_whole(self, parts: KeyParts, reason: Reason, inputs: dict[str, Path], forced: bool,
                       sources: Iterable[Source]) -> Record:
        """Computes and publishes, of sources that stayed as they were."""
        name = parts.stage
        models = self.keys.models.need(parts.models, self.journal.note)
        watched = [*sources, *(Source(path, self.store) for path in models.values())]
        self.journal.starts(name, reason.value, parts.key, parts.device or self.keys.device)
        scratch = self.store.partial(parts.key)
        if forced:
            objects.remove(scratch)
        for _ in range(READINGS):
            record = self._attempt(parts, inputs, models, watched, scratch, forced)
            if record is not None:
                break
        else:
            raise BadInput(f"what stage {name} reads was written or replaced each of {READINGS} times that it was read "
                           f"({', '.join(str(source.path) for source in watched)}); run again when it is left alone")
        objects.remove(scratch)
        return record

    def _attempt(self, parts: KeyParts, inputs: dict[str, Path], models: dict[str, Path], watched: list[Source], scratch: Path,
                 forced: bool) -> Record | None:
        """Computes and publishes; None where a file was written or replaced meanwhile and holds again what the key says."""
        with self.store.private(parts.stage) as folder:
            try:
                info = self._compute(parts, inputs, models, folder, scratch)
            except StageError as error:
                self._check_code(parts, error)
                if self._all_untouched(parts.stage, watched, scratch):
                    raise
                return None
            self._check_code(parts)
            if not self._all_untouched(parts.stage, watched, scratch):
                return None
            outputs = self.keys.project.outputs(parts.stage)
            if METRICS_OUTPUT in outputs:
                info.metrics = json.loads((folder / METRICS_OUTPUT).read_text())
            return publish(self.store, parts, folder, outputs, info, replace=forced)

    def _all_untouched(self, name: str, watched: list[Source], scratch: Path) -> bool:
        """Whether all that the stage read stayed as it was; else tells what did not, and drops the work on it in `scratch`.

        BadInput where it is another by now.
        """
        touched = [source for source in watched if not source.is_untouched()]
        if touched:
            objects.remove(scratch)
        for source in touched:
            source.look_again()
            self.journal.note(f"{name}: {source.path} was written or replaced while it was read; it is read again")
        return not touched

    def _check_code(self, parts: KeyParts, because: StageError | None = None) -> None:
        """StageError where the stage's code was edited since its key was made: what ran may be neither the old nor the new."""
        now = self.keys.code(parts.stage)
        edited = sorted(name for name in now.keys() | parts.code.keys() if now.get(name) != parts.code.get(name))
        if edited:
            more = f" and {len(edited) - 3} more" if len(edited) > 3 else ""
            said = f"; meanwhile it failed: {because}" if because else ""
            raise StageError(f"its code was edited while it ran ({', '.join(edited[:3])}{more}); run again{said}") from because

    def _compute(self, parts: KeyParts, inputs: dict[str, Path], models: dict[str, Path], folder: Path,
                 scratch: Path) -> RunInfo:
        name = parts.stage
        now = datetime.datetime.now(datetime.UTC)
        info = RunInfo(started=now.isoformat(timespec="seconds"), device=parts.device or self.keys.device)
        log = LogReader(self._log(name))

        def hear(event: dict[str, Any]) -> None:
            self._show_log(name, log)
            if event["event"] == "progress":
                self.journal.progress(name, event["done"], event["total"], event["unit"])
            elif event["event"] == "resumed":
                self.journal.note(f"{name}: goes on from {event['unit'].removesuffix('s')} {event['done']} of {event['total']}")
            elif event["event"] == "timing":
                info.timings[event["name"]] = event["value"]
            else:
                message = event["message"].removeprefix(f"{name}: ")  # the event names the stage
                if event["event"] == "warning":
                    info.warnings.append(message)
                    info.findings.append(event["finding"])
                    self.journal.warning(name, message, event["finding"]["code"], event["finding"]["severity"])
                else:
                    info.notes.append(message)
                    self.journal.remark(name, message)

        order = {
            "inputs": {port: str(path) for port, path in inputs.items()}, "out": str(folder),
            "scratch": str(scratch),
            "params": config_values(self.keys.configs[name]), "models": {model: str(path) for model, path in models.items()},
            "device": info.device,
        }
        try:
            child = self._take_child(parts)
            self.leaving.append(child)
            try:
                child.order(order)
                self.on_start()
                end = child.follow(hear)
            except BaseException:
                child.close()  # before its output folder is removed
                raise
            finally:
                self._show_log(name, log, ended=True)
        except NoRoomError as error:
            raise no_room(error.errno, self.store.root, f" ({error})") from error
        except StageError as error:
            if not isinstance(error, BadInput) and shutil.disk_usage(folder).free < LITTLE_ROOM:
                raise no_room(errno.ENOSPC, self.store.root, f" ({error})") from error
            if not isinstance(error, StageBugError):  # another run would only fail in the same way
                objects.remove(scratch)
            raise
        info.seconds, info.cpu_seconds, info.peak_rss_mb = end["seconds"], end["cpu_seconds"], end["peak_rss_mb"]
        info.log_tail = tail(self._log(name))
        return info

    def _show_log(self, name: str, log: LogReader, ended: bool = False) -> None:
        for line in log.new_lines(ended):
            self.journal.log(name, line)

    def _waiting(self, name: str) -> None:
        self.journal.note(f"{name}: another run computes the same result; waiting for it")

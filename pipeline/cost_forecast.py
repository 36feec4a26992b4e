"""How long a run will take, told before it starts: the cost model, scaled by what earlier runs took on this machine."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gsac.cache.record import Record, is_digest
from gsac.cache.store import Store
from gsac.pipeline.cost_model import stage_cost
from gsac.pipeline.footage import Footage, expect_footage, footage_of_result
from gsac.pipeline.keys import Keys
from gsac.pipeline.pace import duration
from gsac.pipeline.plan import StagePlan
from gsac.stages.contract import BadInput, make_config
from gsac.stages.counting import counted

EARLIER_RUNS = 5
"""Runs of a stage, the newest, that tell how fast it is here."""
FADING = 0.5
"""Weight of a run over that of the next newer one."""
SPLIT, FRAMES, CLIP_FACTS = "split", "split/frames", "split/clip.json"
BRIEF_S = 0.5
"""s; a stage that takes less is not named, and of a run that does nothing is said."""
THREADS = "NUMBA_NUM_THREADS"
"""Environment variable that a batch shares the cores out by."""


@dataclass(frozen=True)
class Time:
    """s, wall and of all cores."""

    seconds: float = 0.0
    cpu_seconds: float = 0.0

    def __add__(self, other: Time) -> Time:
        return Time(self.seconds + other.seconds, self.cpu_seconds + other.cpu_seconds)

    def to_json(self) -> dict[str, float]:
        """As run.json and --json hold it."""
        return {"seconds": round(self.seconds, 2), "cpu_seconds": round(self.cpu_seconds, 2)}


@dataclass(frozen=True)
class MachineSpeed:
    """How fast this machine is beside the one of the cost model."""

    took: float = 0.0
    """CPU s of earlier runs, in which older ones fade."""
    modelled: float = 0.0
    """The same by the model."""
    waiting: float = 1.0
    """Wall over CPU time, relative to the model's, of the run that waited least: others may have had the machine in the rest."""

    def __add__(self, other: MachineSpeed) -> MachineSpeed:
        return MachineSpeed(self.took + other.took, self.modelled + other.modelled)

    def scale(self, time: Time) -> Time:
        """What the model says, as it would take here."""
        slower = _ratio(self.took, self.modelled)
        return Time(slower * _ratio(self.waiting, 1.0) * time.seconds, slower * time.cpu_seconds)


@dataclass(frozen=True)
class Forecast:
    """Times of the stages that have to run."""

    stages: dict[str, Time]
    unknown: tuple[str, ...]
    """Stages that have to run and whose time nothing tells."""
    cores: int
    known_here: bool
    """Whether some stage ran on this machine before; else the times are those of the machine of the cost model."""
    exact: bool
    """Whether the clip's frames are known; else as many are reckoned with as the parameters allow."""
    load: float = 0.0
    """Processes that wanted a core when this was told, the mean of a minute."""

    @property
    def whole(self) -> Time:
        """Of the run."""
        return sum(self.stages.values(), Time())

    @property
    def worth_saying(self) -> bool:
        return self.whole.seconds >= BRIEF_S

    def sentence(self, quality: str) -> str:
        """`About 55 s on this machine (2 cores): split 2 s, ..., train 37 s; quality standard`"""
        lead = "About" if self.exact else "At most about"
        where = "on this machine" if self.known_here else "on a machine like the one that was measured"
        parts = [f"{name} {duration(time.seconds)}" for name, time in self.stages.items() if time.seconds >= BRIEF_S]
        missing = f", without {' and '.join(self.unknown)}, of which no time is known" if self.unknown else ""
        cores = counted(self.cores, "core")
        more = ", longer while others keep it as busy as now" if self.load > self.cores else ""
        if not self.known_here:
            more += ", half a minute more the first time, while kernels compile"
        return f"{lead} {duration(self.whole.seconds)} {where} ({cores}){more}: {', '.join(parts)}{missing}; quality {quality}"

    def to_json(self) -> dict[str, Any]:
        """As --json holds it."""
        return self.whole.to_json() | {
            "stages": {name: time.to_json() for name, time in self.stages.items()}, "unknown": list(self.unknown),
            "cores": self.cores, "known_here": self.known_here, "exact": self.exact, "load": round(self.load, 2),
        }

    def judged(self, took: dict[str, Time]) -> dict[str, Any]:
        """The same with what its stages took instead, and the ratios of that to what was told. took: of the stages that ran."""
        both = [(took[name], told) for name, told in self.stages.items() if name in took]
        real, told = sum((real for real, _ in both), Time()), sum((told for _, told in both), Time())
        return self.to_json() | {"took": real.to_json(), "ratio": _share(real.seconds, told.seconds),
                                 "cpu_ratio": _share(real.cpu_seconds, told.cpu_seconds)}


class Forecaster:
    """Forecasts clips with the same keys; what earlier runs took is looked up once."""

    def __init__(self, keys: Keys, store: Store):
        self._keys, self._store, self._cores = keys, store, count_cores()
        self._speed = functools.cache(lambda name: _speed(name, keys, store, self._cores))
        self._last_time = functools.cache(lambda name: _last_time(name, store))

    def foretell(self, plans: Iterable[StagePlan], clip: Path) -> Forecast:
        """Forecast of the stages that are not up to date, as the plans say."""
        plans, keys = list(plans), self._keys
        due = [plan.stage for plan in plans if plan.cached is None]
        split = next((plan.cached for plan in plans if plan.stage == SPLIT and plan.cached is not None), None)
        footage = _footage_of(split, self._store) or expect_footage(clip, keys.configs.get(SPLIT))
        models = {name: _model_time(name, keys.configs[name], footage, keys.device_of(name), self._cores) for name in due}
        speeds = {name: self._speed(name) for name in due}
        overall = sum(speeds.values(), MachineSpeed())
        stages, unknown, known_here = {}, [], bool(overall.modelled)
        for name in due:
            if (expected := models[name]) is not None:
                stages[name] = (speeds[name] if speeds[name].modelled else overall).scale(expected)
            elif (usual := self._last_time(name)) is not None:
                stages[name], known_here = usual, True
            else:
                unknown.append(name)
        return Forecast(stages, tuple(unknown), self._cores, known_here, footage.read or not any(models.values()),
                        os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0)


def count_cores() -> int:
    """Number of cores that a stage may use."""
    here = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    shared = os.environ.get(THREADS, "")
    return min(here, int(shared)) if shared.isdecimal() and int(shared) else here


def _model_time(name: str, config: Any, footage: Footage, device: str, cores: int) -> Time | None:
    cost = stage_cost(name, config, footage, device or "cpu")
    return None if cost is None else Time(cost.seconds(cores), cost.cpu_seconds)


def _speed(name: str, keys: Keys, store: Store, cores: int) -> MachineSpeed:
    """By the stage's earlier runs on its device class."""
    took, modelled, waiting = 0.0, 0.0, []
    for age, record in enumerate(store.recent(name, EARLIER_RUNS)):
        footage = _footage_of(record, store)
        if footage is None or record.parts.device != keys.device_of(name) or record.info.timings.get("resumed_at_step") is not None:
            continue
        try:
            config = make_config(keys.project.stage(name), record.parts.params)
        except BadInput:  # of another version of the stage
            continue
        model, cpu_seconds = _model_time(name, config, footage, record.parts.device, cores), record.info.cpu_seconds
        if model is not None and 0 < cpu_seconds < float("inf"):
            took, modelled = took + FADING ** age * cpu_seconds, modelled + FADING ** age * model.cpu_seconds
            waiting.append(record.info.seconds / cpu_seconds * model.cpu_seconds / model.seconds)
    return MachineSpeed(took, modelled, min(waiting, default=1.0))


def _last_time(name: str, store: Store) -> Time | None:
    """Of a stage that the model does not know, what its last run took."""
    return next((Time(record.info.seconds, record.info.cpu_seconds) for record in store.recent(name, 1)), None)


def _share(real: float, told: float) -> float | None:
    return round(real / told, 3) if told else None


def _ratio(real: float, model: float) -> float:
    """How much longer than modelled; 1 where that is not told, or by no number that can be."""
    ratio = real / model if model else 0.0
    return ratio if 0 < ratio < float("inf") else 1.0


def _footage_of(record: Record | None, store: Store) -> Footage | None:
    """The frames that a run read, or that split made; None where they are no longer in the store."""
    if record is None:
        return None
    ports = record.parts.inputs | {f"{record.parts.stage}/{output}": digest for output, digest in record.outputs.items()}
    paths = {port: store.where(ports[port], port) for port in (FRAMES, CLIP_FACTS) if is_digest(ports.get(port))}
    return footage_of_result(paths.get(FRAMES), paths.get(CLIP_FACTS))

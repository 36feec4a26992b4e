"""What each clip of a batch needs, found in one process before anything runs."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from gsac.cache.store import Store
from gsac.pipeline.asked_clip import find_clip
from gsac.pipeline.cost_forecast import Forecaster
from gsac.pipeline.errors import NotUpToDateError
from gsac.pipeline.executors.executor import ClipJob
from gsac.pipeline.graph import CLIP
from gsac.pipeline.keys import KeysOfOneMoment
from gsac.pipeline.other_clip import make_way
from gsac.pipeline.plan import Reason, StagePlan, plan_stages
from gsac.pipeline.project import Project
from gsac.pipeline.run import ClipRun, Options
from gsac.pipeline.run_folder import RunFolder
from gsac.pipeline.sources import source_digest
from gsac.stages.contract import BadInput

PEAK_MB = 2500.0
"""Memory of a clip's run where no stage of it has run here: the bound of 120 frames of 1080x1920 on two cores."""
EARLIER_RUNS = 5
"""Runs of a stage, the newest, whose largest memory is reckoned with."""


@dataclass(frozen=True)
class ClipPlan:
    """What a clip's run would do."""

    job: ClipJob
    due: tuple[str, ...] = ()
    """Stages that would run; those below a stage that runs are among them, though an equal result may spare them."""
    seconds: float = 0.0
    """That they may take by the clock."""
    peak_mb: float = 0.0
    """Memory of the largest of them."""
    digest: str = ""
    """Of the clip; empty where it cannot be read or the folder is another's."""
    error: str = ""
    """Why it cannot run: the clip cannot be read, the folder is another's, or what `--from` needs is not in the cache."""
    before_gpu: str = ""
    """Last stage before those that a GPU computes; empty where none of those is due."""

    @property
    def told_job(self) -> ClipJob:
        """The job with what the plan knows of its needs."""
        return replace(self.job, peak_mb=self.peak_mb, before_gpu=self.before_gpu)

    @property
    def unchanged(self) -> bool:
        """Whether all results are in the cache."""
        return not self.due and not self.error

    def to_json(self) -> dict[str, Any]:
        """As --dry-run --json holds it."""
        return {"clip": str(self.job.clip), "out": str(self.job.out), "due": list(self.due), "seconds": round(self.seconds, 1),
                "peak_rss_mb": round(self.peak_mb), "error": self.error or None}


class BatchPlanner:
    """Plans clips over one store, with one set of parameters."""

    def __init__(self, project: Project, configs: dict[str, Any], store: Store, options: Options, replace: bool = False):
        """replace: whether other clips' avatars in the folders give way."""
        self.keys, self.store, self._replace = KeysOfOneMoment(project, configs, store), store, replace
        self._graph, self._options = project.graph, options
        self._clip_run = functools.partial(ClipRun, project, configs, store, keys=self.keys)
        self.steps = self._clip_run(RunFolder(store.root)).select(options)  # the folder is not asked for anything
        self._outputs = {name: project.outputs(name) for name in self.steps}
        self._forecaster = Forecaster(self.keys, store)
        self._peak_mb = functools.cache(lambda name: _peak_mb(name, store))

    def plan_all(self, jobs: Iterable[ClipJob]) -> list[ClipPlan]:
        """Plans in the order of the jobs. A clip that cannot run is planned as such: its run says so, too."""
        return [self.plan(job) for job in jobs]

    def plan(self, job: ClipJob) -> ClipPlan:
        """What the run of one clip would do."""
        try:
            folder, clip = RunFolder(job.out), find_clip(job.clip)
            digest = source_digest(clip, self.store)
            folder.refuse_foreign(clip, self.keys.project)
            make_way(folder, clip, self.store, self._replace)
        except BadInput as error:
            return ClipPlan(job, error=str(error))
        plans = plan_stages(self._graph, self.steps, {CLIP: digest}, self._plan)
        due = tuple(plan.stage for plan in plans if plan.cached is None)
        if not due:
            return ClipPlan(job, digest=digest)
        if self._options.start is not None and (error := self._refusal(folder, digest)):
            return ClipPlan(job, digest=digest, error=error)
        seconds = self._forecaster.foretell(plans, job.clip).whole.seconds
        return ClipPlan(job, due, seconds, max(map(self._peak_mb, due)), digest, before_gpu=self._before_gpu(due))

    def _refusal(self, folder: RunFolder, digest: str) -> str:
        """What the run will end with, in its own words; empty where that is not known before it runs."""
        clip_run = self._clip_run(folder)
        try:
            clip_run.foresee_refusal(clip_run.plan_of(digest, self._options), self._options)
        except NotUpToDateError as error:
            return str(error)
        return ""

    def _before_gpu(self, due: tuple[str, ...]) -> str:
        first = next((n for n, name in enumerate(self.steps) if name in due and self.keys.device_of(name)), 0)
        return self.steps[first - 1] if first else ""

    def _plan(self, name: str, inputs: dict[str, str]) -> StagePlan:
        """Like ClipRun's, without looking for what has changed since earlier runs."""
        parts = self.keys.parts(name, inputs)
        record = self.store.lookup(parts.key, self._outputs[name])
        reason = Reason.FORCED if name in self._options.force else Reason.FIRST_RUN if record is None else Reason.UP_TO_DATE
        return StagePlan(name, reason, parts, record)


def _peak_mb(name: str, store: Store) -> float:
    """Largest memory of the stage's earlier runs."""
    return max((record.info.peak_rss_mb for record in store.recent(name, EARLIER_RUNS)), default=PEAK_MB)

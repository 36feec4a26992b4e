"""One fit of one clip by one method, timed and scored."""

from __future__ import annotations

import dataclasses
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from gsac.avatar.artifacts import Clip
from gsac.avatar.body import Body, BodyParams
from gsac.benchmarks.fit.clips import FitCase
from gsac.benchmarks.fit.score import score
from gsac.stages.contract import Job
from gsac.stages.smplx import STAGE
from gsac.stages.smplx.config import Method, SmplxConfig


@dataclass
class FitTrial:
    """Times and scores of one fit: a row of the table."""

    clip: str
    method: str
    focal_given: bool
    wall_s: float
    """Seconds of the smplx stage with reading and writing, without loading of libraries."""
    cpu_s: float
    """CPU seconds of all threads."""
    scores: dict[str, float]
    warnings: tuple[str, ...] = ()


def fit(case: FitCase, method: Method, focal_given: bool) -> FitTrial:
    """Runs the smplx stage on one clip. focal_given: whether clip.json holds the true focal length."""
    from gsac.stages.smplx.stage import run

    warnings: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        clip = Clip.read(case.inputs["split/clip.json"])
        path = Path(folder) / "clip.json"
        dataclasses.replace(clip, focal_px=case.truth.focal if focal_given else None).write(path)
        out = Path(folder) / "out"
        out.mkdir()
        job = Job(case.inputs | {"split/clip.json": path}, out, SmplxConfig(method=method),
                  warn=lambda finding: warnings.append(finding.message))
        wall, cpu = time.perf_counter(), time.process_time()
        run(job)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        STAGE.outputs[0].check(out / "body.npz")
        params = BodyParams.read(out / "body.npz")
    return FitTrial(case.name, method, focal_given, wall, cpu, score(Body.load(), params, case.truth), tuple(warnings))


def warm_up() -> None:
    """Fits a few frames of a known pose by both methods: loading and compiling is then in no trial's time."""
    import numpy as np

    from gsac.stages.smplx.lm.fit import fit_clip
    from gsac.stages.smplx.paper import fit as paper
    from gsac.stages.smplx.sightings import Sightings

    body = Body.load()
    pose = np.zeros((3, 55, 3))
    pose[:, 0, 0] = np.pi
    still = np.zeros((3, body.exprdirs.shape[2]))
    params = BodyParams.from_pose(pose, np.tile([0, 0, 3], (3, 1)), np.zeros(body.num_betas), still, 500.0, (180, 320))
    points = body.keypoints(body.posed(params)[0])
    known = body.known_keypoints.astype(float)
    xy = np.nan_to_num(params.camera(360, 640).project(points))
    sightings = Sightings(xy, np.tile(known, (3, 1)), np.ones((3, 133)), points, np.arange(3) / 10, 360, 640, 500.0)
    fit_clip(body, sightings, [], SmplxConfig(silhouette=0), lambda *done: None)
    paper.fit_clip(body, sightings, [], SmplxConfig(method="paper"), lambda *done: None, (paper.Pass(2, 0.1, (1,), 1, True),))

"""Exports a small avatar, so that kernels are compiled or loaded and libraries imported before the real one is there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gsac.avatar.artifacts import Clip
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.stages.contract import Job
from gsac.stages.export.config import ExportConfig

GAUSSIANS = 300


def rehearse(run: Callable[[Job], None]) -> None:
    """run: the stage's own."""
    body = Body.load()
    with TemporaryDirectory() as name:
        folder = Path(name)
        inputs = {port: folder / Path(port).name for port in ("split/clip.json", "train/avatar.npz", "train/body.npz")}
        Clip(None, None, 2, 2, None, "").write(inputs["split/clip.json"])
        params = BodyParams.from_pose(np.zeros((1, len(body.parents), 3)), np.zeros((1, 3)), np.zeros(body.num_betas),
                                      np.zeros((1, body.exprdirs.shape[2])), 1.0, (1.0, 1.0), model=body.digest)
        params.write(inputs["train/body.npz"])
        Gaussians.area(body.v_template, body.faces, GAUSSIANS).write(inputs["train/avatar.npz"])
        out = folder / "out"
        out.mkdir()
        run(Job(inputs, out, ExportConfig()))

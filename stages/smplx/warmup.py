"""A small fit ahead of the run: it calls everything that a run calls, so that all is compiled and imported before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gsac.avatar.artifacts import Clip, write_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.frame_files import write_alpha, write_frame
from gsac.avatar.zbuffer import silhouette
from gsac.stages.contract import Job
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.sightings import HIPS

FRAMES, FPS = 6, 10.0
WIDTH, HEIGHT, FOCAL, DISTANCE = 54, 96, 100.0, 2.4
"""px, px, px and m: the body nearly fills the image."""
TURN = 1.0
"""Yaw from frame to frame, rad."""
SIGMA = 0.5
"""px"""


def rehearse(run: Callable[[Job], None]) -> None:
    """Runs the stage once. Takes 1.5 s once the compiler's cache is filled, and the compile time before. run: the stage's."""
    with TemporaryDirectory() as folder:
        inputs = write_inputs(Body.load(), Path(folder))
        out = Path(folder) / "out"
        out.mkdir()
        run(Job(inputs, out, SmplxConfig(rounds=1, iterations=1)))


def write_inputs(body: Body, folder: Path) -> dict[str, Path]:
    """Writes the artifacts of a turning body; returns port -> path."""
    pose = np.zeros((FRAMES, len(body.parents), 3))
    for t in range(FRAMES):
        pose[t, 0] = np.pi * np.array([np.cos(t * TURN / 2), 0, np.sin(t * TURN / 2)])
    params = BodyParams.from_pose(pose, np.tile([0.0, 0.0, DISTANCE], (FRAMES, 1)), np.zeros(body.num_betas),
                                  np.zeros((FRAMES, body.exprdirs.shape[2])), FOCAL, (WIDTH / 2, HEIGHT / 2), model=body.digest)
    camera, vertices = params.camera(WIDTH, HEIGHT), body.posed(params)[0]
    points = body.keypoints(vertices)
    score = np.isfinite(points).all(-1).astype(np.float32)
    inputs = {port: folder / Path(port).name for port in ("split/clip.json", "split/frames", "handgap/keypoints.npz",
                                                          "face/face.npz", "segment/alpha")}
    Clip(FPS, [t / FPS for t in range(FRAMES)], WIDTH, HEIGHT, None, "").write(inputs["split/clip.json"])
    write_arrays(inputs["handgap/keypoints.npz"], xy=np.nan_to_num(camera.project(points)).astype(np.float32), score=score,
                 world=(points - points[:, HIPS].mean(1, keepdims=True)).astype(np.float32), detector=np.array("mediapipe"),
                 missing=np.zeros((FRAMES, 2), bool), filled=np.zeros(score.shape, bool),
                 sigma=np.full(score.shape, SIGMA, np.float32))
    write_arrays(inputs["face/face.npz"], valid=np.ones(FRAMES, bool), jaw=np.zeros((FRAMES, 3), np.float32),
                 expression=np.zeros((FRAMES, body.exprdirs.shape[2]), np.float32), shape=np.zeros(1404, np.float32),
                 landmarks=np.full((FRAMES, 468, 3), np.nan, np.float32))
    for port in ("split/frames", "segment/alpha"):
        inputs[port].mkdir()
    for t in range(FRAMES):
        write_frame(inputs["split/frames"] / f"{t:06d}.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
        write_alpha(inputs["segment/alpha"] / f"{t:06d}.exr", silhouette(vertices[t], body.faces, camera).astype(np.float32))
    return inputs

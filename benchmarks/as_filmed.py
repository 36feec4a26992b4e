"""Avatars of any version, judged as filmed by today's code: `python -m gsac.benchmarks.as_filmed RUN TRAINED [TRAINED ...]`.

RUN is the folder of a `gsac run` whose frames, masks and body fit the trainings had; TRAINED are output folders of `train`. Each
avatar is judged twice: in its own poses, and with the held-out poses moved onto the frames at their full size by that avatar. With
`--masks` it is judged by true masks, so that pipelines whose own masks differ can be compared.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.metrics import WHITE, composite, find_edge, squared_error, summary
from gsac.avatar.threads import Workspace, side_by_side
from gsac.benchmarks.moved_poses import move_onto
from gsac.benchmarks.speed_accuracy.novel_poses import read_view
from gsac.stages.train.judge.heldout import judge, render_view, truth
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View, read_whole

FIGURES = ("psnr_fg", "psnr_face", "flip", "ssim_black", "detail")


def main() -> None:
    """Prints a line of JSON for each training."""
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.as_filmed",
                                     description="Avatars of any version, judged as filmed by today's code.")
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a `gsac run` up to smplx")
    parser.add_argument("trained", type=Path, nargs="+", metavar="TRAINED", help="output folder of a training on it")
    parser.add_argument("--masks", type=Path, metavar="DIR", help="the turntable's folder mask, in the place of the run's masks")
    options = parser.parse_args()
    for folder in options.trained:
        print(json.dumps({"trained": folder.name} | judge_as_filmed(options.run, folder, options.masks)), flush=True)


def judge_as_filmed(run: Path, trained: Path, masks: Path | None = None) -> dict[str, float | None]:
    """`FIGURES` and those of `judge_edge` over the training's held-out frames, and the same with `_moved`.

    run: folder of the run; trained: output folder of `train`; masks: folder of true masks, one for each frame.
    """
    clip, fit = Clip.read(run / "split/clip.json"), BodyParams.read(run / "smplx/body.npz")
    held = json.loads((trained / "metrics.json").read_text())["heldout_frames"]
    frames = run / "split/frames"
    if masks is None:
        views = read_whole(frames, run / "segment/alpha", fit.camera(clip.width, clip.height), held, fit.occluder)
    else:
        paths = frame_paths(frames)
        views = {t: read_view(paths[t], masks / paths[t].name, fit) for t in held}
    gaussians, poses = Gaussians.read(trained / "avatar.npz"), Poses(Body.load(), BodyParams.read(trained / "body.npz"))
    moved = poses.copy()
    move_onto(gaussians, moved, held, views)
    return {f"{name}{ending}": value for ending, own in (("", poses), ("_moved", moved))
            for name, value in _judge(gaussians, own, views).items()}


def judge_edge(gaussians: Gaussians, poses: Poses, views: Mapping[int, View]) -> dict[str, float]:
    """`edge_error`: squared error on white in the band about the outline, mean of its values; `stray_edge`: alpha farther outside
    the mask than its soft edge, over the person's pixels. views: frame -> view.
    """

    def of_frame(frame: tuple[int, View], workspace: Workspace) -> tuple[float, float]:
        t, view = frame
        rgb, alpha = render_view(gaussians, poses, t, view, workspace)
        true_rgb, mask = truth(view)
        person = mask >= 0.5
        edge, _, far = find_edge(person, view.camera.height)
        error = squared_error(composite(rgb, alpha, WHITE), composite(true_rgb, mask, WHITE))
        return float(error[edge].mean()), float(alpha[far].sum() / person.sum())

    error, stray = np.mean(side_by_side(of_frame, views.items()), 0)
    return {"edge_error": float(error), "stray_edge": float(stray)}


def _judge(gaussians: Gaussians, poses: Poses, views: Mapping[int, View]) -> dict[str, float | None]:
    found = summary(judge(gaussians, poses, list(views), views, flip=True))
    return {name: found[name] for name in FIGURES} | judge_edge(gaussians, poses, views)


if __name__ == "__main__":
    main()

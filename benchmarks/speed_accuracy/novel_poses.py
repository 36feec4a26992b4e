"""Judges an avatar in poses that it was not trained on, against rendered truth of the same person in these poses.

The truth's joint rotations and expressions pose the avatar's own body. One camera cannot see scale, so the avatar's size differs
from the truth's: each frame's translation is the one that brings its joints closest to the truth's in the image.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.artifacts import BODY_SHAPES, frame_paths, read_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.frame_files import read_frame
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY, J
from gsac.avatar.metrics import summary
from gsac.avatar.threads import Workspace, side_by_side
from gsac.benchmarks.moved_poses import move_onto
from gsac.stages.train.judge.heldout import judge, render_view
from gsac.stages.train.judge.novel_poses import disc
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View

RIM = 1 / 240
"""Share of the picture's height about the silhouette's edge where alpha may differ from the truth's."""


def read_true_params(truth: Path, model: str) -> BodyParams:
    """The true body parameters in a turntable's truth.npz. model: digest of the body that they shall pose."""
    arrays = read_arrays(truth)
    fields = {name: arrays[name] for name in BODY_SHAPES if name not in ("model", "sigma_joints")}
    return BodyParams(**fields, sigma_joints=np.full((len(arrays["transl"]), J), 1e-3, np.float32), model=model)


def judge_poses(trained: Path, clip: Path, folder: Path, height: int | None = None, name: str = "novel") -> dict[str, float | None]:
    """`psnr_novel`, `ssim_novel`, `flip_novel`, `detail_novel`, and the same with `_aligned`: each pose first moved onto its image;
    also `stray_novel` and `holes_novel`, aligned, of `judge_outline`.

    trained: output folder of `train`; clip: a turntable's folder of novel poses; folder: for truth, render and error images;
    height: px to judge at, None for the clip's own; name: of the poses, in the place of `novel`.
    """
    body, gaussians = Body.load(), Gaussians.read(trained / "avatar.npz")
    truth = read_true_params(clip / "truth.npz", body.digest)
    views = read_views(clip, truth, height)
    params = transfer_poses(BodyParams.read(trained / "body.npz"), truth, body)
    poses, frames = Poses(body, params), range(params.frames)
    folder.mkdir(parents=True, exist_ok=True)
    found = rename_metrics(summary(judge(gaussians, poses, frames, views, folder, flip=True)), name)
    move_onto(gaussians, poses, frames, views)
    found |= rename_metrics(summary(judge(gaussians, poses, frames, views, flip=True)), f"{name}_aligned")
    return found | {f"{what}_{name}": value for what, value in judge_outline(gaussians, poses, views).items()}


def judge_outline(gaussians: Gaussians, poses: Poses, views: list[View]) -> dict[str, float]:
    """`stray`: alpha farther than RIM outside of the true silhouette; `holes`: alpha missing farther than RIM inside of it; both
    over the silhouette's area, mean over the frames."""

    def of_frame(t: int, workspace: Workspace) -> tuple[float, float]:
        alpha, mask = render_view(gaussians, poses, t, views[t], workspace)[1], views[t].pixels[..., 3]
        rim = disc(max(1, round(RIM * views[t].camera.height)))
        outside, inside = cv2.dilate(mask, rim) == 0, cv2.erode(mask, rim) == 255
        area = max(float(mask.sum()) / 255, 1.0)
        return float(alpha[outside].sum()) / area, float((1 - alpha)[inside].sum()) / area

    stray, holes = np.mean(side_by_side(of_frame, range(len(views))), 0)
    return {"stray": float(stray), "holes": float(holes)}


def rename_metrics(metrics: dict[str, float | None], ending: str) -> dict[str, float | None]:
    """PSNR, SSIM, FLIP and detail with the ending in their names."""
    return {f"{name.removesuffix('_fg')}_{ending}": metrics[name] for name in ("psnr_fg", "ssim", "flip", "detail")}


def read_views(clip: Path, truth: BodyParams, height: int | None) -> list[View]:
    """The clip's frames with their masks as alpha, `height` px high, or as they are."""
    views = []
    for path in frame_paths(clip / "frames"):
        view = read_view(path, clip / "mask" / path.name, truth)
        views.append(view.reduced(height) if height else view)
    return views


def read_view(frame: Path, mask: Path, params: BodyParams) -> View:
    """A frame with its true mask as alpha. Raises FileNotFoundError without a mask."""
    rgb, alpha = read_frame(frame), cv2.imread(str(mask), cv2.IMREAD_GRAYSCALE)
    if alpha is None:
        raise FileNotFoundError(f"{mask}: there is no such mask")
    pixels = np.dstack([rgb * (alpha[..., None] / 255), alpha])
    return View(params.camera(alpha.shape[1], alpha.shape[0]), np.clip(np.round(pixels), 0, 255).astype(np.uint8), (0, 0))


def transfer_poses(own: BodyParams, truth: BodyParams, body: Body) -> BodyParams:
    """The avatar's body in the truth's poses, in front of the truth's camera. own: the avatar's shape."""
    params = BodyParams.from_pose(truth.pose, np.zeros_like(truth.transl), own.betas, truth.expression, truth.focal,
                                  truth.center, own.joint_offset, own.model)
    joints = body.posed(params)[1]
    shifts = [solve_translation(at[BODY], to[BODY]) for at, to in zip(joints, truth.joints, strict=True)]
    params.transl = np.stack(shifts).astype(np.float32)
    params.joints = joints + params.transl[:, None]
    return params


def solve_translation(joints: np.ndarray, goals: np.ndarray) -> np.ndarray:
    """Translation (3,) m of joints (n, 3) m onto the camera rays of goals (n, 3) m, by least squares."""
    x, y = (goals[:, :2] / goals[:, 2:]).T
    one, zero = np.ones_like(x), np.zeros_like(x)
    rows = np.concatenate([np.stack([one, zero, -x], 1), np.stack([zero, one, -y], 1)])
    wanted = np.concatenate([x * joints[:, 2] - joints[:, 0], y * joints[:, 2] - joints[:, 1]])
    return np.linalg.lstsq(rows, wanted, rcond=None)[0]

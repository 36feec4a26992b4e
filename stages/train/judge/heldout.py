"""Judges renders of frames, as large as these were filmed, against the truth, and aligns their poses at test time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from gsac.avatar import wholebody
from gsac.avatar.camera import Camera
from gsac.avatar.feature_distance import FeatureDistance
from gsac.avatar.frame_files import write_frame
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.metrics import WHITE, composite, find_shown, score, score_person
from gsac.avatar.raster import render_bound, render_bound_backward
from gsac.avatar.rotation import about_y
from gsac.avatar.threads import Workspace, side_by_side
from gsac.avatar.zbuffer import rasterise, visible_points
from gsac.stages.train.finite import named_pose, require_finite
from gsac.stages.train.gaussians.kernels import on_background, through_background
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View, Views, person_crop

TEST_RATE = 1e-3
"""Adam rate of the test-time pose optimisation."""
TEST_END, TEST_MASK = 0.05, 0.1
"""Factor that this rate falls to, and the weight of the mask beside the image."""
FACE_WIDTH, HAND_MARGIN = 1.3, 0.15
"""Boxes that are judged on their own: side of the face's over the distance of the ears; margin round a hand's key points."""
BOX_SLACK, LEAST_VISIBLE, BOX_HEIGHT = 0.03, 0.4, 540
"""m that a key point may lie inside the body, the least share of them in view, and px of the image, at most, that tells it."""
ERROR_FULL = 0.5
"""Error at the last colour of the error maps."""


def render_view(gaussians: Gaussians, poses: Poses, t: int, view: View,
                workspace: Workspace) -> tuple[np.ndarray, np.ndarray]:
    """rgb (H, W, 3) premultiplied and alpha (H, W) of frame t in its pose; copies."""
    rendering = render_bound(poses.vertices(t), poses.body.faces, gaussians, view.camera, workspace)
    return rendering.rgb.copy(), rendering.alpha.copy()


def truth(view: View) -> tuple[np.ndarray, np.ndarray]:
    """rgb (H, W, 3) premultiplied and mask (H, W) of the frame, 0..1."""
    return view.pixels[..., :3] / np.float32(255), view.pixels[..., 3] / np.float32(255)


class Candidate(NamedTuple):
    """An avatar with its poses, to be judged in some frames."""

    gaussians: Gaussians
    poses: Poses
    frames: Iterable[int]
    views: Views


def judge(gaussians: Gaussians, poses: Poses, frames: Iterable[int], views: Views, folder: Path | None = None,
          flip: bool = False, networks: Mapping[str, FeatureDistance] | None = None) -> list[dict]:
    """`metrics.score` of each frame; with a folder also %06d_truth, _render and _error PNGs on white."""

    def row(candidate: Candidate, t: int, workspace: Workspace) -> dict:
        images, boxes = draw(candidate, t, workspace), find_boxes(candidate.poses, t, candidate.views[t].camera)
        if folder is not None:
            write_pictures(folder, t, *images)
        return score(*images, boxes, flip, networks)

    return _of_each_frame([Candidate(gaussians, poses, frames, views)], row)[0]


def judge_all(candidates: list[Candidate]) -> list[list[dict]]:
    """`metrics.score` of each candidate's frames, without boxes, all side by side."""
    return _of_each_frame(candidates, lambda candidate, t, workspace: score(*draw(candidate, t, workspace)))


def judge_person(candidates: list[Candidate]) -> list[list[dict]]:
    """`metrics.score_person` of each candidate's frames, all side by side: where avatars are only compared."""
    return _of_each_frame(candidates, lambda candidate, t, workspace: score_person(*draw(candidate, t, workspace)))


def _of_each_frame(candidates: list[Candidate], row: Callable[[Candidate, int, Workspace], dict]) -> list[list[dict]]:
    rows = iter(side_by_side(lambda each, workspace: row(*each, workspace),
                             [(candidate, int(t)) for candidate in candidates for t in candidate.frames]))
    return [[next(rows) for _ in candidate.frames] for candidate in candidates]


def draw(candidate: Candidate, t: int, workspace: Workspace) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """rgb (H, W, 3) premultiplied and alpha (H, W) of the candidate in frame t, then those of `truth`. Raises StageError where a
    number is not finite.
    """
    require_finite("when it is judged", named_pose(candidate.poses, t))
    rgb, alpha = render_view(candidate.gaussians, candidate.poses, t, candidate.views[t], workspace)
    require_finite("when it is judged", {f"render of frame {t}": rgb, f"alpha of frame {t}": alpha})
    return rgb, alpha, *truth(candidate.views[t])


def write_pictures(folder: Path, t: int, rgb: np.ndarray, alpha: np.ndarray, true_rgb: np.ndarray, mask: np.ndarray) -> None:
    """%06d_truth, _render and _error PNGs of frame t on white. rgb, true_rgb: (H, W, 3) premultiplied; alpha, mask: (H, W)."""
    area = find_shown(alpha, mask)  # the rest is white in both
    render, real = composite(rgb[area], alpha[area], WHITE), composite(true_rgb[area], mask[area], WHITE)
    heat = np.zeros(mask.shape, np.uint8)
    heat[area] = np.clip(np.abs(render - real).mean(2) / ERROR_FULL, 0, 1) * 255
    for name, image in (("truth", real), ("render", render)):
        whole = np.full(rgb.shape, 255, np.uint8)
        whole[area] = np.round(image * 255)
        write_frame(folder / f"{t:06d}_{name}.png", whole)
    write_frame(folder / f"{t:06d}_error.png", cv2.cvtColor(cv2.applyColorMap(heat, cv2.COLORMAP_INFERNO), cv2.COLOR_BGR2RGB))


def find_boxes(poses: Poses, t: int, camera: Camera) -> dict[str, tuple[int, int, int, int]]:
    """x0, y0, x1, y1 px of face, left_hand and right_hand in frame t, of those that the body itself does not hide.

    The face is a square between nose and ears, FACE_WIDTH times the distance of the ears; a hand is the box of its key points.
    """
    vertices = poses.vertices(t)
    points = poses.body.keypoints(vertices)
    scale = min(1.0, BOX_HEIGHT / camera.height)
    small = camera.scaled(max(1, round(scale * camera.width)), round(scale * camera.height))
    depth = rasterise(vertices, poses.body.faces, small)[2]
    nose, ears = points[wholebody.BODY][0], points[wholebody.BODY][3:5]
    middle = 0.6 * nose + 0.4 * ears.mean(0)
    half = FACE_WIDTH / 2 * np.linalg.norm(ears[1] - ears[0]) * np.array([1.0, 1.0, 0.0])
    areas = {"face": (points[:3], np.stack([middle - half, middle + half]), 0.0)}
    for side, part in wholebody.HANDS.items():
        areas[f"{side}_hand"] = points[part], points[part], HAND_MARGIN
    found = {}
    for name, (shown, extent, margin) in areas.items():
        if not np.isfinite(extent).all() or visible_points(shown, depth, small, BOX_SLACK).mean() < LEAST_VISIBLE:
            continue
        xy = camera.project(extent)
        low, high = xy.min(0), xy.max(0)
        room = margin * (high - low).max()
        (x0, y0), (x1, y1) = np.floor(low - room).astype(int), np.ceil(high + room).astype(int)
        found[name] = max(int(x0), 0), max(int(y0), 0), min(int(x1), camera.width), min(int(y1), camera.height)
    return found


def align_pose(gaussians: Gaussians, poses: Poses, t: int, view: View, steps: int, workspace: Workspace) -> None:
    """Test-time pose optimisation: moves the pose of frame t in `poses` to its own image; the avatar stays."""
    view = person_crop(view)
    background, gain, grad_gain = np.full(3, 1, np.float32), np.ones(3, np.float32), np.empty(3)
    image, target, grad_rgb = (np.empty((*view.pixels.shape[:2], 3), np.float32) for _ in range(3))
    grad_alpha, spans = np.empty(view.pixels.shape[:2], np.float32), np.empty((len(image), 2), np.int64)
    for step in range(steps):
        rendering = render_bound(poses.vertices(t), poses.body.faces, gaussians, view.camera, workspace)
        on_background(workspace.share, rendering.rgb, rendering.alpha, view.pixels, background, gain, image, target, spans)
        image -= target
        image *= np.float32(2 / image.size)
        through_background(workspace.share, image, rendering.rgb, rendering.alpha, view.pixels, background, gain, TEST_MASK,
                           grad_rgb, grad_alpha, grad_gain)
        grads = render_bound_backward(rendering.state, grad_rgb, grad_alpha)
        require_finite(f"at step {step} of its pose at test time", {f"gradient of frame {t}": grads.vertices})
        poses.step(t, grads.vertices, TEST_RATE * TEST_END ** (step / steps), 0.0)


def draw_all_round(gaussians: Gaussians, poses: Poses, size: int = 480) -> np.ndarray:
    """(2 size, 3 size, 3) uint8: the avatar in its T-pose, face at rest, from the front, both sides, the back, below and above."""
    vertices = poses.at_rest()
    middle = (vertices.min(0) + vertices.max(0)) / 2
    half = float(np.abs(vertices - middle).max()) * 1.1
    upright = np.diag([1.0, -1.0, -1.0])

    def tile(degrees: tuple[int, int], workspace: Workspace) -> np.ndarray:
        y, x = np.radians(degrees)
        turn = about_y(y)
        tilt = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
        posed = (vertices - middle) @ (tilt @ upright @ turn).T + np.array([0, 0, 5 * half])
        camera = Camera((size * 2.4, size * 2.4), (size / 2, size / 2), size, size)
        rendering = render_bound(posed.astype(np.float32), poses.body.faces, gaussians, camera, workspace)
        return np.uint8(np.round(composite(rendering.rgb, rendering.alpha, WHITE) * 255))

    tiles = side_by_side(tile, ((0, 0), (90, 0), (180, 0), (-90, 0), (20, -65), (20, 50)))
    return np.vstack([np.hstack(tiles[:3]), np.hstack(tiles[3:])])

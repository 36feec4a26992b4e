"""Errors of a fitted body against the truth, in the units of the targets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.zbuffer import silhouette
from gsac.benchmarks.fit.truth import Truth

PERSON_PX = 1000
"""Height of the person that pixel errors are scaled to."""


def score(body: Body, params: BodyParams, truth: Truth) -> dict[str, float]:
    """Errors of a fit over all frames of the truth; errors that the truth does not allow are left out.

    joints_median_mm, joints_mean_mm: body joints without the pelvis, after aligning the pelvis and one scale for the clip.
    joints_metric_mm: the mean without the scale. vertices_mean_mm: aligned likewise, with a scale of its own; the truth's vertices
    are bare, the fit's include its clothes; skin_mean_mm: the fit's without clothes.
    iou_mean, iou_worst: silhouette of the fitted body against the clip's mask, which shows clothes and hair; iou_of_truth: mean of
    the true bare body.
    reprojection_px: median distance of body and feet points, for a person 1000 px high.
    acceleration_ratio: mean |acceleration of the joints| over the truth's; acceleration_error_ratio: mean |difference of the
    accelerations| over the truth's. focal_error: relative.
    """
    vertices, joints = body.posed(params)
    fitted, true = _subtract_root(joints[:, truth.joint]), _subtract_root(truth.joints)
    scale = _scale(fitted, true)
    off = np.linalg.norm(scale * fitted - true, axis=-1)[:, 1:] * 1e3
    out = {"joints_median_mm": np.median(off), "joints_mean_mm": off.mean(),
           "joints_metric_mm": np.linalg.norm(fitted - true, axis=-1)[:, 1:].mean() * 1e3, "scale": scale}
    if truth.vertices is not None and truth.vertices.shape == vertices.shape:
        true_vertices = truth.vertices - truth.joints[:, :1]
        out["vertices_mean_mm"] = _distance(vertices - joints[:, :1], true_vertices)
        bare, own_joints = body.posed(replace(params, betas=np.where(np.arange(body.num_betas) < body.num_figure, params.betas, 0)))
        out["skin_mean_mm"] = _distance(bare - own_joints[:, :1], true_vertices)
        own = Camera((truth.focal, truth.focal), truth.center, *truth.masks.shape[:0:-1])
        out["iou_of_truth"] = _overlap(body, truth.vertices, own, truth.masks).mean()
    camera = params.camera(*truth.masks.shape[:0:-1])
    iou = _overlap(body, vertices, camera, truth.masks)
    out |= {"iou_mean": iou.mean(), "iou_worst": iou.min()}
    away = np.linalg.norm(camera.project(body.keypoints(vertices)[:, :23]) - truth.keypoints, axis=-1)
    out["reprojection_px"] = np.nanmedian(away * (PERSON_PX / truth.person_px)[:, None])
    if len(fitted) >= 3:
        a, b = np.diff(scale * fitted, 2, axis=0)[:, 1:], np.diff(true, 2, axis=0)[:, 1:]
        own = np.linalg.norm(b, axis=-1).mean()
        out["acceleration_ratio"] = np.linalg.norm(a, axis=-1).mean() / own
        out["acceleration_error_ratio"] = np.linalg.norm(a - b, axis=-1).mean() / own
    out["focal_error"] = abs(float(params.focal[0]) / truth.focal - 1)
    return {name: float(value) for name, value in out.items()}


def joint_distances(body: Body, params: BodyParams, truth: Truth) -> np.ndarray:
    """Distance (T, n) mm between fitted and true joints, aligned as in `score`."""
    return align_joints(body.posed(params)[1][:, truth.joint], truth.joints)


def align_joints(fitted: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Distance (T, n) mm between fitted and true joints (T, n, 3) m: pelvis aligned, one scale for all frames."""
    fitted, true = _subtract_root(fitted), _subtract_root(true)
    return np.linalg.norm(_scale(fitted, true) * fitted - true, axis=-1) * 1e3


def _subtract_root(joints: np.ndarray) -> np.ndarray:
    """Joints (T, n, 3) from the first, the pelvis."""
    return np.asarray(joints - joints[:, :1], np.float64)


def _scale(source: np.ndarray, target: np.ndarray) -> float:
    """The scale of source (..., 3) that minimises the squared distance to target (..., 3)."""
    return float((source * target).sum() / (source * source).sum())


def _distance(source: np.ndarray, target: np.ndarray) -> float:
    """Mean distance, mm, of the scaled source from the target."""
    return float(np.linalg.norm(_scale(source, target) * source - target, axis=-1).mean() * 1e3)


def _overlap(body: Body, vertices: np.ndarray, camera: Camera, masks: np.ndarray) -> np.ndarray:
    """(T,) intersection over union of the drawn body and the masks."""
    drawn = [silhouette(v, body.faces, camera) for v in vertices]
    return np.array([(d & m).sum() / max((d | m).sum(), 1) for d, m in zip(drawn, masks, strict=True)])

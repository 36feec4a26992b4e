"""A fitted body against the truth, in the numbers that the bars are written in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.zbuffer import silhouette
from gsac.benchmarks.fit.truth import Truth

PERSON_PX = 1000
"""Pixel errors are for a person this high."""


def score(body: Body, params: BodyParams, truth: Truth) -> dict[str, float]:
    """Errors of a fit of all of the truth's frames.

    joints_median_mm, joints_mean_mm: body joints but the pelvis, pelvis on pelvis, one scale for the whole clip.
    joints_metric_mm: the same mean without the scale. vertices_mean_mm: registered alike, with a scale of their own; the truth's
    are bare, the fit's wear what it takes for clothes; skin_mean_mm: the fit's without those.
    iou_mean, iou_worst: the bare fitted body against the clip's mask, which wears clothes and hair; iou_of_truth: the mean that
    the true bare body itself reaches.
    reprojection_px: median distance of body and feet points, person 1000 px high.
    acceleration_ratio: mean |acceleration of the joints| over the truth's own; acceleration_error_ratio: mean |difference of the
    two| over the truth's own. focal_error: relative. Missing where the truth does not tell.
    """
    vertices, joints = body.posed(params)
    fitted, true = _rooted(joints[:, truth.joint]), _rooted(truth.joints)
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
    """(T, n) mm between the truth's joints and the fit's, aligned as in `score`."""
    fitted, true = _rooted(body.posed(params)[1][:, truth.joint]), _rooted(truth.joints)
    return np.linalg.norm(_scale(fitted, true) * fitted - true, axis=-1) * 1e3


def _rooted(joints: np.ndarray) -> np.ndarray:
    return np.asarray(joints - joints[:, :1], np.float64)


def _scale(source: np.ndarray, target: np.ndarray) -> float:
    """The one factor that brings source nearest to target."""
    return float((source * target).sum() / (source * source).sum())


def _distance(source: np.ndarray, target: np.ndarray) -> float:
    """mm, mean, source scaled to the target."""
    return float(np.linalg.norm(_scale(source, target) * source - target, axis=-1).mean() * 1e3)


def _overlap(body: Body, vertices: np.ndarray, camera: Camera, masks: np.ndarray) -> np.ndarray:
    """(T,) intersection over union of the drawn body and the masks."""
    drawn = [silhouette(v, body.faces, camera) for v in vertices]
    return np.array([(d & m).sum() / max((d | m).sum(), 1) for d, m in zip(drawn, masks, strict=True)])

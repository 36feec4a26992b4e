"""The head mesh that `face` found, aligned with the head of whichever body is fitted, and the face terms."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gsac.avatar import rotation
from gsac.avatar.body import BodyParams
from gsac.avatar.flame_file import read_flame
from gsac.stages.contract import StageError
from gsac.stages.smplx.paper.head import EYES, Head, HeadTerms, faces_camera, select_head
from support.turning_person import FOCAL, head_of


def brought(flame_file, betas) -> dict[str, np.ndarray]:
    """face.npz's arrays of a FLAME head of this shape."""
    flame = read_flame(flame_file)
    head = flame.rest(betas)
    return {"head_template": flame.v_template - [0, 0.8, 0], "head_vertices": head - head.mean(0), "head_faces": flame.faces,
            "head_eyes": flame.J_regressor[3:] @ flame.v_template - [0, 0.8, 0]}


def test_a_flame_head_is_carried_over_to_the_bodys_vertices(body, flame_file):
    betas = np.random.default_rng(0).normal(0, 1, body.num_betas)
    head = Head.from_arrays(brought(flame_file, betas), body)
    assert len(head.index) > 0.9 * select_head(body).sum()
    assert np.array_equal(head.index[head.faces].shape[1:], (3,)) and head.faces.max() < len(head.index)
    true = body.rest(betas)[0][head.index]
    off = np.linalg.norm(head.vertices - head.vertices.mean(0) - true + true.mean(0), axis=1)
    assert off.mean() < 0.001


def test_the_face_terms_tell_a_head_from_another(body, flame_file):
    betas = np.random.default_rng(1).normal(0, 1, body.num_betas).astype(np.float32)
    terms = HeadTerms(body, Head.from_arrays(brought(flame_file, betas), body))
    own, other = (float(terms.loss(torch.tensor(b), torch.zeros(terms.count, 3))) for b in (betas, np.zeros_like(betas)))
    assert own < 0.5 * other


def test_a_mesh_that_is_no_head_is_refused(body, flame_file):
    arrays = brought(flame_file, [0.0])
    with pytest.raises(StageError, match="no head_eyes"):
        Head.from_arrays({k: v for k, v in arrays.items() if k != "head_eyes"}, body)
    with pytest.raises(StageError, match="head_faces must be"):
        Head.from_arrays(arrays | {"head_faces": arrays["head_faces"] + 5023}, body)
    with pytest.raises(StageError, match="head vertices lie on its head mesh"):
        far = np.linspace(0, 9, len(arrays["head_template"]))[:, None]
        Head.from_arrays(arrays | {"head_template": arrays["head_template"] + far}, body)
    assert Head.from_arrays({}, body) is None


@pytest.mark.slow
def test_face_terms_vanish_at_the_same_head_and_lead_towards_it(body):
    betas = np.random.default_rng(3).normal(0, 1, body.num_betas).astype(np.float32)
    terms = HeadTerms(body, Head.from_arrays(head_of(body, betas), body))
    none, half = (torch.tensor(betas * share, requires_grad=True) for share in (0.0, 0.5))
    none_offset = torch.zeros(terms.count, 3)
    terms.loss(half, none_offset).backward()
    here, midway, there = (float(terms.loss(b.detach(), none_offset)) for b in (torch.tensor(betas), half, none))
    assert here < 0.1 * there and here < midway < there
    assert float((half.grad * torch.tensor(betas)).sum()) < 0


@pytest.mark.slow
def test_the_face_counts_only_when_it_looks_at_the_camera(body):
    yaw = np.radians([0, 30, 60, 90, 180, 270, 330])
    pose = np.zeros((len(yaw), 55, 3))
    pose[:, 0] = rotation.log(rotation.exp(np.array([np.pi, 0, 0])) @ rotation.exp(np.stack([0 * yaw, yaw, 0 * yaw], 1)))
    transl = np.tile([0, 0, 3.0], (len(yaw), 1))
    params = BodyParams.from_pose(pose, transl, np.zeros(20), np.zeros((len(yaw), 52)), FOCAL, (180, 320))
    vertices = body.posed(params)[0]
    seen = faces_camera(vertices[:, select_head(body)].mean(1), body.keypoints(vertices)[:, EYES].mean(1))
    assert seen.tolist() == [True, True, False, False, False, False, True]

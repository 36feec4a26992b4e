"""Anny's linear body, y up, in its own rest pose and in the T-pose with SMPL-X's joints."""

from __future__ import annotations

import anny
import numpy as np
import torch
from jaw import jaw_pivot
from skeleton import JOINTS, PARENTS, finger_tails, fold_weights, head_bone
from t_pose import t_pose_rotations

ACTIONS = 52
TO_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)


class Source:
    """The model around a mean body. Coefficients (K,) of anny's blend shapes make a body."""

    def __init__(self) -> None:
        self.model = anny.Anny(rig="anny", topology="anny", local_changes="all", facial_actions="all",
                               phenotype_blendshapes="original")
        self.bones = list(self.model.bone_labels)
        self.shape_vertices, self.shape_heads, self.vertices, self.heads = (
            np.asarray(x.numpy(), float) @ TO_Y_UP.T for x in (
                self.model.blendshapes, self.model.bone_heads_blendshapes, self.model.template_vertices,
                self.model.template_bone_heads))
        end = len(self.shape_vertices) - 2 * len(self.model.local_change_labels)
        self.actions = self.shape_vertices[end - ACTIONS: end]
        self.weights = fold_weights(self.model, self.bones)

    def stand(self, mean: np.ndarray) -> None:
        """Computes the rotations to the T-pose and the jaw's place on the mean body. mean: (K,) coefficients."""
        self.mean_vertices, heads = self.rest(mean)
        self.mean_heads = dict(zip(self.bones, heads, strict=True))
        self.rotations = t_pose_rotations(self.mean_heads, finger_tails(self.mean_heads, self.mean_vertices, self.weights))
        self.jaw_open = self.actions[self.model.facial_action_labels.index("jawOpen")]
        self.jaw = jaw_pivot(self.mean_vertices, self.jaw_open)
        self.ear = np.argsort(np.linalg.norm(self.mean_vertices - self.jaw, axis=1))[:24]
        self.a_inverse = np.linalg.inv(np.einsum("vj,jba->vab", self.weights, self.rotations))

    def coefficients(self, phenotypes: np.ndarray, local: np.ndarray) -> np.ndarray:
        """Coefficients (S, K) of bodies with neutral faces. phenotypes: (S, 6) of anny; local: (S, L) sliders."""
        with torch.no_grad():
            return self.model._get_phenotype_blendshape_coefficients(
                torch.as_tensor(phenotypes), torch.as_tensor(local), torch.zeros(len(local), ACTIONS, dtype=torch.float64)).numpy()

    def rest(self, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (V, 3) m and bone heads (B, 3) m in anny's rest pose. c: (K,) coefficients."""
        return self.vertices + np.tensordot(c, self.shape_vertices, 1), self.heads + np.tensordot(c, self.shape_heads, 1)

    def joints(self, vertices: np.ndarray, heads: np.ndarray) -> np.ndarray:
        """Joints (55, 3) m in anny's rest pose; the jaw moves with the skin beside the ear.

        vertices: (V, 3) m; heads: (B, 3) m; of `rest`.
        """
        at = dict(zip(self.bones, heads, strict=True))
        shift = (vertices[self.ear] - self.mean_vertices[self.ear]).mean(0) * np.array([0, 1, 1])
        return np.stack([self.jaw + shift if j == "jaw" else at[head_bone(j)] for j in JOINTS])

    def t_pose(self, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (V, 3) m in the T-pose, whose LBS back to anny's rest pose is exact, and joints (55, 3) m. c: (K,)."""
        vertices, heads = self.rest(c)
        joints = self.joints(vertices, heads)
        out = joints.copy()
        for j, p in enumerate(PARENTS):
            if p >= 0:
                out[j] = out[p] + self.rotations[p] @ (joints[j] - joints[p])
        moved = joints - np.einsum("jba,jb->ja", self.rotations, out)
        return np.einsum("vab,vb->va", self.a_inverse, vertices - self.weights @ moved), out

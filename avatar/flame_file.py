"""Reads and checks a FLAME head model (Li et al. 2017) that a user owns; an error names the array, its shape and the expected one.

V = 5023 vertices, F = 9976 faces, 5 joints (root, neck, jaw, eyes), 300 shape and 100 expression directions. The official file is
a pickle, which runs code when it is read: it is refused, and has to be saved as .npz with the same names once. FLAME's own
`mediapipe_landmark_embedding.npz` places the points of the face network on the head.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.npz import NpzError, read_npz

SHAPES, EXPRESSIONS = 300, 100
ARRAYS = {"v_template": (5023, 3), "f": (9976, 3), "shapedirs": (5023, 3, SHAPES + EXPRESSIONS), "posedirs": (5023, 3, 36),
          "J_regressor": (5, 5023), "weights": (5023, 5), "kintree_table": (2, 5)}
POINTS = {"landmark_indices": 1, "lmk_face_idx": 1, "lmk_b_coords": 2}
"""Array of the landmarks' file -> number of dimensions."""
MESH_POINTS = 468
"""Points of the face network; later numbers are of the iris, which no head has."""


@dataclass
class Flame:
    """The head at rest as a function of its shape and expression."""

    v_template: np.ndarray  # (5023, 3) m
    faces: np.ndarray  # (9976, 3) int32
    shapedirs: np.ndarray  # (5023, 3, 300) m
    exprdirs: np.ndarray  # (5023, 3, 100) m
    posedirs: np.ndarray  # (5023, 3, 36) m
    J_regressor: np.ndarray  # (5, 5023)
    weights: np.ndarray  # (5023, 5)
    parents: np.ndarray  # (5,) int, -1 for the root

    def rest(self, shape: np.ndarray, expression: np.ndarray | None = None) -> np.ndarray:
        """Vertices (5023, 3) m; shape and expression may be shorter than the file's directions."""
        vertices = self.v_template + self.shapedirs[:, :, : len(shape)] @ np.asarray(shape, np.float32)
        if expression is not None:
            vertices = vertices + self.exprdirs[:, :, : len(expression)] @ np.asarray(expression, np.float32)
        return vertices


@dataclass
class FlamePoints:
    """Where L of the face network's 468 points lie on the head."""

    index: np.ndarray  # (L,) number of the point
    face: np.ndarray  # (L,) face of the head that it lies in
    bary: np.ndarray  # (L, 3) its barycentric coordinates there

    def on(self, flame: Flame, vertices: np.ndarray) -> np.ndarray:
        """Values (5023, ...) of the vertices, interpolated at the points: (L, ...)."""
        return np.einsum("lk,lk...->l...", self.bary, vertices[flame.faces[self.face]])


def read_flame(path: Path | str) -> Flame:
    """The head model. Raises `ArtifactError` that names the array, its shape and the expected one."""
    path = Path(path)
    a = _arrays(path, ARRAYS)
    for name, shape in ARRAYS.items():
        if a[name].shape != shape:
            raise ArtifactError(f"{path}: array {name} has shape {a[name].shape}, expected {shape}")
    if a["f"].min() < 0 or a["f"].max() >= 5023:
        raise ArtifactError(f"{path}: array f names vertex {a['f'].max()}, but there are 5023")
    if not np.allclose(np.asarray(a["weights"], np.float32).sum(1), 1, atol=2e-2):
        raise ArtifactError(f"{path}: rows of weights must sum to one")
    for name in ("v_template", "shapedirs"):
        if not np.isfinite(a[name]).all():
            raise ArtifactError(f"{path}: array {name} is not finite")
    directions = np.asarray(a["shapedirs"], np.float32)
    parents = np.asarray(a["kintree_table"][0], np.int64).copy()
    parents[0] = -1
    if not (parents[1:] < np.arange(1, len(parents))).all() or parents[1:].min() < 0:
        raise ArtifactError(f"{path}: array kintree_table names a parent that is no earlier joint")
    return Flame(np.asarray(a["v_template"], np.float32), np.asarray(a["f"], np.int32), directions[:, :, :SHAPES],
                 directions[:, :, SHAPES:], np.asarray(a["posedirs"], np.float32), np.asarray(a["J_regressor"], np.float32),
                 np.asarray(a["weights"], np.float32), parents)


def read_flame_points(path: Path | str) -> FlamePoints:
    """The points of `mediapipe_landmark_embedding.npz`. Raises `ArtifactError` as `read_flame`."""
    path = Path(path)
    a = _arrays(path, POINTS)
    count = a["lmk_face_idx"].size
    for name, dimensions in POINTS.items():
        shape = (count, 3)[:dimensions]
        if a[name].shape != shape:
            raise ArtifactError(f"{path}: array {name} has shape {a[name].shape}, expected {shape}")
    if count == 0 or a["lmk_face_idx"].min() < 0 or a["lmk_face_idx"].max() >= ARRAYS["f"][0]:
        raise ArtifactError(f"{path}: array lmk_face_idx must name some of the {ARRAYS['f'][0]} faces")
    if a["landmark_indices"].min() < 0 or not np.allclose(a["lmk_b_coords"].sum(1), 1, atol=1e-2):
        raise ArtifactError(f"{path}: landmark_indices must not be negative and rows of lmk_b_coords must sum to one")
    known = a["landmark_indices"] < MESH_POINTS
    return FlamePoints(a["landmark_indices"][known].astype(int), a["lmk_face_idx"][known].astype(int),
                       a["lmk_b_coords"][known].astype(np.float32))


def read_flame_ids(path: Path | str) -> np.ndarray:
    """(5023,) int, the vertices of SMPL-X that are FLAME's (`SMPL-X__FLAME_vertex_ids.npy`). Raises `ArtifactError`."""
    path, count = Path(path), ARRAYS["v_template"][0]
    try:
        ids = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as e:
        raise ArtifactError(f"{path}: not a readable npy ({e}); SMPL-X's site hands it out as SMPL-X__FLAME_vertex_ids.npy") from e
    if not isinstance(ids, np.ndarray) or ids.shape != (count,) or ids.dtype.kind not in "iu" or ids.min() < 0:
        raise ArtifactError(f"{path}: expected {count} vertex numbers, found {getattr(ids, 'dtype', type(ids).__name__)} of shape "
                            f"{np.shape(ids)}")
    return ids.astype(np.int64)


def _arrays(path: Path, names: dict) -> dict[str, np.ndarray]:
    """The named arrays, whatever else the file holds."""
    if path.suffix != ".npz" and not zipfile.is_zipfile(path):  # the model store keeps files under names without suffix
        raise ArtifactError(f"{path}: a FLAME file must be .npz (pickles run code when read, so .pkl is refused); "
                            f"save its arrays {', '.join(names)} with numpy.savez once")
    try:
        found = read_npz(path, names)
    except (OSError, NpzError) as e:
        raise ArtifactError(f"{path}: not a readable npz ({e})") from e
    for name in names:
        if name not in found:
            raise ArtifactError(f"{path}: array {name} is missing; expected {', '.join(names)}")
        if found[name].dtype.kind not in "fiu":
            raise ArtifactError(f"{path}: array {name} holds {found[name].dtype}, expected numbers")
    return found

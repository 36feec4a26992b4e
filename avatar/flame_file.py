"""Reads a FLAME head model (Li et al. 2017) that a user owns, and says exactly what is wrong with a file that is not one.

V = 5023 vertices, F = 9976 faces, 5 joints (root, neck, jaw, eyes), 300 shape and 100 expression directions. The official file is
a pickle, which runs code when it is read: it is refused, and has to be saved as .npz with the same names once.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from gsac.avatar.artifacts import ArtifactError

SHAPES, EXPRESSIONS = 300, 100
ARRAYS = {"v_template": (5023, 3), "f": (9976, 3), "shapedirs": (5023, 3, SHAPES + EXPRESSIONS), "posedirs": (5023, 3, 36),
          "J_regressor": (5, 5023), "weights": (5023, 5), "kintree_table": (2, 5)}


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


def read_flame(path: Path | str) -> Flame:
    """Raises ArtifactError that names the array, what it is and what was expected."""
    path = Path(path)
    if path.suffix != ".npz":
        raise ArtifactError(f"{path}: a FLAME file must be .npz (pickles run code when read, so .pkl is refused); "
                            f"save its arrays {', '.join(ARRAYS)} with numpy.savez once")
    a = _arrays(path)
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
    return Flame(np.asarray(a["v_template"], np.float32), np.asarray(a["f"], np.int32), directions[:, :, :SHAPES],
                 directions[:, :, SHAPES:], np.asarray(a["posedirs"], np.float32), np.asarray(a["J_regressor"], np.float32),
                 np.asarray(a["weights"], np.float32), parents)


def _arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of the table, whatever else the file holds."""
    found = {}
    try:
        with np.load(path, allow_pickle=False) as z:
            for name, shape in ARRAYS.items():
                if name not in z.files:
                    raise ArtifactError(f"{path}: array {name} is missing; a FLAME file has {', '.join(ARRAYS)}")
                try:
                    found[name] = z[name]
                except ValueError as e:
                    raise ArtifactError(f"{path}: array {name} is a pickled object; save it as a plain array") from e
                if found[name].shape != shape:
                    raise ArtifactError(f"{path}: array {name} has shape {found[name].shape}, expected {shape}")
    except (OSError, ValueError) as e:
        raise ArtifactError(f"{path}: not a readable npz ({e})") from e
    return found

"""Reads and checks body model files; an error names the array, its shape and the expected one.

Two kinds have the same keys: the open body (`open_body/open_body.npz`, CC0 data) and the official SMPL-X npz that a user
owns. Pickles are refused: they run code.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from scipy import sparse

from gsac.avatar import joints, wholebody
from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.correctives import DIRECTIONS
from gsac.avatar.joints import J
from gsac.avatar.npz import NpzError, read_npz
from gsac.avatar.wholebody import BODY_NAMES, HAND_POINTS

ALWAYS = {"v_template": 2, "f": 2, "shapedirs": 3, "J_regressor": 2, "weights": 2, "kintree_table": 2}
"""Array -> number of dimensions."""
SOMETIMES = ("num_betas", "posedirs", "hands_meanl", "hands_meanr", "hands_componentsl", "hands_componentsr", "expression_names",
             "clothes", "jaw_actions", "keypoint_row", "keypoint_vertex", "keypoint_weight", "vt", "ft", "lmk_faces_idx",
             "lmk_bary_coords")
"""Arrays that only some body models have."""
MOST_VERTICES, MOST_DIRECTIONS = 50_000, 500
SMPLX_KEYPOINT_JOINTS = {keypoint: joints.INDEX[name] for keypoint, name in enumerate(BODY_NAMES) if name in joints.INDEX} | {
    wholebody.INDEX[f"{side}_hand_{point}"]: joints.INDEX[f"{side}_{point}"]
    for side in ("left", "right") for point in HAND_POINTS.split() if f"{side}_{point}" in joints.INDEX}
"""COCO-WholeBody keypoint -> joint of the same name, for a file without a keypoint matrix."""
SMPLX_KEYPOINT_VERTICES = {
    0: 9120, 1: 9448, 2: 9929, 3: 6, 4: 616, 17: 5770, 18: 5780, 19: 8846, 20: 8463, 21: 8474, 22: 8635,
    95: 5361, 99: 4933, 103: 5058, 107: 5169, 111: 5286, 116: 8079, 120: 7669, 124: 7794, 128: 7905, 132: 8022,
}
"""COCO-WholeBody keypoint -> vertex of SMPL-X's mesh: nose, eyes, ears, toes, heels and finger tips."""
INFLUENCES = 4
"""Joints that move a vertex at most: Unity, glTF and the browser skin with no more, and fit and training see what these show."""
SMPLX_VERTICES = 10475
SMPLX_EXPRESSIONS = 100
"""The last shape directions of an official file are expressions: 300 + 100 in v1.1; older files have 10 + 10."""


def read_body_file(path: Path) -> dict:
    """All fields of `Body` except its digest. Raises `ArtifactError`."""
    if path.suffix != ".npz" and not zipfile.is_zipfile(path):  # the model store keeps files under names without suffix
        raise ArtifactError(f"{path}: a body model must be an .npz file (pickles run code when read, so .pkl is refused); "
                            "SMPL-X is distributed as SMPLX_NEUTRAL.npz, SMPLX_MALE.npz and SMPLX_FEMALE.npz")
    a = _read_arrays(path)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # a number beyond float32 becomes infinite, and is found
            fields = _fields(path, a)
    except (ValueError, TypeError, IndexError, KeyError) as e:  # of an array that is of another kind or shape than it should be
        raise ArtifactError(f"{path}: it is not built as a body model ({e}); get the file again from where it came from") from e
    for name, values in fields.items():
        if isinstance(values, np.ndarray) and not np.isfinite(values).all():
            raise ArtifactError(f"{path}: {name} is not finite, or beyond float32")
    return fields


def _fields(path: Path, a: dict[str, np.ndarray]) -> dict:
    v = len(a["v_template"])
    _check_sizes(path, a, v)
    shapes = np.asarray(a["shapedirs"], np.float32)
    names = [str(n) for n in a["expression_names"]] if "expression_names" in a else None
    if "num_betas" in a:
        shapedirs, exprdirs = np.split(shapes, [int(a["num_betas"])], 2)
    else:
        shapedirs, exprdirs = np.split(shapes, [_official_betas(path, shapes.shape[2])], 2)
    expressions = exprdirs.shape[2]
    return {
        "clothes": tuple(str(n) for n in a.get("clothes", ())),
        "v_template": np.asarray(a["v_template"], np.float32), "faces": np.asarray(a["f"], np.int32),
        "shapedirs": np.ascontiguousarray(shapedirs), "exprdirs": np.ascontiguousarray(exprdirs),
        "posedirs": _posedirs(path, a, v), "hand_means": _of_both_hands(path, a, "hands_mean", (45,)),
        "hand_components": _of_both_hands(path, a, "hands_components", (45, 45)),
        "J_regressor": np.asarray(a["J_regressor"], np.float32),
        "weights": keep_heaviest(np.asarray(a["weights"], np.float32), INFLUENCES),
        "parents": _parents_of(a["kintree_table"]), "joint_names": joints.NAMES,
        "expression_names": tuple(names or (f"expression{i}" for i in range(expressions))),
        "jaw_actions": np.asarray(a.get("jaw_actions", np.zeros((expressions, 3))), np.float32).reshape(expressions, 3),
        "keypoint_matrix": _keypoint_matrix(a, v), "vt": np.asarray(a["vt"], np.float32) if "vt" in a else None,
        "ft": np.asarray(a["ft"], np.int32) if "ft" in a else None,
    }


def _read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Arrays of the npz by name; the object arrays of official files are left out."""
    try:
        arrays = read_npz(path, {*ALWAYS, *SOMETIMES}, objects=False)
    except (OSError, NpzError) as e:
        raise ArtifactError(f"{path}: not a readable body model npz ({e})") from e
    for name, dims in ALWAYS.items():
        if name not in arrays:
            raise ArtifactError(f"{path}: array {name} is missing; a body model has {', '.join(ALWAYS)}")
        if arrays[name].ndim != dims:
            raise ArtifactError(f"{path}: array {name} has {arrays[name].ndim} dimensions, expected {dims}")
    return arrays


def _check_sizes(path: Path, a: dict, v: int) -> None:
    wanted = {"v_template": (v, 3), "f": (len(a["f"]), 3), "shapedirs": (v, 3, a["shapedirs"].shape[2]),
              "J_regressor": (J, v), "weights": (v, J), "kintree_table": (2, J)}
    for name, shape in wanted.items():
        if a[name].shape != shape:
            raise ArtifactError(f"{path}: array {name} has shape {a[name].shape}, expected {shape}"
                                + ("; SMPL and SMPL-H files have fewer joints, SMPL-X is needed" if J in shape else ""))
    if v > MOST_VERTICES or a["shapedirs"].shape[2] > MOST_DIRECTIONS:
        raise ArtifactError(f"{path}: {v} vertices and {a['shapedirs'].shape[2]} shape directions; at most {MOST_VERTICES} and "
                            f"{MOST_DIRECTIONS} are read")
    if a["f"].min() < 0 or a["f"].max() >= v:
        raise ArtifactError(f"{path}: array f names vertex {a['f'].max()}, but there are {v}")
    if not np.allclose(np.asarray(a["weights"], np.float32).sum(1), 1, atol=2e-2):
        raise ArtifactError(f"{path}: rows of weights must sum to one")


def _official_betas(path: Path, directions: int) -> int:
    if directions == 20:
        return 10
    if directions <= SMPLX_EXPRESSIONS:
        raise ArtifactError(f"{path}: shapedirs has {directions} directions; expected 400 (300 shape + 100 expression) or 20")
    return directions - SMPLX_EXPRESSIONS


def _posedirs(path: Path, a: dict, v: int) -> np.ndarray | None:
    """(V, 3, 486); None of a file without pose correctives, or where they are all zero."""
    if "posedirs" not in a or not a["posedirs"].any():
        return None
    if a["posedirs"].shape != (v, 3, DIRECTIONS):
        raise ArtifactError(f"{path}: array posedirs has shape {a['posedirs'].shape}, expected {(v, 3, DIRECTIONS)}")
    return np.ascontiguousarray(a["posedirs"], np.float32)


def _of_both_hands(path: Path, a: dict, name: str, shape: tuple[int, ...]) -> np.ndarray | None:
    """`name`l and `name`r one after the other: means as (30, 3), components as (2, 45, 45); None of a file that lacks one."""
    if not {f"{name}l", f"{name}r"} <= a.keys():
        return None
    for side in "lr":
        if a[name + side].shape != shape:
            raise ArtifactError(f"{path}: array {name}{side} has shape {a[name + side].shape}, expected {shape}")
    both = np.stack([a[f"{name}l"], a[f"{name}r"]]).astype(float)
    return both.reshape(-1, 3) if len(shape) == 1 else both


def _parents_of(kintree: np.ndarray) -> np.ndarray:
    """(55,) int; official files write the root's parent as 2**32 - 1."""
    parents = np.asarray(kintree[0], np.int64).copy()
    parents[0] = -1
    if not (parents[1:] < np.arange(1, J)).all() or parents[1:].min() < 0:
        raise ValueError("kintree_table names a parent that is no earlier joint")
    return parents


def keep_heaviest(weights: np.ndarray, most: int) -> np.ndarray:
    """(V, J), the most heavy of weights (V, J) of each row, renormalised."""
    keep = np.argsort(-weights, 1, kind="stable")[:, :most]
    out = np.zeros_like(weights)
    np.put_along_axis(out, keep, np.take_along_axis(weights, keep, 1), 1)
    return out / out.sum(1, keepdims=True)


def _keypoint_matrix(a: dict, v: int) -> sparse.csr_matrix:
    """(133, V); official files have the joints' regressors and known vertices for body and hands, and their face landmarks."""
    if "keypoint_row" in a:
        entries = (np.asarray(a["keypoint_weight"], np.float32), (a["keypoint_row"].astype(int), a["keypoint_vertex"].astype(int)))
        return sparse.csr_matrix(entries, shape=(133, v))
    dense = sparse.lil_matrix((133, v), dtype=np.float32)
    regressor = np.asarray(a["J_regressor"], np.float32)
    for keypoint, joint in SMPLX_KEYPOINT_JOINTS.items():
        dense[keypoint] = regressor[joint]
    for keypoint, vertex in SMPLX_KEYPOINT_VERTICES.items() if v == SMPLX_VERTICES else ():
        dense[keypoint, vertex] = 1
    if "lmk_faces_idx" in a and "lmk_bary_coords" in a:
        for i, (face, bary) in enumerate(zip(a["lmk_faces_idx"], a["lmk_bary_coords"], strict=True)):
            for vertex, weight in zip(a["f"][int(face)], bary, strict=True):
                dense[40 + i, int(vertex)] += float(weight)
    return dense.tocsr()

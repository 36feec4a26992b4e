"""Checks a model file that a user brings before it is kept: what it is is told by what it holds."""

from __future__ import annotations

import zipfile
from pathlib import Path

from gsac.stages.body_choice import OPEN
from gsac.stages.contract import BadInput

DETECTOR, ENCODER, PARTS = "onnx-wholebody", "deca-encoder", "sapiens-seg"
"""Names under which stages keypoints, face and segment look for networks that users bring."""
TAKEN = (OPEN, "none", "auto")
"""Words that mean something else where a parameter names a model file."""


def check_model(name: str, file: Path) -> None:
    """Raises BadInput unless the file is what its name or its arrays say: a network of key points or body parts, a face encoder,
    a FLAME head, the points on one, its vertices in SMPL-X, poses of a person, or a body model."""
    from gsac.avatar.artifacts import ArtifactError
    from gsac.avatar.npz import NpzError

    if name in TAKEN:
        raise BadInput(f"{name} is not a name for a model file: parameters give the word another meaning; choose another")
    if name == DETECTOR:
        from gsac.stages.keypoints.simcc import SimccNetwork

        SimccNetwork(file)
        return
    if name == PARTS:
        from gsac.avatar.onnx_network import NetworkError
        from gsac.avatar.sapiens import Sapiens

        try:
            Sapiens({PARTS: file})
        except NetworkError as error:
            raise BadInput(str(error)) from error
        return
    if name == ENCODER:
        from gsac.stages.face.deca import DecaEncoder

        DecaEncoder(file)
        return
    try:
        _read(file)
    except (ArtifactError, NpzError, zipfile.BadZipFile) as error:
        said = str(error) if str(file) in str(error) else f"{file}: not a readable npz ({error})"
        raise BadInput(f"{said}; it was not added as {name}") from error


def _read(file: Path) -> None:
    from gsac.avatar.body_file import read_body_file
    from gsac.avatar.flame_file import ARRAYS, POINTS, read_flame, read_flame_ids, read_flame_points
    from gsac.avatar.pose_files.read import read_poses

    if file.suffix == ".npy":
        read_flame_ids(file)
        return
    arrays = _array_names(file)
    if arrays & POINTS.keys() and "v_template" not in arrays:
        read_flame_points(file)
    elif arrays and _joints(file) == ARRAYS["kintree_table"][1]:
        read_flame(file)
    elif _holds_poses(arrays):
        read_poses(file)
    else:
        read_body_file(file)


def _holds_poses(members: set[str]) -> bool:
    """Whether a zip of these members, arrays without `.npy`, is of a person's poses: one file a frame, or arrays of all frames."""
    return bool(members & {"body_pose", "pose"}) or any(name.endswith((".json", ".npz")) for name in members)


def _array_names(file: Path) -> set[str]:
    from gsac.avatar.npz import open_zip

    if not zipfile.is_zipfile(file):
        return set()
    with open_zip(file) as members:
        return {name.removesuffix(".npy") for name in members.namelist()}


def _joints(file: Path) -> int:
    """Joints of the model's tree, 0 where there is none to be read."""
    from gsac.avatar.npz import NpzError, read_npz

    try:
        return read_npz(file, ("kintree_table",))["kintree_table"].shape[-1]
    except (KeyError, IndexError, NpzError):
        return 0

"""Checks a model file that a user brings before it is kept: what it is is told by what it holds."""

from __future__ import annotations

import zipfile
from pathlib import Path

from gsac.stages.body_choice import OPEN
from gsac.stages.contract import BadInput

DETECTOR, ENCODER, PARTS = "onnx-wholebody", "deca-encoder", "sapiens-seg"
"""Names under which stages keypoints, face and segment look for networks that users bring."""
WEIGHTS = ("_data", ".data")
"""What follows a network's own name in that of a file with its weights."""
TAKEN = (OPEN, "none", "auto")
"""Words that mean something else where a parameter names a model file."""


def check_model(name: str, file: Path, *others: Path) -> None:
    """Raises BadInput unless the file is what its name or its arrays say: a network of key points or body parts, a face encoder,
    a FLAME head, the points on one, its vertices in SMPL-X, key points of mmpose, a detector's errors, poses of a person, or a body
    model. Several files are one network with its weights beside it, or key points, a file a frame."""
    from gsac.avatar.artifacts import ArtifactError
    from gsac.avatar.npz import NpzError

    if name in TAKEN:
        raise BadInput(f"{name} is not a name for a model file: parameters give the word another meaning; choose another")
    files = (file, *others)
    file = _whole(name, files)
    if name in (DETECTOR, PARTS):
        from gsac.avatar.onnx_network import NetworkError
        from gsac.avatar.sapiens import Sapiens
        from gsac.avatar.simcc import SimccNetwork

        try:
            _ = SimccNetwork(file) if name == DETECTOR else Sapiens({PARTS: file})
        except NetworkError as error:
            raise BadInput(str(error)) from error
        return
    if file.suffix == ".onnx" and name != ENCODER:
        from gsac.avatar.instant_hmr import InstantHmr
        from gsac.avatar.onnx_network import NetworkError

        try:
            InstantHmr(file, name)
        except NetworkError as error:
            raise BadInput(f"{error}; networks of other kinds are brought as {DETECTOR}, {PARTS} or {ENCODER}") from error
        return
    if name == ENCODER:
        from gsac.stages.face.deca import DecaEncoder

        DecaEncoder(file)
        return
    try:
        for one in files if file.suffix == ".json" else (file,):
            _read(one)
    except (ArtifactError, NpzError, zipfile.BadZipFile) as error:
        said = str(error) if str(file) in str(error) else f"{file}: not a readable npz ({error})"
        raise BadInput(f"{said}; it was not added as {name}") from error


def _whole(name: str, files: tuple[Path, *tuple[Path, ...]]) -> Path:
    """The file among several that is read, the others go with it. Raises BadInput."""
    if len(files) > 1 and all(file.suffix == ".json" for file in files):
        return files[0]
    networks = [file for file in files if file.suffix == ".onnx"]
    if len(files) > 1 and len(networks) != 1:
        raise BadInput(f"{name}: {len(files)} files were given, {len(networks)} of them .onnx; several are kept together "
                       "only as one .onnx with its weights beside it, or as .json that mmpose wrote")
    file = networks[0] if len(files) > 1 else files[0]
    beside = [other for end in WEIGHTS if (other := file.with_name(file.name + end)).is_file() and other not in files]
    if beside:
        raise BadInput(f"{file} has weights in a file beside it; give both: `gsac models add {name} {file} {beside[0]}`")
    return file


def _read(file: Path) -> None:
    from gsac.avatar.body_file import read_body_file
    from gsac.avatar.flame_file import ARRAYS, POINTS, read_flame, read_flame_ids, read_flame_points
    from gsac.avatar.mmpose_file import read_mmpose
    from gsac.avatar.pose_files.read import read_poses
    from gsac.stages.smplx.detector_errors import read_errors

    if file.suffix == ".json":
        read_mmpose(file)
        return
    if file.suffix == ".npy":
        read_flame_ids(file)
        return
    arrays = _array_names(file)
    if {"habit", "spread"} <= arrays:
        read_errors(file)
    elif arrays & POINTS.keys() and "v_template" not in arrays:
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

"""Every array of an artifact is declared, documented and checked: by the stage that writes it and by each that reads it."""

import importlib
import json
import shutil
from dataclasses import MISSING, fields, replace
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.artifacts import (
    AVATAR_SHAPES,
    BODY_SHAPES,
    FACE_SHAPES,
    FILLED_SHAPES,
    FLAME_SHAPES,
    HEAD_SHAPES,
    KEYPOINT_SHAPES,
    LEVEL_SHAPES,
    LIGHT_SHAPE,
    NOWHERE,
    REST_SHAPE,
    TEXT,
    WHOLE,
    ArtifactError,
    Clip,
    Crop,
    read_arrays,
    write_arrays,
)
from gsac.avatar.body import Body
from gsac.avatar.frame_files import read_alpha, write_alpha, write_frame
from gsac.avatar.frame_range import copy_frames
from gsac.pipeline.fixtures import fixture_paths
from gsac.pipeline.project import Project
from gsac.stages.contract import BadInput, Job
from support.artifacts import blank

PORTS = {
    "keypoints/keypoints.npz": KEYPOINT_SHAPES,
    "handgap/keypoints.npz": FILLED_SHAPES,
    "face/face.npz": {**FACE_SHAPES, **HEAD_SHAPES, **REST_SHAPE, **FLAME_SHAPES},
    "smplx/body.npz": {**BODY_SHAPES, **REST_SHAPE},
    "train/body.npz": {**BODY_SHAPES, **REST_SHAPE},
    "train/avatar.npz": {**AVATAR_SHAPES, **LIGHT_SHAPE, **LEVEL_SHAPES},
}
"""Port -> the arrays that its file may hold."""
ALONE = ("light", "rest_expression")
"""Arrays that may be there or not, whatever else is."""
PROJECT = Project.at_hand()
STAGES = {name: importlib.import_module(f"gsac.stages.{name}").STAGE
          for name in ("split", "keypoints", "handgap", "segment", "face", "smplx", "train", "export")}
WRITTEN = [(port, array) for port, shapes in PORTS.items() for array in shapes if array not in ALONE]
READ = [(name, port, array) for name, stage in STAGES.items() for port in stage.inputs if port in PORTS
        for array in PORTS[port] if array not in ALONE]
PAGE = Path(__file__).resolve().parents[2] / "docs" / "artifacts.md"


def write_whole(folder: Path, without: str = "", port: str = "") -> dict[str, Path]:
    """The inputs of every stage, with all arrays but one; three frames in which nothing is seen."""
    inputs = {name: folder / name for stage in STAGES.values() for name in stage.inputs if name != "clip"}
    for path in inputs.values():
        path.parent.mkdir(parents=True, exist_ok=True)
    for name in ("split/frames", "segment/alpha"):
        inputs[name].mkdir()
        for t in range(3):
            write_frame(inputs[name] / f"{t:06d}.png", np.zeros((64, 64, 3), np.uint8))
    Clip(30.0, [0.0, 0.1, 0.2], 64, 64, None, "0" * 64).write(inputs["split/clip.json"])
    for name, shapes in PORTS.items():
        arrays = blank(shapes, L=1 if name == "train/avatar.npz" else 468, M=4)
        if "levels" in arrays:
            arrays["levels"][:] = 4
        if "model" in arrays:
            arrays["model"] = np.array(Body.load().digest)
        write_arrays(inputs[name], **{key: value for key, value in arrays.items() if (name, key) != (port, without)})
    return inputs


@pytest.mark.parametrize(("name", "port", "array"), READ)
def test_a_stage_names_the_file_and_the_array_that_it_lacks(tmp_path, name, port, array):
    inputs = write_whole(tmp_path, array, port)
    run = importlib.import_module(f"gsac.stages.{name}.stage").run
    with pytest.raises(ArtifactError, match=rf"{Path(port).name}: array {array} is missing"):
        run(Job({key: inputs[key] for key in STAGES[name].inputs}, tmp_path / "out", STAGES[name].config()))


@pytest.mark.parametrize(("port", "array"), WRITTEN)
def test_the_stage_that_writes_a_file_is_held_to_every_array(tmp_path, port, array):
    inputs = write_whole(tmp_path, array, port)
    name, _, path = port.partition("/")
    check = next(output.check for output in STAGES[name].outputs if output.path == path)
    with pytest.raises(ArtifactError, match=rf"{path}: array {array} is missing"):
        check(inputs[port])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    write_whole(folder)
    return folder


WRONG = {
    "has shape": lambda array: np.stack([array, array]),
    "is of type": lambda array: np.zeros(array.shape, np.int32 if array.dtype.kind == "U" else "U4"),
    "is not finite": lambda array: np.full(array.shape, np.nan, np.float32),
}
"""What a replay says of an array -> how it comes about."""


@pytest.mark.parametrize("words", WRONG)
@pytest.mark.parametrize("port", PORTS)
def test_a_replay_names_the_array_that_was_edited(whole, port, words):
    arrays, reader = read_arrays(whole / port), next(name for name, stage in STAGES.items() if port in stage.inputs)
    edited = arrays.keys() - (NOWHERE + TEXT + WHOLE if words == "is not finite" else ())
    for array in sorted(edited):
        write_arrays(whole / port, **arrays | {array: WRONG[words](arrays[array])})
        with pytest.raises(BadInput, match=rf"{port} is not what {port} promises: .*array {array} {words}"):
            fixture_paths(PROJECT, reader, whole)
    write_arrays(whole / port, **arrays)


@pytest.mark.parametrize("port", [port for port in PORTS if port != "train/avatar.npz"])
def test_a_replay_names_the_artifact_that_speaks_of_another_number_of_frames(tmp_path, whole, port):
    folder = shutil.copytree(whole, tmp_path / "fixtures")
    copy_frames(whole / port, folder / port, 2)
    reader = max((name for name, stage in STAGES.items() if port in stage.inputs), key=lambda name: len(STAGES[name].inputs))
    with pytest.raises(BadInput, match=rf"{port} speaks of 2 frames, but .*split/clip.json.* of 3; take all from one run"):
        fixture_paths(PROJECT, reader, folder)


@pytest.mark.parametrize("port", ["split/frames", "segment/alpha", "split/clip.json"])
def test_a_replay_names_the_picture_of_another_size(tmp_path, whole, port):
    folder = shutil.copytree(whole, tmp_path / "fixtures")
    if port == "split/clip.json":
        replace(Clip.read(folder / port), width=60).write(folder / port)
    else:
        write_frame(folder / port / "000001.png", np.zeros((64, 60, 3), np.uint8))
    with pytest.raises(BadInput, match=rf"{port}.* is of 60x64 px, others of 64x64; take all from one run"):
        fixture_paths(PROJECT, "train", folder)


@pytest.mark.parametrize(("field", "value"), [("fps", "fast"), ("timestamps_s", [0, None, 1]), ("width", 64.5), ("height", "64"),
                                              ("focal_px", float("nan")), ("source_sha256", 5), ("repeated", ["a"])])
def test_clip_json_names_the_field_that_is_of_another_kind(tmp_path, field, value):
    path = tmp_path / "clip.json"
    Clip(30.0, [0.0, 0.1, 0.2], 64, 64, None, "0" * 64).write(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | {field: value}))
    with pytest.raises(ArtifactError, match=rf"clip.json: field {field} is .*, expected "):
        Clip.read(path)


@pytest.mark.parametrize("content", [np.full((4, 5), np.nan), np.full((4, 5), 2.0), None], ids=["nan", "2", "damaged"])
def test_a_mask_that_is_none_is_named(tmp_path, content):
    path = tmp_path / "000000.exr"
    path.write_bytes(b"no picture") if content is None else write_alpha(path, content)
    with pytest.raises(ArtifactError, match="000000.exr: (expected one channel, every pixel in 0..1|cannot be read as a mask)"):
        read_alpha(path)


@pytest.mark.parametrize(("port", "few"), [("face/face.npz", FACE_SHAPES), ("train/avatar.npz", AVATAR_SHAPES)])
def test_what_only_some_clips_have_may_be_absent_altogether(tmp_path, port, few):
    name, _, path = port.partition("/")
    write_arrays(tmp_path / path, **blank(few))
    next(output.check for output in STAGES[name].outputs if output.path == path)(tmp_path / path)


@pytest.mark.parametrize("field", [field.name for field in fields(Clip)
                                   if field.default_factory is MISSING and field.default is MISSING])
def test_clip_json_names_the_field_that_it_lacks(tmp_path, field):
    path = write_whole(tmp_path)["split/clip.json"]
    path.write_text(path.read_text().replace(f'"{field}"', '"other"'))
    with pytest.raises(ArtifactError, match=rf"clip.json: field {field} is missing"):
        Clip.read(path)


@pytest.mark.parametrize("port", PORTS)
def test_every_array_stands_in_the_contract(port):
    sections = {heading: text for part in PAGE.read_text().split("\n## ")[1:] for heading, _, text in [part.partition("\n")]}
    text = "".join(body for heading, body in sections.items() if port.split("/")[0] in heading.split(", "))
    assert [array for array in PORTS[port] if f"`{array}`" not in text] == []


def test_clip_json_has_crop_and_principal_point_only_where_the_footage_was_cut_and_gives_them_back(tmp_path):
    whole = Clip.read(write_whole(tmp_path)["split/clip.json"])
    assert whole.principal_point == (32, 32) and whole.longer_side == 64
    assert not {"crop", "center"} & json.loads((tmp_path / "split/clip.json").read_text()).keys()
    cut = replace(whole, crop=Crop(10, 20, 128, 128, 0.5), center=(40.5, 70.25))
    cut.write(tmp_path / "clip.json")
    assert Clip.read(tmp_path / "clip.json") == cut and cut.principal_point == (40.5, 70.25) and cut.longer_side == 160.5
    (tmp_path / "clip.json").write_text((tmp_path / "clip.json").read_text().replace('"scale"', '"skale"'))
    with pytest.raises(ArtifactError, match="clip.json: crop and center must be"):
        Clip.read(tmp_path / "clip.json")

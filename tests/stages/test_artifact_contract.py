"""Every array of an artifact is declared, documented and checked: by the stage that writes it and by each that reads it."""

import importlib
import json
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
    REST_SHAPE,
    ArtifactError,
    Clip,
    Crop,
    write_arrays,
)
from gsac.avatar.body import Body
from gsac.stages.contract import Job
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
            (inputs[name] / f"{t:06d}.png").touch()
    Clip(30.0, [0.0, 0.1, 0.2], 64, 64, None, "0" * 64).write(inputs["split/clip.json"])
    for name, shapes in PORTS.items():
        arrays = blank(shapes, L=1 if name == "train/avatar.npz" else 468, M=4)
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

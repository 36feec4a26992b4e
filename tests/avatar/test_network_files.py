import re

import pytest

from gsac.avatar.network_files import MODELS, ModelMissingError, model_path


def test_each_model_names_its_wheel_member_digest_and_licence():
    assert len({model.sha256 for model in MODELS.values()}) == len(MODELS)
    for model in MODELS.values():
        assert re.fullmatch(r"[0-9a-f]{64}", model.sha256)
        assert model.wheel_member.endswith(".tflite") and model.licence == "Apache-2.0" and model.what


def test_a_missing_model_file_says_what_to_run(tmp_path):
    with pytest.raises(ModelMissingError, match="pose_detection is missing.*gsac models pull"):
        model_path("pose_detection", tmp_path)


def test_an_unknown_model_lists_the_known_ones(tmp_path):
    with pytest.raises(KeyError, match="nose_detection; known: .*pose_detection"):
        model_path("nose_detection", tmp_path)


def test_a_file_in_the_store_is_found(tmp_path):
    path = tmp_path / "models" / MODELS["iris_landmark"].sha256 / "iris_landmark"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"x")
    assert model_path("iris_landmark", tmp_path) == path

"""Where a stage computes: one place decides, the key and the job are told the same."""

import pytest

from gsac.cache.store import Store
from gsac.pipeline import keys
from gsac.pipeline.keys import Keys, device_class
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.stages.contract import BadInput


@pytest.fixture
def parts(tmp_path, monkeypatch):
    """parts(gpu=, device=): KeyParts of `train` on a machine with or without a GPU."""
    project, store = Project.at_hand(), Store(tmp_path)
    monkeypatch.delenv("GSAC_DEVICE", raising=False)

    def make(gpu, device="auto", name="train"):
        monkeypatch.setattr(keys, "why_not", lambda: None if gpu else "there is no GPU")
        return Keys(project, resolve(project, None, [f"train.device={device}"]), store).parts(name, {})
    return make


def test_auto_is_the_gpu_where_there_is_one_and_the_two_results_have_keys_of_their_own(parts):
    assert (parts(gpu=True).device, parts(gpu=False).device) == ("cuda", "cpu")
    assert parts(gpu=True).key != parts(gpu=False).key
    assert parts(gpu=True, name="split").key == parts(gpu=False, name="split").key


def test_a_device_asked_for_and_the_same_device_found_share_one_result(parts):
    assert parts(gpu=True, device="cuda").key == parts(gpu=True).key
    assert parts(gpu=True, device="cpu").key == parts(gpu=False).key


@pytest.mark.parametrize("setting", [
    "keypoints.detector=onnx-wholebody", "segment.method=sapiens", "face.method=deca", "smplx.start=mine"])
def test_a_network_that_a_user_brings_makes_the_device_part_of_its_stages_key_alone(tmp_path, monkeypatch, setting):
    project, name = Project.at_hand(), setting.partition(".")[0]
    monkeypatch.delenv("GSAC_DEVICE", raising=False)
    told = []
    for gpu in (True, False):
        monkeypatch.setattr(keys, "why_not", lambda gpu=gpu: None if gpu else "there is no GPU")
        asked = [setting, "face.flame=mine"]
        told += [Keys(project, resolve(project, None, words), Store(tmp_path)).device_of(name) for words in (asked, [])]
    assert told == ["cuda", "", "cpu", ""]


def test_cuda_without_a_gpu_is_refused_with_what_is_missing(parts, monkeypatch):
    with pytest.raises(BadInput, match="train.device is cuda, but there is no GPU.*train.device to auto"):
        parts(gpu=False, device="cuda")
    monkeypatch.setenv("GSAC_DEVICE", "cpu")
    with pytest.raises(BadInput, match="GSAC_DEVICE is cpu"):
        parts(gpu=True, device="cuda")


def test_the_environment_overrules_what_is_found(monkeypatch):
    monkeypatch.setattr(keys, "why_not", lambda: None)
    monkeypatch.setenv("GSAC_DEVICE", "cpu")
    assert device_class() == "cpu"

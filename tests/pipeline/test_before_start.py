"""What can be known before anything runs is checked before anything runs."""

import os
import time

import pytest

from gsac.cache.store import Store
from gsac.pipeline import keys
from gsac.pipeline.cli import execute
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.stages.contract import BadInput


@pytest.fixture
def clip(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GSAC_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("GSAC_DEVICE", "cpu")
    (tmp_path / "clip.mp4").write_bytes(b"never looked at")
    return tmp_path / "clip.mp4"


@pytest.mark.parametrize("command", ["run", "batch"])
@pytest.mark.parametrize(("sets", "words"), [
    (["smplx.body_model=nobody"], "smplx.body_model is nobody: unknown model file nobody; bring it with `gsac models add nobody"),
    (["train.device=cuda"], "train.device is cuda, but GSAC_DEVICE is cpu"),
    (["keypoints.detector=onnx-wholebody"], "keypoints.detector is onnx-wholebody: unknown model file onnx-wholebody"),
    (["face.flame=head"], "face.flame is head: unknown model file head"),
    (["train.lpips=loss", "train.recipe=paper"], "train.lpips is loss: unknown model file lpips-vgg"),
    (["train.lpips=loss"], "train.lpips is loss, but on the CPU recipe paper alone"),
    (["train.lpips=vgg-hed", "train.recipe=paper"], "vgg-hed is not here; `gsac models pull vgg-hed`"),
    (["train.lpips=vgg-hed"], "train.lpips is vgg-hed, but on the CPU recipe paper alone"),
    (["train.lpips=judge"], "train.lpips is judge: none of lpips-vgg and lpips-alex is here"),
])
def test_a_wish_that_cannot_be_met_is_refused_at_once_and_leaves_no_folder(clip, capsys, command, sets, words):
    began = time.monotonic()
    source = clip if command == "run" else clip.parent
    assert execute([command, str(source), *(word for text in sets for word in ("--set", text))]) == ExitCode.USAGE
    assert time.monotonic() - began < 1
    assert words in capsys.readouterr().err
    assert {path.name for path in clip.parent.iterdir()} == {"clip.mp4", "cache"}


@pytest.fixture
def offline(monkeypatch):
    """A package index that nobody answers for."""
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    for name in ("PIP_FIND_LINKS", "PIP_EXTRA_INDEX_URL", "PIP_RETRIES"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")


@pytest.mark.parametrize("command", ["run", "batch", "demo"])
def test_networks_that_are_not_here_and_cannot_be_pulled_are_known_at_once_and_leave_no_folder(clip, offline, capsys, command):
    began, worked = time.monotonic(), sum(os.times()[:4])
    words = {"run": [str(clip)], "batch": [str(clip.parent)], "demo": []}[command]
    assert execute([command, *words]) == ExitCode.USAGE
    assert sum(os.times()[:4]) - worked < 2, "CPU s, pip's too, and modules that are compiled at their first import"
    assert time.monotonic() - began < 6, "pip's own way of asking again takes 8 s"
    assert "cannot get mediapipe" in capsys.readouterr().err
    assert {path.name for path in clip.parent.iterdir()} == {"clip.mp4", "cache"}


def test_networks_are_not_asked_for_where_no_stage_that_runs_needs_them(clip, offline, capsys):
    assert execute(["run", str(clip), "--until", "split"]) == ExitCode.USAGE
    assert "clip.mp4" in capsys.readouterr().err, "split's own word on a file that is no video"


@pytest.mark.parametrize("words", [["--set", "smplx.body_model=nobody"], [], ["--until", "split"]])
def test_before_a_read_only_cache_a_mistake_leaves_no_folder_either(clip, offline, monkeypatch, capsys, words):
    Store(clip.parent / "cache")
    monkeypatch.setattr(Store, "writable", property(lambda store: store.below is not None))
    assert execute(["run", str(clip), *words]) == ExitCode.USAGE
    assert {path.name for path in clip.parent.iterdir()} == {"clip.mp4", "cache"}


def test_a_stage_that_does_not_run_may_ask_for_anything(clip, capsys):
    assert execute(["run", str(clip), "--until", "split", "--dry-run", "--set", "train.device=cuda"]) == ExitCode.OK


def test_stages_with_different_bodies_are_refused_and_two_names_of_one_file_are_not(tmp_path):
    store, project = Store(tmp_path), Project.at_hand()
    models = Keys(project, {}, store).models
    (tmp_path / "a.npz").write_bytes(b"a")
    for name in ("mine", "same"):
        models.add(name, tmp_path / "a.npz")

    def check(*bodies):
        sets = [f"{stage}.{keys.BODY}={body}" for stage, body in zip(("smplx", "train", "export"), bodies, strict=True)]
        Keys(project, resolve(project, None, sets), store).check(project.graph.steps)

    check("mine", "same", "mine")
    with pytest.raises(BadInput, match="smplx.body_model is mine, train.body_model is open, export.body_model is .*--body"):
        check("mine", "open", "open")


def test_a_brought_file_that_has_gone_from_the_store_is_named_before_the_start(tmp_path):
    store, project = Store(tmp_path), Project.at_hand()
    run = Keys(project, resolve(project, None, ["keypoints.detector=onnx-wholebody"]), store)
    (tmp_path / "net.onnx").write_bytes(b"net")
    run.models.add("onnx-wholebody", tmp_path / "net.onnx").unlink()
    with pytest.raises(BadInput, match="keypoints.detector is onnx-wholebody: the file that you brought as onnx-wholebody is gone"):
        run.check(["keypoints"])

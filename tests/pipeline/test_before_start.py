"""What can be known before anything runs is checked before anything runs."""

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
    (["train.lpips=judge"], "train.lpips is judge: none of lpips-vgg and lpips-alex is here"),
])
def test_a_wish_that_cannot_be_met_is_refused_at_once_and_leaves_no_folder(clip, capsys, command, sets, words):
    began = time.monotonic()
    source = clip if command == "run" else clip.parent
    assert execute([command, str(source), *(word for text in sets for word in ("--set", text))]) == ExitCode.USAGE
    assert time.monotonic() - began < 1
    assert words in capsys.readouterr().err
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

"""Networks that users bring: what keeps one from running is told with its name, whichever kind it is."""

import zipfile

import numpy as np
import pytest
from onnx import helper

from gsac.avatar import cuda
from gsac.avatar.brought_network import open_brought
from gsac.avatar.onnx_network import PREFERRED, NetworkError, open_network
from gsac.avatar.simcc import SimccNetwork
from gsac.pipeline import keys
from gsac.stages.contract import BadInput
from gsac.stages.face.deca import CODES, DecaEncoder
from support.onnx_files import POINTS, write_encoder, write_network

WHOLE = np.array([[1.0, 0, 0], [0, 1, 0]])
FACE = np.random.default_rng(0).uniform(50, 150, (468, 3))


def write_script(path, give):
    torch = pytest.importorskip("torch")
    torch.jit.script(give).save(str(path))
    return path


def write_means(path, batch=1, **shapes):
    """A network whose outputs, by name, are of these shapes and hold the input's mean."""
    nodes = [helper.make_node("ReduceMean", ["image"], ["mean"], keepdims=0)]
    nodes += [helper.make_node("Expand", ["mean", f"shape_{name}"], [name]) for name in shapes]
    constants = {f"shape_{name}": np.array(shape) for name, shape in shapes.items()}
    return write_network(path, (batch, 3, 384, 288), shapes, nodes, constants)


def test_an_onnx_network_that_fails_on_the_input_is_named(tmp_path):
    eight = write_means(tmp_path / "eight.onnx", batch=8, out=(1, 4))
    with pytest.raises(NetworkError, match=r"model file mine cannot be run on an input of shape \[1, 3, 384, 288\].*Expected: 8"):
        open_brought(eight, "mine").run(np.zeros((1, 3, 384, 288), np.float32))


def test_a_torchscript_network_that_fails_on_the_input_is_named(tmp_path):
    torch = pytest.importorskip("torch")

    class Narrow(torch.nn.Module):
        def forward(self, image: torch.Tensor) -> torch.Tensor:
            return image.reshape(7)

    path = write_script(tmp_path / "narrow.pt", Narrow())
    with pytest.raises(NetworkError, match=r"model file mine cannot be run on an input of shape \[1, 3, 8, 8\].*invalid for input"):
        open_brought(path, "mine").run(np.zeros((1, 3, 8, 8), np.float32))


def test_numbers_that_are_none_are_told_before_they_are_used(tmp_path):
    path = write_encoder(tmp_path / "nan.onnx", np.zeros((12, CODES)), np.full(CODES, np.nan))
    with pytest.raises(BadInput, match=r"model file deca-encoder gives numbers that are none \(NaN\); export it again"):
        DecaEncoder(path).read(np.zeros((200, 200, 3), np.uint8), FACE)


@pytest.mark.parametrize("shapes", [{"simcc_y": (1, POINTS, 768), "simcc_x": (1, POINTS, 576)}, {"a": (POINTS, 576), "b": (1, 768)},
                                    {"simcc_x": (1, 17, 576), "simcc_y": (1, 17, 768)}])
def test_outputs_that_are_no_simcc_of_the_input_are_named_with_their_shapes(tmp_path, shapes):
    network = SimccNetwork(write_means(tmp_path / "other.onnx", **shapes))
    with pytest.raises(NetworkError, match=r"onnx-wholebody gives arrays of shapes .*expected simcc_x \(1, 133, 576\)"):
        network.read(np.zeros((500, 400, 3), np.uint8), WHOLE)


@pytest.mark.parametrize(("told", "gpu", "on_gpu"), [
    ("cpu", True, False), ("cuda", False, True), (None, True, True), (None, False, False)])
def test_brought_networks_run_on_the_device_that_the_key_names(monkeypatch, tmp_path, told, gpu, on_gpu):
    onnxruntime, torch = pytest.importorskip("onnxruntime"), pytest.importorskip("torch")
    with zipfile.ZipFile(tmp_path / "net.pt2", "w") as file:
        file.writestr("x", "")
    opened: list = []
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: list(PREFERRED))
    monkeypatch.setattr(onnxruntime, "InferenceSession", lambda path, options, providers: opened.append(providers))
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.jit, "load", lambda path, map_location: opened.append(map_location) or torch.nn.Identity())
    for module in (cuda, keys):
        monkeypatch.setattr(module, "why_not", lambda: None if gpu else "there is no GPU")
    monkeypatch.setenv("GSAC_DEVICE", told) if told else monkeypatch.delenv("GSAC_DEVICE", raising=False)
    open_network(tmp_path / "net.onnx", "mine")
    open_brought(tmp_path / "net.pt2", "mine")
    open_network(tmp_path / "net.onnx", "ours", threads=1)
    assert opened == ([list(PREFERRED), "cuda"] if on_gpu else [[PREFERRED[-1]], "cpu"]) + [[PREFERRED[-1]]]
    assert keys.device_class() == ("cuda" if on_gpu else "cpu")

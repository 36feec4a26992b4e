"""Networks that users bring: where they run."""

import zipfile

import pytest

from gsac.avatar.brought_network import open_brought
from gsac.avatar.onnx_network import PREFERRED, open_network


def test_brought_networks_keep_off_a_gpu_that_the_user_forbids(monkeypatch, tmp_path):
    onnxruntime, torch = pytest.importorskip("onnxruntime"), pytest.importorskip("torch")
    with zipfile.ZipFile(tmp_path / "net.pt2", "w") as file:
        file.writestr("x", "")
    opened: list = []
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: list(PREFERRED))
    monkeypatch.setattr(onnxruntime, "InferenceSession", lambda path, options, providers: opened.append(providers))
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.jit, "load", lambda path, map_location: opened.append(map_location) or torch.nn.Identity())
    for device in ("cpu", "cuda", None):
        monkeypatch.setenv("GSAC_DEVICE", device) if device else monkeypatch.delenv("GSAC_DEVICE", raising=False)
        open_network(tmp_path / "net.onnx", "mine")
        open_brought(tmp_path / "net.pt2", "mine")
    on_gpu = [list(PREFERRED), "cuda"]
    assert [list(each) if not isinstance(each, str) else each for each in opened] == [[PREFERRED[-1]], "cpu", *on_gpu, *on_gpu]

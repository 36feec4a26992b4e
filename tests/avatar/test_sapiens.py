"""Sapiens' slot, on a made-up network of the official shapes: colours, normalisation, labels, alphas and edges."""

import numpy as np
import pytest
import torch

from gsac.avatar.onnx_network import NetworkError
from gsac.avatar.sapiens import PARTS, Sapiens, decide
from support.body_parts import HEIGHT, WIDTH, alpha_of, paint, write_onnx, write_torchscript


@pytest.fixture(scope="module", params=[write_onnx, write_torchscript])
def network(request, tmp_path_factory):
    return Sapiens({"sapiens-seg": request.param(tmp_path_factory.mktemp("network"))})


@pytest.mark.parametrize(("colour", "part"), [
    ((160, 20, 20), "lower_clothing"), ((20, 135, 20), "upper_clothing"), ((20, 20, 130), "hair"),
    ((150, 133, 100), "upper_clothing"), ((140, 20, 20), "background"), ((20, 20, 20), "background"), ((255, 255, 255), "hair"),
])
def test_alpha_and_label_follow_from_a_colours_logits(network, colour, part):
    alpha, labels = network.read(paint(((0, 0, WIDTH, HEIGHT), colour)))
    assert np.abs(alpha - alpha_of(colour)).max() < 1e-4
    assert alpha.shape == labels.shape == (HEIGHT, WIDTH) and labels.dtype == np.uint8
    assert (labels == PARTS.index(part)).all()


@pytest.mark.parametrize("size", [(HEIGHT, WIDTH), (300, 533), (1300, 720)])
def test_edges_lie_where_the_frame_has_them_whatever_its_aspect(network, size):
    height, width = size
    x0, y0, x1, y1 = round(0.21 * width), round(0.15 * height), round(0.83 * width), round(0.9 * height)
    # As far above the middle as the rest lies below it: the alpha passes a half at the edge itself.
    image = paint(((x0, y0, x1, y1), (160, 20, 20)), height=height, width=width)
    image[image[..., 0] == 20] = 140, 20, 20
    alpha, labels = network.read(image)
    low, high = alpha_of((140, 20, 20)), alpha_of((160, 20, 20))
    for line, edges in ((alpha[height // 2], (x0, x1)), (alpha[:, width // 2], (y0, y1))):
        inside = np.flatnonzero(line > (low + high) / 2)
        for near, step, edge in ((inside[0], -1, edges[0]), (inside[-1], 1, edges[1])):
            share = (line[near] - (low + high) / 2) / (line[near] - line[near + step])
            assert abs(near + 0.5 + step * share - edge) < 0.5
    assert ((labels == PARTS.index("lower_clothing")) == (alpha > 0.5)).mean() > 0.999


def test_high_logits_are_certain_and_no_number_overflows():
    logits = np.zeros((28, 2, 2), np.float32)
    logits[5], logits[0, 0] = 3000, 6000
    alpha, labels = decide(logits, 2, 2)
    assert alpha.tolist() == [[0, 0], [1, 1]] and labels.tolist() == [[0, 0], [5, 5]]


def test_what_is_no_such_network_is_refused_by_name(tmp_path):
    weights_only = tmp_path / "weights.pth"
    torch.save({"weight": torch.zeros(2)}, weights_only)
    (tmp_path / "junk").write_bytes(b"junk")
    few = write_onnx(tmp_path, classes=20, kind="few")
    for file, words in ((few, r"output \[1, 20, 256, 192\]; expected Sapiens' segmentation"),
                        (write_onnx(tmp_path, side=(512, 512), kind="square"), r"has input \[1, 3, 512, 512\]"),
                        (weights_only, "is neither ONNX nor TorchScript"), (tmp_path / "junk", "cannot be read as ONNX")):
        with pytest.raises(NetworkError, match=f"model file sapiens-seg.*{words}"):
            Sapiens({"sapiens-seg": file})

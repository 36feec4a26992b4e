"""Sapiens' slot, on a made-up network of the official shapes whose classes and alphas follow from a pixel's colour."""

import cv2
import numpy as np
import pytest
from onnx import helper

from gsac.avatar.artifacts import KEYPOINT_SHAPES, Clip, frame_paths, read_alpha, write_arrays, write_frame
from gsac.avatar.onnx_network import NetworkError
from gsac.avatar.sapiens import PARTS, Sapiens, decide
from gsac.stages.contract import Job
from gsac.stages.segment import stage
from gsac.stages.segment.config import SegmentConfig
from support.artifacts import blank
from support.onnx_files import write_network

MEAN, DEVIATION = (123.5, 116.5, 103.5), (58.5, 57.0, 57.5)
"""Of red, green and blue, as published."""
TELLS = {"lower_clothing": (0, 150), "upper_clothing": (1, 130), "hair": (2, 110)}
"""A class and what it is told by: a channel, and its value at which the class is as likely as the background."""
STEEP = 0.125
"""Logits per step of a channel."""
CELL = 4
"""px of the input for one logit."""
HEIGHT, WIDTH = 500, 420


def weights():
    """Of the convolution (28, 3, 1, 1) that takes normalised colours, and its offsets (28,)."""
    weight, offset = np.zeros((28, 3, 1, 1), np.float32), np.full(28, -60, np.float32)
    offset[0] = 0
    for name, (channel, middle) in TELLS.items():
        weight[PARTS.index(name), channel] = STEEP * DEVIATION[channel]
        offset[PARTS.index(name)] = STEEP * (MEAN[channel] - middle)
    return weight, offset


def onnx(folder, classes=28, side=(1024, 768), kind="network"):
    weight, offset = weights()
    cells = helper.make_node("AveragePool", ["image"], ["cells"], kernel_shape=[CELL, CELL], strides=[CELL, CELL])
    return write_network(folder / f"{kind}.onnx", (1, 3, *side), {"logits": (1, classes, side[0] // CELL, side[1] // CELL)},
                         [cells, helper.make_node("Conv", ["cells", "weight", "offset"], ["logits"])],
                         {"weight": weight[:classes], "offset": offset[:classes]})


def torchscript(folder):
    import torch

    pool, conv = torch.nn.AvgPool2d(CELL), torch.nn.Conv2d(3, 28, 1)
    with torch.no_grad():
        for mine, given in zip((conv.weight, conv.bias), weights(), strict=True):
            mine.copy_(torch.from_numpy(given))
    torch.jit.trace(torch.nn.Sequential(pool, conv), torch.zeros(1, 3, 1024, 768)).save(str(folder / "network.pt2"))
    return folder / "network.pt2"


@pytest.fixture(scope="module", params=[onnx, torchscript])
def network(request, tmp_path_factory):
    return Sapiens({"sapiens-seg": request.param(tmp_path_factory.mktemp("network"))})


@pytest.fixture(scope="module")
def other_network(tmp_path_factory):
    return {"sapiens-seg": onnx(tmp_path_factory.mktemp("network"))}


def alpha_of(colour):
    odds = sum(np.exp(STEEP * (colour[channel] - middle)) for channel, middle in TELLS.values())
    return odds / (1 + odds)


def paint(*patches, height=HEIGHT, width=WIDTH):
    """(height, width, 3) uint8: patches of x0, y0, x1, y1 and colour on a grey that shows nothing."""
    image = np.full((height, width, 3), 20, np.uint8)
    for (x0, y0, x1, y1), colour in patches:
        image[y0:y1, x0:x1] = colour
    return image


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


def run(folder, images, points, network, **config):
    """Alphas, labels and warnings of the stage. points: (n, 2) px of the person in every frame."""
    (folder / "frames").mkdir()
    for t, image in enumerate(images):
        write_frame(folder / f"frames/{t:06d}.png", image)
    count, (height, width) = len(images), images[0].shape[:2]
    xy, score = np.zeros((count, 133, 2), np.float32), np.zeros((count, 133), np.float32)
    xy[:, :len(points)], score[:, :len(points)] = points, 0.9
    write_arrays(folder / "keypoints.npz", **blank(KEYPOINT_SHAPES, T=count) | {"xy": xy, "score": score})
    Clip(10.0, [t / 10 for t in range(count)], width, height, None, "0").write(folder / "clip.json")
    warnings = []
    stage.run(Job({"split/frames": folder / "frames", "split/clip.json": folder / "clip.json",
                   "keypoints/keypoints.npz": folder / "keypoints.npz"}, folder, SegmentConfig(method="sapiens", **config), network,
                  warn=lambda finding: warnings.append(finding.message)))
    return ([read_alpha(path) for path in frame_paths(folder / "alpha")],
            [cv2.imread(str(path), cv2.IMREAD_UNCHANGED) for path in frame_paths(folder / "alpha/labels")], warnings)


def test_the_networks_own_alpha_and_labels_come_out_of_the_stage(other_network, tmp_path):
    body, faint = (160, 20, 20), (155, 20, 20)
    image = paint(((60, 50, 200, 400), body), ((90, 100, 160, 200), faint))
    (alpha, *_), (labels, *_), warnings = run(tmp_path, [image] * 2, [(80, 80), (180, 80), (120, 300), (130, 350)], other_network)
    assert not warnings and labels.dtype == np.uint8
    assert np.abs(alpha[250:390, 70:190] - alpha_of(body)).max() < 5e-4  # the file holds half floats
    assert np.abs(alpha[110:190, 100:150] - alpha_of(faint)).max() < 5e-4
    assert not alpha[:, 230:].any() and not labels[:, 230:].any()
    assert (labels[60:390, 70:190] == PARTS.index("lower_clothing")).all()


def test_a_frame_without_a_person_has_empty_labels_too(other_network, tmp_path):
    image = paint(((60, 50, 200, 400), (160, 20, 20)))
    alphas, labels, warnings = run(tmp_path, [image, paint()], [(80, 80), (180, 80), (120, 300), (130, 350)], other_network)
    assert alphas[0].any() and labels[0].any() and not alphas[1].any() and not labels[1].any()
    assert warnings == ["No person is in frame 1; the mask there is empty."]


def test_of_two_persons_the_one_with_the_points_is_kept_to_the_edge(other_network, tmp_path):
    image = paint(((40, 50, 140, 450), (160, 20, 20)), ((200, 50, 300, 450), (20, 20, 130)))
    alphas, labels, _ = run(tmp_path, [image], [(80, 80), (100, 80), (90, 300), (90, 400)], other_network)
    assert not alphas[0][:, 175:].any() and not labels[0][:, 175:].any()
    assert (alphas[0][60:440, 45:135] > 0.7).all() and (labels[0] != PARTS.index("hair")).all()


def test_the_empty_scene_opens_what_the_network_fills_and_leaves_its_alpha_elsewhere(other_network, tmp_path):
    rng = np.random.default_rng(0)
    wall = np.clip(60 + cv2.GaussianBlur(rng.normal(0, 60, (300, 400)).astype(np.float32), (0, 0), 3), 20, 100)
    frames = []
    for t in range(12):
        frame = np.dstack([wall * 0.4, wall, wall]) + rng.normal(0, 1, (300, 400, 3))
        x = 30 + 20 * t
        frame[60:260, x:x + 60] = 170, 40, 40
        frame[110:170, x + 24:x + 30] = np.dstack([wall * 0.4, wall, wall])[110:170, x + 24:x + 30]
        frames.append(np.uint8(np.clip(frame, 0, 255)))

    class Filled(Sapiens):
        def __init__(self):
            """Of no file."""

        def read(self, image):
            seen = cv2.morphologyEx((image[..., 0] > 120).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((15, 15), np.uint8))
            return 0.9 * seen.astype(np.float32), seen

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(stage.METHODS, "sapiens", lambda models: Filled())
        points = [(200, 70), (200, 250), (210, 200), (190, 100)]
        for use_plate in (True, False):
            (tmp_path / str(use_plate)).mkdir()
            alphas, _, _ = run(tmp_path / str(use_plate), frames, points, {}, use_plate=use_plate)
            for t, alpha in enumerate(alphas):
                x = 30 + 20 * t
                gap = alpha[115:165, x + 25:x + 29].mean()
                assert gap < 0.15 if use_plate else gap > 0.85
                assert np.abs(alpha[180:250, x + 8:x + 52] - 0.9).max() < 1e-3


def test_what_is_no_such_network_is_refused_by_name(tmp_path):
    weights_only = tmp_path / "weights.pth"
    import torch

    torch.save({"weight": torch.zeros(2)}, weights_only)
    (tmp_path / "junk").write_bytes(b"junk")
    for file, words in ((onnx(tmp_path, classes=20, kind="few"), r"output \[1, 20, 256, 192\]; expected Sapiens' segmentation"),
                        (onnx(tmp_path, side=(512, 512), kind="square"), r"has input \[1, 3, 512, 512\]"),
                        (weights_only, "is neither ONNX nor TorchScript"), (tmp_path / "junk", "cannot be read as ONNX")):
        with pytest.raises(NetworkError, match=f"model file sapiens-seg.*{words}"):
            Sapiens({"sapiens-seg": file})


def test_the_config_asks_for_the_file_that_the_user_brings():
    assert SegmentConfig(method="sapiens").models() == ("sapiens-seg",)
    assert "sapiens-seg" not in SegmentConfig().models()

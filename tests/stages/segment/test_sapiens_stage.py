"""segment.method=sapiens, on a made-up network of the official shapes: alpha, labels, whom it keeps and what the plate corrects."""

import cv2
import numpy as np
import pytest

from gsac.avatar.artifacts import KEYPOINT_SHAPES, Clip, frame_paths, write_arrays
from gsac.avatar.frame_files import read_alpha, write_frame
from gsac.avatar.sapiens import PARTS, Sapiens
from gsac.stages.contract import BadInput, Job
from gsac.stages.segment import stage
from gsac.stages.segment.config import SegmentConfig
from support.artifacts import blank
from support.body_parts import alpha_of, paint, write_onnx


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    return {"sapiens-seg": write_onnx(tmp_path_factory.mktemp("network"))}


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


def test_the_networks_own_alpha_and_labels_come_out_of_the_stage(network, tmp_path):
    body, faint = (160, 20, 20), (155, 20, 20)
    image = paint(((60, 50, 200, 400), body), ((90, 100, 160, 200), faint))
    (alpha, *_), (labels, *_), warnings = run(tmp_path, [image] * 2, [(80, 80), (180, 80), (120, 300), (130, 350)], network)
    assert not warnings and labels.dtype == np.uint8
    assert np.abs(alpha[250:390, 70:190] - alpha_of(body)).max() < 5e-4  # the file holds half floats
    assert np.abs(alpha[110:190, 100:150] - alpha_of(faint)).max() < 5e-4
    assert not alpha[:, 230:].any() and not labels[:, 230:].any()
    assert (labels[60:390, 70:190] == PARTS.index("lower_clothing")).all()


def test_a_frame_without_a_person_has_empty_labels_too(network, tmp_path):
    image = paint(((60, 50, 200, 400), (160, 20, 20)))
    alphas, labels, warnings = run(tmp_path, [image, paint()], [(80, 80), (180, 80), (120, 300), (130, 350)], network)
    assert alphas[0].any() and labels[0].any() and not alphas[1].any() and not labels[1].any()
    assert warnings == ["The mask of frame 1 is empty although a person was found there."]


def test_of_two_persons_the_one_with_the_points_is_kept_to_the_edge(network, tmp_path):
    image = paint(((40, 50, 140, 450), (160, 20, 20)), ((200, 50, 300, 450), (20, 20, 130)))
    alphas, labels, _ = run(tmp_path, [image], [(80, 80), (100, 80), (90, 300), (90, 400)], network)
    assert not alphas[0][:, 175:].any() and not labels[0][:, 175:].any()
    assert (alphas[0][60:440, 45:135] > 0.7).all() and (labels[0] != PARTS.index("hair")).all()


def test_the_empty_scene_opens_what_the_network_fills_and_leaves_its_alpha_elsewhere(network, tmp_path):
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


def test_a_file_that_is_no_such_network_ends_the_stage_with_its_name(tmp_path):
    with pytest.raises(BadInput, match="model file sapiens-seg has input .* expected Sapiens' segmentation"):
        run(tmp_path, [paint()], [(80, 80)], {"sapiens-seg": write_onnx(tmp_path, side=(512, 512), kind="square")})


def test_the_config_asks_for_the_file_that_the_user_brings():
    assert SegmentConfig(method="sapiens").models() == ("sapiens-seg",)
    assert "sapiens-seg" not in SegmentConfig().models()

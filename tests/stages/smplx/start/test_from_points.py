"""The body laid along points in space, and a fit that starts from what a brought network sees."""

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.frame_files import write_frame
from gsac.avatar.instant_hmr import BODY, HAND_BEGINS
from gsac.avatar.joints import INDEX as JOINT
from gsac.avatar.wholebody import HANDS, INDEX
from gsac.stages.contract import BadInput, Job
from gsac.stages.findings import Code
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.initial import hang_arms
from gsac.stages.smplx.stage import run
from gsac.stages.smplx.start.from_points import LIMB_JOINTS, turn_to_points
from gsac.stages.smplx.warmup import FOCAL, FRAMES, HEIGHT, TURN, WIDTH, write_inputs
from support.onnx_files import write_encoder, write_instant_hmr

POSE = {"pelvis": (2.8, 0.3, 0.2), "left_hip": (-1.2, 0.4, 0.3), "right_hip": (0.3, -0.2, 0.1), "left_knee": (1.4, 0, 0),
        "right_knee": (0.5, 0, 0), "left_shoulder": (0.3, -0.4, -0.9), "right_shoulder": (-0.2, 0.5, 0.6),
        "left_elbow": (0, -1.3, 0), "right_elbow": (0, 1.7, 0), "left_wrist": (0.3, 0.2, -0.2), "head": (0.1, 0.3, 0)}


def posed(body: Body, turns: dict) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vectors (55, 3) over hanging collar bones, and the points (133, 3) m, limbs in the joints, as the rig tells them."""
    pose = np.zeros((1, 55, 3))
    for side in ("left", "right"):
        collar = JOINT[f"{side}_collar"]
        pose[0, collar] = rotation.log(hang_arms(1, 55, body.joint_names)[0, collar])
    for name, turn in turns.items():
        pose[0, JOINT[name]] = turn
    params = BodyParams.from_pose(pose, np.zeros((1, 3)), np.zeros(body.num_betas), np.zeros((1, body.exprdirs.shape[2])), 1000.0,
                                  (0, 0), model=body.digest)
    vertices, joints = body.posed(params)
    points = body.keypoints(vertices)[0]
    points[[INDEX[name] for name in LIMB_JOINTS]] = joints[0][[JOINT[name] for name in LIMB_JOINTS]]
    return pose[0], points


def test_every_joint_of_trunk_limbs_and_hands_is_turned_as_the_points_say(body):
    pose, points = posed(body, POSE)
    found = turn_to_points(body, points)
    truth = rotation.exp(pose)
    for name in POSE:
        off = np.linalg.norm(rotation.log(found[JOINT[name]].T @ truth[JOINT[name]]))
        assert off < (1e-3 if name in ("head", "left_wrist") else 1e-4), name
    assert np.isnan(found[22:]).all()


def test_a_straight_limb_lies_along_its_points_and_is_not_twisted(body):
    _, points = posed(body, {"left_shoulder": (0.2, -0.3, 0.8)})
    found = turn_to_points(body, points)
    assert np.linalg.norm(rotation.log(found[JOINT["left_elbow"]])) < 0.02
    again = posed(body, {body.joint_names[j]: rotation.log(found[j]) for j in range(22)})[1]
    limbs = [INDEX[name] for name in LIMB_JOINTS]
    np.testing.assert_allclose(again[limbs] - again[limbs].mean(0), points[limbs] - points[limbs].mean(0), atol=1e-3)


def to_rig(points: np.ndarray) -> np.ndarray:
    """Points (133, 3) in the rig's order (70, 3); what the rig has besides is zero."""
    out = np.zeros((70, 3))
    out[:len(BODY)] = points[[INDEX[name] for name in BODY]]
    for side, begin in HAND_BEGINS.items():
        hand = points[HANDS[side]]
        out[begin:begin + 21] = np.concatenate([hand[1:].reshape(5, 4, 3)[:, ::-1].reshape(20, 3), hand[:1]])
    return out


@pytest.fixture(scope="module")
def inputs(tmp_path_factory, body: Body):
    """The turning person; red and green of a frame are cosine and sine of the turn, from -1..1 to 0..255."""
    made = write_inputs(body, tmp_path_factory.mktemp("inputs"))
    for t in range(FRAMES):
        colour = np.rint([127.5 * (np.cos(t * TURN) + 1), 127.5 * (np.sin(t * TURN) + 1), 0])
        write_frame(made["split/frames"] / f"{t:06d}.png", np.full((HEIGHT, WIDTH, 3), colour, np.uint8))
    return made


def turned(angle: float) -> np.ndarray:
    """The pelvis' rotation vector (3,) of a person who faces the camera and turned by an angle, rad."""
    return np.pi * np.array([np.cos(angle / 2), 0, np.sin(angle / 2)])


def network(folder, body: Body, aside: float = 0.0):
    """Told cosine and sine by the colours, it gives the points of the person so turned; in the picture, trunks stand still."""
    seen = [to_rig(posed(body, {"pelvis": turned(angle), "left_shoulder": (0, 0, 0.7)})[1]) for angle in (0, np.pi / 2, np.pi)]
    middle = (seen[0] + seen[2]) / 2
    cosine, sine = seen[0] - middle, seen[1] - middle
    points = np.zeros((13, 70, 3))
    points[0], points[1], points[12] = 2 * cosine, 2 * sine, middle - cosine - sine
    flat = np.zeros((13, 70, 2))
    flat[12], flat[12, 5:7], flat[12, 9:11] = [aside, 0], [aside, -0.54], [aside, -0.1]
    return write_instant_hmr(folder / "net.onnx", flat, np.nan_to_num(points))


def fit(inputs, folder, file):
    said = []
    (folder / "out").mkdir()
    config = SmplxConfig(method="brought", start="my-hmr", focal_px=FOCAL)
    run(Job(inputs, folder / "out", config, {"my-hmr": file}, warn=said.append))
    return BodyParams.read(folder / "out" / "body.npz"), {f.code: f.figure for f in said}


def test_what_the_network_sees_in_each_frame_becomes_the_pose(inputs, body, tmp_path):
    found, said = fit(inputs, tmp_path, network(tmp_path, body))
    for t in range(FRAMES):
        off = rotation.log(rotation.exp(found.pose[t, 0].astype(float)).T @ rotation.exp(turned(t * TURN)))
        assert np.degrees(np.linalg.norm(off)) < 0.5
        np.testing.assert_allclose(found.pose[t, JOINT["left_shoulder"]], [0, 0, 0.7], atol=5e-3)
    assert not {Code.START_INTERPOLATED, Code.START_DOUBTED} & said.keys()


def test_another_person_in_the_crop_is_no_start(inputs, body, tmp_path):
    _, said = fit(inputs, tmp_path, network(tmp_path, body, aside=0.8))
    assert said[Code.START_INTERPOLATED] == FRAMES


def test_a_network_of_another_kind_is_named_with_its_parameter(inputs, tmp_path):
    other = write_encoder(tmp_path / "other.onnx", np.zeros((12, 5)), np.zeros(5))
    with pytest.raises(BadInput, match="smplx.start is my-hmr: neither a file of poses, nor InstantHMR's network: .*joints_3d"):
        fit(inputs, tmp_path, other)

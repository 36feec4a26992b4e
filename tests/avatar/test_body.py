"""The body model and its loader."""

from __future__ import annotations

import numpy as np
import pytest

from gsac.avatar import wholebody
from gsac.avatar.artifacts import ArtifactError, check_body
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.joints import INDEX, NAMES


@pytest.fixture(scope="module")
def body() -> Body:
    return Body.load()


def official_file(path, vertices=400, faces=300, directions=20, **changes):
    """A generated file of the official keys and shapes (not the official data)."""
    rng = np.random.default_rng(0)
    weights = rng.random((vertices, 55))
    arrays = {
        "v_template": rng.normal(0, 0.5, (vertices, 3)), "f": rng.integers(0, vertices, (faces, 3)).astype(np.uint32),
        "shapedirs": rng.normal(0, 0.01, (vertices, 3, directions)), "posedirs": np.zeros((vertices, 3, 486)),
        "J_regressor": np.full((55, vertices), 1 / vertices), "weights": weights / weights.sum(1, keepdims=True),
        "kintree_table": np.array([[2**32 - 1, *range(54)], range(55)], np.uint32), "hands_meanl": np.zeros(45),
    } | changes
    np.savez(path, **{k: v for k, v in arrays.items() if v is not None})
    return path


def test_at_zero_rotation_the_body_stands_in_a_t_pose_facing_plus_z(body):
    vertices, joints = body.rest(np.zeros(body.num_betas))
    at = dict(zip(body.joint_names, joints, strict=True))
    assert at["left_wrist"][0] > 0.5 > -0.5 > at["right_wrist"][0]
    assert abs(at["left_wrist"][1] - at["left_shoulder"][1]) < 0.02
    assert np.ptp(vertices[:, 1]) == pytest.approx(1.8, abs=0.15)
    points = dict(zip(wholebody.INDEX, body.keypoints(vertices), strict=True))
    assert points["nose"][2] > points["left_ear"][2] + 0.05 and points["left_eye"][0] > 0 > points["right_eye"][0]


def test_clothes_stand_off_the_skin_alike_on_both_sides_and_move_no_joint(body):
    bare, joints = body.rest(np.zeros(body.num_betas))
    for i, name in enumerate(body.clothes, body.num_figure):
        betas = np.zeros(body.num_betas)
        betas[i] = 1
        dressed, moved = body.rest(betas)
        off = np.linalg.norm(dressed - bare, axis=1)
        assert 0.006 < np.percentile(off[off > 0.003], 90) < 0.014, name
        assert np.abs(moved - joints).max() < 1e-3, name
        assert off[np.abs(bare[:, 0]) > 0.8].max() < 1e-3, f"{name}: hands stay bare"
        left, right = off[bare[:, 0] > 0.01].sum(), off[bare[:, 0] < -0.01].sum()
        assert left == pytest.approx(right, rel=0.02), name
    assert body.num_figure == 20 == body.num_betas - len(body.clothes)


def test_joints_come_in_smplx_order_and_parents_before_children(body):
    assert body.joint_names == NAMES and len(NAMES) == 55
    assert body.parents[0] == -1 and all(p < j for j, p in enumerate(body.parents))
    assert body.joint_names[body.parents[INDEX["left_thumb1"]]] == "left_wrist"


def test_at_most_four_weights_a_vertex_and_they_sum_to_one(body):
    assert ((body.weights > 0).sum(1) <= 4).all()
    assert np.allclose(body.weights.sum(1), 1, atol=1e-5) and np.allclose(body.skin_weight.sum(1), 1, atol=1e-5)


def test_posing_turns_about_the_pelvis_and_then_translates(body):
    pose = np.zeros((1, 55, 3))
    pose[0, 0] = [0, np.pi / 2, 0]
    params = BodyParams.from_pose(pose, [[1.0, 2.0, 3.0]], np.zeros(body.num_betas), np.zeros((1, 52)), 1000, (0, 0))
    vertices, joints = body.posed(params)
    rest, rest_joints = body.rest(np.zeros(body.num_betas))
    turn = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    expected = (rest - rest_joints[0]) @ turn.T + rest_joints[0] + [1, 2, 3]
    assert np.allclose(vertices[0], expected, atol=1e-5)
    assert np.allclose(joints[0, 0], rest_joints[0] + [1, 2, 3], atol=1e-5)


def test_a_bent_elbow_moves_the_hand_and_nothing_of_the_other_side(body):
    pose = np.zeros((2, 55, 3))
    pose[1, INDEX["left_elbow"]] = [0, -1.2, 0]
    params = BodyParams.from_pose(pose, np.zeros((2, 3)), np.zeros(body.num_betas), np.zeros((2, 52)), 1000, (0, 0))
    vertices, joints = body.posed(params)
    assert np.array_equal(body.posed_joints(params), joints)
    moved = np.linalg.norm(vertices[1] - vertices[0], axis=1)
    assert moved[vertices[0][:, 0] < 0].max() < 1e-6
    assert joints[1, INDEX["left_wrist"], 2] > joints[0, INDEX["left_wrist"], 2] + 0.1


def test_jaw_rotation_opens_the_mouth_of_a_body_whose_jaw_is_an_action(body):
    pose = np.zeros((2, 55, 3))
    pose[1, INDEX["jaw"]] = [0.3, 0, 0]
    params = BodyParams.from_pose(pose, np.zeros((2, 3)), np.zeros(body.num_betas), np.zeros((2, 52)), 1000, (0, 0))
    vertices, _ = body.posed(params)
    opened = body.exprdirs[..., body.expression_names.index("jawOpen")]
    assert (vertices[1] - vertices[0])[np.abs(opened[:, 1]).argmax(), 1] < -0.01


def test_hand_points_lie_in_the_hand(body):
    points = body.keypoints(body.v_template)
    _, joints = body.rest(np.zeros(body.num_betas))
    middle = joints[INDEX["left_middle1"]]
    assert np.linalg.norm(points[91:112] - middle, axis=1).max() < 0.16
    assert np.linalg.norm(points[wholebody.INDEX["left_hand_middle1"]] - middle) < 0.01
    assert points[wholebody.INDEX["left_hand_middle4"], 0] > points[wholebody.INDEX["left_hand_middle1"], 0] + 0.06


def test_params_survive_writing_and_reading(tmp_path, body):
    rng = np.random.default_rng(0)
    params = BodyParams.from_pose(rng.normal(size=(3, 55, 3)), rng.normal(size=(3, 3)), rng.normal(size=20),
                                  rng.normal(size=(3, 52)), (900, 910), (1, 2), model=body.digest)
    params.write(tmp_path / "body.npz")
    back = BodyParams.read(tmp_path / "body.npz")
    assert np.array_equal(back.pose, params.pose) and back.model == body.digest and np.array_equal(back.focal, params.focal)


def test_a_resting_face_is_kept_and_files_without_one_are_read_and_written_as_before(tmp_path, body):
    params = BodyParams.from_pose(np.zeros((2, 55, 3)), np.zeros((2, 3)), np.zeros(4), np.zeros((2, 52)), 900, (1, 2))
    params.write(tmp_path / "body.npz")
    assert "rest_expression" not in check_body(tmp_path / "body.npz")
    assert BodyParams.read(tmp_path / "body.npz").rest_expression is None
    params.rest_expression = np.linspace(0, 1, 52, dtype=np.float32)
    params.write(tmp_path / "body.npz")
    np.testing.assert_array_equal(BodyParams.read(tmp_path / "body.npz").rest_expression, params.rest_expression)
    check_body(tmp_path / "body.npz")
    for wrong, said in ((params.rest_expression + 0.1, "must lie in 0..1"), (params.rest_expression[1:], "has shape")):
        params.rest_expression = wrong
        params.write(tmp_path / "body.npz")
        with pytest.raises(ArtifactError, match=f"body.npz: array rest_expression {said}"):
            check_body(tmp_path / "body.npz")


def test_where_something_hides_the_person_is_kept_and_files_of_clear_views_stay_as_they_were(tmp_path, body):
    params = BodyParams.from_pose(np.zeros((2, 55, 3)), np.zeros((2, 3)), np.zeros(4), np.zeros((2, 52)), 900, (1, 2))
    params.write(tmp_path / "body.npz")
    assert "occluder" not in check_body(tmp_path / "body.npz") and BodyParams.read(tmp_path / "body.npz").occluder is None
    params.occluder = np.eye(5, 3, dtype=bool)
    params.write(tmp_path / "body.npz")
    check_body(tmp_path / "body.npz")
    np.testing.assert_array_equal(BodyParams.read(tmp_path / "body.npz").occluder, params.occluder)


def test_a_file_of_the_official_keys_drops_in(tmp_path):
    body = Body.load(official_file(tmp_path / "SMPLX_NEUTRAL.npz", directions=400))
    assert (body.num_betas, body.exprdirs.shape[2]) == (300, 100) and body.parents[0] == -1 and body.clothes == ()
    assert body.posedirs is None, "all zero"
    assert body.leading(20).num_betas == 20 and np.array_equal(body.leading(20).shapedirs, body.shapedirs[:, :, :20])
    vertices, joints = body.rest(np.zeros(10))
    assert vertices.shape == (400, 3) and joints.shape == (55, 3)
    old = Body.load(official_file(tmp_path / "old.npz"))
    assert (old.num_betas, old.exprdirs.shape[2]) == (10, 10) and old.hand_means is None


def test_the_mean_hands_and_their_components_are_read_left_first(tmp_path):
    rng = np.random.default_rng(4)
    hands = {name + side: rng.normal(size=shape) for name, shape in (("hands_mean", 45), ("hands_components", (45, 45)))
             for side in "lr"}
    body = Body.load(official_file(tmp_path / "whole.npz", **hands))
    np.testing.assert_array_equal(body.hand_means[:15].ravel(), hands["hands_meanl"])
    np.testing.assert_array_equal(body.hand_means[15:].ravel(), hands["hands_meanr"])
    np.testing.assert_array_equal(body.hand_components, [hands["hands_componentsl"], hands["hands_componentsr"]])


def test_the_open_body_has_neither_correctives_nor_mean_hands_and_keeps_its_betas(body):
    assert body.posedirs is None and body.hand_means is None and body.hand_components is None
    assert body.leading(5) is body, "clothes are among its betas"
    rest = body.rest(np.zeros(3))[0]
    assert body.correct(rest, np.ones((55, 3))) is rest


@pytest.mark.parametrize("changes,named", [({"weights": None}, "weights"), ({"J_regressor": np.zeros((24, 400))}, "J_regressor"),
                                           ({"shapedirs": np.zeros((400, 3, 50))}, "shapedirs"),
                                           ({"posedirs": np.ones((400, 3, 207))}, "posedirs"),
                                           ({"hands_meanl": np.zeros(12), "hands_meanr": np.zeros(12)}, "hands_meanl"),
                                           ({"weights": np.ones((400, 55))}, "weights"),
                                           ({"f": np.full((300, 3), 9999)}, "f names vertex")])
def test_a_wrong_body_file_is_refused_by_the_array_that_is_wrong(tmp_path, changes, named):
    with pytest.raises(ArtifactError, match=named):
        Body.load(official_file(tmp_path / "bad.npz", **changes))


def test_an_official_file_is_as_good_under_a_name_without_suffix(tmp_path):
    """The model store keeps files under the user's own names."""
    kept = official_file(tmp_path / "SMPLX_NEUTRAL.npz", directions=400).rename(tmp_path / "my-body")
    assert Body.load(kept).num_betas == 300
    (tmp_path / "pickled").write_bytes(b"\x80\x04.")
    with pytest.raises(ArtifactError, match="run code"):
        Body.load(tmp_path / "pickled")


def test_pickles_and_missing_files_are_refused_with_what_to_do(tmp_path):
    (tmp_path / "SMPLX_MALE.pkl").write_bytes(b"\x80\x04.")
    with pytest.raises(ArtifactError, match="npz"):
        Body.load(tmp_path / "SMPLX_MALE.pkl")
    with pytest.raises(ArtifactError, match="no body model file"):
        Body.load(tmp_path / "absent.npz")
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(ArtifactError, match="not a readable"):
        Body.load(tmp_path / "text.npz")


@pytest.mark.parametrize(("changes", "why"), [
    ({"kintree_table": np.array([[0, *range(1, 55)], range(55)])}, "kintree_table names a parent that is no earlier joint"),
    ({"shapedirs": np.zeros((400, 3, 501))}, "400 vertices and 501 shape directions; at most 50000 and 500 are read"),
    ({"v_template": np.full((400, 3), 1e300)}, "v_template is not finite, or beyond float32"),
    ({"v_template": np.full((400, 3), "x")}, "not built as a body model"),
    ({"f": np.zeros((0, 3), int)}, "not built as a body model"),
    ({"num_betas": np.zeros(3)}, "not built as a body model"),
    ({"jaw_actions": np.zeros((2, 2))}, "not built as a body model"),
    ({"keypoint_row": np.array([200]), "keypoint_vertex": np.array([0]), "keypoint_weight": np.array([1.0])}, "not built as a")])
def test_an_array_of_another_kind_than_a_body_has_is_named(tmp_path, changes, why):
    with pytest.raises(ArtifactError, match=rf"odd\.npz: .*{why}"):
        Body.load(official_file(tmp_path / "odd.npz", **changes))

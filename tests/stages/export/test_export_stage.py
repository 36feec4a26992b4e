import ast
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.artifacts import write_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.cache.code import code_parts
from gsac.stages.contract import BadInput, Job, make_config
from gsac.stages.export import STAGE
from gsac.stages.export.config import ExportConfig
from gsac.stages.export.stage import rig_avatar, run
from gsac.viewer import page


def test_every_declared_output_is_there_and_passes_its_check(exported):
    for output in STAGE.outputs:
        output.check(exported / output.path)


def test_same_input_same_bytes(person, exported, tmp_path):
    run(Job(person, tmp_path, ExportConfig()))
    made = {path.relative_to(exported) for path in exported.rglob("*") if path.is_file()}
    assert made == {path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()}
    for path in made:
        assert (tmp_path / path).read_bytes() == (exported / path).read_bytes(), path


def test_the_container_holds_the_trained_body_and_its_provenance(person, exported):
    avatar, params = RiggedAvatar.read(exported / "avatar.gsac"), BodyParams.read(person["train/body.npz"])
    body = Body.load()
    vertices, joints = body.rest(params.betas, None, params.joint_offset)
    np.testing.assert_allclose(avatar.vertices, vertices, atol=1e-6)
    np.testing.assert_allclose(avatar.joints, joints, atol=1e-6)
    assert avatar.provenance["body_model"] == body.digest
    assert avatar.provenance["clip_sha256"] == "ab" * 32
    assert len(avatar.expression_names) == 52 and list(avatar.clips) == ["walk", "wave"]


def test_the_container_poses_and_moves_the_face_as_the_body_does(exported, person):
    avatar, params = RiggedAvatar.read(exported / "avatar.gsac"), BodyParams.read(person["train/body.npz"])
    body = Body.load()
    rng = np.random.default_rng(3)
    expression = (rng.random(52) < .1).astype(np.float32) * .7
    pose = rng.normal(size=(1, 55, 3)).astype(np.float32) * .3
    pose[:, 22] = 0
    truth = BodyParams.from_pose(pose, np.zeros((1, 3)), params.betas, expression[None], 1000, (0, 0),
                                 params.joint_offset)
    rest = avatar.vertices.copy()
    for e in np.flatnonzero(expression):
        span = slice(avatar.expression_start[e], avatar.expression_start[e + 1])
        rest[avatar.expression_vertex[span]] += expression[e] * avatar.expression_delta[span]
    moved = replace(avatar, vertices=rest).posed(pose[0])
    error = np.linalg.norm(moved - body.posed(truth)[0][0], axis=1)
    assert error.max() < 5e-4, "deltas under 0.1 mm are left out"


def test_without_expression_the_avatar_has_the_person_s_own_face_and_weight_1_is_the_full_action_all_the_same(person):
    body, params = Body.load(), BodyParams.read(person["train/body.npz"])
    params.rest_expression = np.zeros(52, np.float32)
    own = {"jawOpen": 0.2, "eyeBlinkLeft": 0.25, "eyeBlinkRight": 0.3}
    for name, value in own.items():
        params.rest_expression[body.expression_names.index(name)] = value
    gaussians = Gaussians.read(person["train/avatar.npz"])
    avatar, neutral = rig_avatar(body, params, gaussians), rig_avatar(body, replace(params, rest_expression=None), gaussians)
    np.testing.assert_allclose(avatar.vertices, body.rest(params.betas, params.rest_expression, params.joint_offset)[0], atol=1e-6)
    assert np.linalg.norm(avatar.vertices - neutral.vertices, axis=1).max() > 2e-3
    np.testing.assert_array_equal(avatar.joints, neutral.joints)
    for e, name in enumerate(avatar.expression_names):
        span = slice(avatar.expression_start[e], avatar.expression_start[e + 1])
        acted, full = avatar.vertices.copy(), params.rest_expression.copy()
        acted[avatar.expression_vertex[span]] += avatar.expression_delta[span]
        full[e] = 1
        apart = np.abs(acted - body.rest(params.betas, full, params.joint_offset)[0]).max()
        assert apart < 1.1e-4, f"{name} beside its full action; what moves by less than 0.1 mm is left out"


def test_the_light_of_the_clip_is_carried_on_and_left_out_where_there_is_none(person, exported):
    assert RiggedAvatar.read(exported / "avatar.gsac").gaussians.light is None
    gaussians, params = Gaussians.read(person["train/avatar.npz"]), BodyParams.read(person["train/body.npz"])
    gaussians.light = np.float32([[.9, .8, .7], [.1, 0, 0], [0, -.2, 0], [0, 0, -.3]])
    np.testing.assert_array_equal(rig_avatar(Body.load(), params, gaussians).gaussians.light, gaussians.light)


def test_the_viewer_page_is_at_most_2_mb_for_6000_gaussians_and_names_no_other_address(exported):
    page = (exported / "viewer.html").read_bytes()
    assert len(page) <= 2_000_000
    assert b"http:" not in page and b"https:" not in page and b"src=" not in page


@pytest.mark.parametrize("values", [{"ply_pose": "s"}, {"animations": "wave,fly"}, {"ply_pad_sh": 3}, {"colour": 1}])
def test_a_wrong_parameter_is_named(values):
    with pytest.raises(BadInput) as e:
        make_config(STAGE, values)
    assert f"export.{next(iter(values))}" in str(e.value)


def test_animations_may_be_left_out(person, tmp_path):
    run(Job(person, tmp_path, ExportConfig(animations="", ply_pose="t")))
    assert RiggedAvatar.read(tmp_path / "avatar.gsac").clips == {}


def test_another_body_model_is_refused_and_said(person, tmp_path):
    params = BodyParams.read(person["train/body.npz"])
    params.model = "f" * 64
    params.write(tmp_path / "body.npz")
    with pytest.raises(BadInput, match="body model ffffffffffff"):
        run(Job(person | {"train/body.npz": tmp_path / "body.npz"}, tmp_path, ExportConfig()))


@pytest.mark.parametrize("faces", [[27420], [-1], []])
def test_gaussians_that_lie_on_no_face_are_refused_and_said(person, tmp_path, faces):
    g = Gaussians.read(person["train/avatar.npz"])[:len(faces)]
    write_arrays(tmp_path / "avatar.npz", face=np.array(faces, np.int32), mu=g.mu, quat=g.quat, log_scale=g.log_scale,
                 rgb=g.rgb, opacity=g.opacity)
    with pytest.raises(BadInput, match=r"avatar\.npz"):
        run(Job(person | {"train/avatar.npz": tmp_path / "avatar.npz"}, tmp_path, ExportConfig()))


def test_an_edit_of_any_viewer_file_counts_as_an_edit_of_the_stage():
    named = {name.partition("/")[2] for name in code_parts("gsac.stages.export.stage") if name.startswith("gsac.viewer.page/")}
    there = {path.name for path in Path(page.__file__).parent.iterdir() if path.is_file() and path.suffix != ".py"}
    assert named == there - {"page.hlsl"}, "page.hlsl reaches the page through shaders.js"


def test_the_declaration_imports_nothing_heavy():
    code = "import sys, gsac.stages.export; print([m for m in ('torch', 'cv2', 'numba', 'scipy') if m in sys.modules])"
    got = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ast.literal_eval(got.stdout) == []

"""A head mesh that `face` found, laid on whichever body is fitted, and FLAME's face in SMPL-X's words."""

import numpy as np
import pytest

from gsac.avatar.body import Body
from gsac.avatar.flame_file import read_flame
from gsac.stages.contract import StageError
from gsac.stages.smplx.expression import translate_expression
from gsac.stages.smplx.paper.head import Head, HeadTerms, select_head


@pytest.fixture(scope="module")
def body() -> Body:
    return Body.load()


def brought(flame_file, betas) -> dict[str, np.ndarray]:
    """face.npz's arrays of a FLAME head of this shape."""
    flame = read_flame(flame_file)
    head = flame.rest(betas)
    return {"head_template": flame.v_template - [0, 0.8, 0], "head_vertices": head - head.mean(0), "head_faces": flame.faces,
            "head_eyes": flame.J_regressor[3:] @ flame.v_template - [0, 0.8, 0]}


def test_a_flame_head_is_carried_over_to_the_bodys_vertices(body, flame_file):
    betas = np.random.default_rng(0).normal(0, 1, body.num_betas)
    head = Head.from_arrays(brought(flame_file, betas), body)
    assert len(head.index) > 0.9 * select_head(body).sum()
    assert np.array_equal(head.index[head.faces].shape[1:], (3,)) and head.faces.max() < len(head.index)
    true = body.rest(betas)[0][head.index]
    off = np.linalg.norm(head.vertices - head.vertices.mean(0) - true + true.mean(0), axis=1)
    assert off.mean() < 0.001


def test_the_face_terms_tell_a_head_from_another(body, flame_file):
    torch = pytest.importorskip("torch")
    betas = np.random.default_rng(1).normal(0, 1, body.num_betas).astype(np.float32)
    terms = HeadTerms(body, Head.from_arrays(brought(flame_file, betas), body))
    own, other = (float(terms.loss(torch.tensor(b))) for b in (betas, np.zeros_like(betas)))
    assert own < 0.5 * other


def test_a_mesh_that_is_no_head_is_refused(body, flame_file):
    arrays = brought(flame_file, [0.0])
    with pytest.raises(StageError, match="no head_eyes"):
        Head.from_arrays({k: v for k, v in arrays.items() if k != "head_eyes"}, body)
    with pytest.raises(StageError, match="head_faces must be"):
        Head.from_arrays(arrays | {"head_faces": arrays["head_faces"] + 5023}, body)
    with pytest.raises(StageError, match="head vertices lie on its head mesh"):
        far = np.linspace(0, 9, len(arrays["head_template"]))[:, None]
        Head.from_arrays(arrays | {"head_template": arrays["head_template"] + far}, body)
    assert Head.from_arrays({}, body) is None


def test_a_body_of_flames_expressions_takes_them_from_the_flame_head(body):
    class Official:
        expression_names = tuple(f"expression{i}" for i in range(10))
        jaw_actions = np.zeros((10, 3))

    face = {"expression": np.zeros((2, 52), np.float32), "jaw": np.zeros((2, 3), np.float32)}
    face["expression"][1, 24] = 1
    expression, jaw, silent = translate_expression(Official, face)
    assert not expression.any() and jaw[1, 0] > 0.3 and "only the jaw" in silent
    face |= {"flame_expression": np.arange(100, dtype=np.float32).reshape(2, 50), "flame_jaw": np.full((2, 3), 0.1, np.float32)}
    expression, jaw, silent = translate_expression(Official, face)
    assert np.array_equal(expression, face["flame_expression"][:, :10]) and np.array_equal(jaw, face["flame_jaw"]) and not silent
    assert np.array_equal(translate_expression(body, face)[0], face["expression"])  # the open body acts the actions themselves

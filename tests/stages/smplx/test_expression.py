"""The facial actions of face.npz in the expressions of the body model."""

from __future__ import annotations

import numpy as np

from gsac.stages.findings import Code
from gsac.stages.smplx.expression import translate_expression, translate_rest


def test_of_a_face_whose_flame_is_not_told_in_this_body_only_the_jaw_is_carried_over(body):
    class Official:
        expression_names = tuple(f"expression{i}" for i in range(10))
        jaw_actions = np.zeros((10, 3))

    face = {"expression": np.zeros((2, 52), np.float32), "jaw": np.zeros((2, 3), np.float32)}
    face["expression"][1, 24] = 1
    betas = np.zeros(10)
    expression, jaw, silent = translate_expression(Official, betas, face, None)
    assert not expression.any() and jaw[1, 0] > 0.3 and silent.code is Code.JAW_ALONE
    face |= {"flame_expression": np.arange(100, dtype=np.float32).reshape(2, 50), "flame_jaw": np.full((2, 3), 0.1, np.float32)}
    expression, jaw, silent = translate_expression(Official, betas, face, None)
    assert not expression.any() and np.array_equal(jaw, face["flame_jaw"]) and silent.code is Code.FLAME_LEFT_OUT
    assert np.array_equal(translate_expression(body, betas, face, None)[0], face["expression"]), "the open body acts the actions"


def test_the_face_at_rest_is_the_body_s_neutral_one_where_none_was_seen_or_the_body_has_other_expressions(body):
    class Official:
        expression_names = tuple(f"expression{i}" for i in range(10))
        jaw_actions = np.zeros((10, 3))

    face = {"expression": np.zeros((2, 52), np.float32)}
    assert translate_rest(body, face) is None, "as in files of before"
    face["rest_expression"] = np.full(52, 0.1, np.float32)
    assert translate_rest(Official, face) is None
    np.testing.assert_array_equal(translate_rest(body, face), face["rest_expression"])

"""Parameters of `smplx`."""

from __future__ import annotations

from typing import get_args

import pytest

from gsac.stages.contract import BadInput, make_config
from gsac.stages.smplx import STAGE, config, stage


def test_every_method_that_can_be_chosen_is_there():
    assert tuple(stage.METHODS) == get_args(config.Method)


@pytest.mark.parametrize("values,name", [({"method": "magic"}, "smplx.method"), ({"height_m": 17.0}, "smplx.height_m"),
                                         ({"focal_px": -1.0}, "smplx.focal_px"), ({"rounds": 0}, "smplx.rounds"),
                                         ({"joint_offsets": -0.1}, "smplx.joint_offsets"),
                                         ({"betas": 3}, "smplx.betas")])
def test_a_wrong_parameter_is_named(values, name):
    with pytest.raises(BadInput, match=name):
        make_config(STAGE, values)


def test_a_wrong_method_is_told_what_there_is():
    with pytest.raises(BadInput, match=r"smplx\.method is 'magic'; choices: lm, paper, brought"):
        make_config(STAGE, {"method": "magic"})

"""What the GPU's side of `train` refuses and promises without a GPU."""

import pytest
from gsac.avatar.cuda import why_not
from gsac.stages.contract import BadInput, make_config
from gsac.stages.train import STAGE, config
from gsac.stages.train.recipes import RECIPES
from gsac.stages.train.stage import check_device


def test_every_recipe_has_an_entry_for_every_device():
    assert set(RECIPES) == {(name, device) for name in config.RECIPES for device in config.DEVICES if device != config.AUTO}


@pytest.mark.parametrize("device", ["auto", "cpu", "cuda"])
def test_exposure_is_refused_where_the_recipe_learns_none(device):
    with pytest.raises(BadInput, match="train.exposure.*train.recipe to fast"):
        make_config(STAGE, {"recipe": "paper", "device": device, "exposure": True})
    assert make_config(STAGE, {"recipe": "fast", "device": device, "exposure": True}).exposure


@pytest.mark.skipif(why_not() is None, reason="there is a GPU here")
def test_cuda_without_a_gpu_says_what_is_missing_and_what_to_do():
    with pytest.raises(BadInput, match="cuda, but .*(GPU|driver|gsac\\[gpu\\]).*train.device to cpu"):
        check_device("cuda")


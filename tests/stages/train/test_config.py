"""The configuration of `train`: recipes and devices, what it tells the GPU, what it refuses; on a GPU, the bytes of the stage."""

import json
from dataclasses import fields
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest

from gsac.avatar.camera import Camera
from gsac.avatar.cuda import why_not
from gsac.pipeline.keys import AUTO, DEVICES
from gsac.pipeline.params import meanings
from gsac.stages.contract import BadInput, make_config
from gsac.stages.train import STAGE, config
from gsac.stages.train.config import TrainConfig
from gsac.stages.train.fast import schedule, size_search
from gsac.stages.train.fast.cuda import make_recipe
from gsac.stages.train.paper import trainer as paper
from gsac.stages.train.recipes import BACKENDS, RECIPES
from gsac.stages.train.stage import check_device, run
from gsac.stages.train.views import View


def test_every_recipe_has_an_entry_for_every_device():
    assert set(RECIPES) == {(name, device) for name in get_args(config.Recipe) for device in BACKENDS}
    assert {config.AUTO, *BACKENDS} == set(get_args(config.Device)) == {AUTO, *DEVICES}, "and the engine has the same devices"


@pytest.mark.parametrize("name,kind", [("recipe", config.Recipe), ("device", config.Device), ("lpips", config.Lpips)])
def test_a_choice_that_is_none_is_told_what_there_is(name, kind):
    with pytest.raises(BadInput, match=f"train.{name} is 'magic'; choices: {', '.join(get_args(kind))}"):
        make_config(STAGE, {name: "magic"})


def test_the_docstrings_of_the_parameters_tell_the_full_size():
    told = meanings(TrainConfig)
    assert f"{config.FULL_SIZE:,}" in told["largest"] and size_search.list_sizes(config.FULL_SIZE)[0] == config.FULL_SIZE


def filmed(pixels, **values):
    """A task whose frames show that many pixels of a person."""
    view = View(Camera((900.0, 900.0), (50.0, 50.0), 1000, 1000), np.zeros((1000, 1000, 4), np.uint8), (0, 0))
    view.pixels.reshape(-1, 4)[:pixels, 3] = 255
    return SimpleNamespace(views=[view], trained=np.array([0]), config=TrainConfig(**values))


def test_sizes_and_coarse_steps_follow_from_the_pixels_of_the_person():
    (small, least), (large, most) = config.SMALL, config.LARGE
    sizes = [schedule.budget(filmed(int(pixels)), "cpu") for pixels in (100, large / 4, large, 9.9e5)]
    assert sizes == [config.SIZES[0], 7000, 14000, config.SIZES[1]] and "14,000" in meanings(TrainConfig)["gaussians"]
    assert schedule.budget(filmed(int(large)), "cuda") == config.FULL_SIZE * config.MORE["cuda"]
    assert schedule.budget(filmed(int(large), gaussians=700), "cuda") == 700
    shares = [config.coarse_share(pixels) for pixels in (100, small, (small * large) ** 0.5, large, 9.9e5)]
    np.testing.assert_allclose(shares, [least, least, (least + most) / 2, most, most], rtol=1e-4)
    usual, more = config.FAST_STEPS["cpu"], config.FAST_STEPS["cuda"]
    assert config.coarse_steps(small, more) == config.coarse_steps(small, usual) > config.coarse_steps(small, 400)


def test_the_docstring_of_the_steps_tells_those_of_each_recipe():
    told = meanings(TrainConfig)["steps"]
    assert all(str(steps) in told for steps in (*config.FAST_STEPS.values(), paper.STEPS))


def test_a_configuration_tells_whether_the_size_is_searched():
    assert TrainConfig().searches_size() and not TrainConfig(recipe="paper").searches_size()
    assert not TrainConfig(gaussians=700).searches_size()


@pytest.mark.parametrize("device", ["auto", "cpu", "cuda"])
def test_exposure_is_refused_where_the_recipe_learns_none(device):
    with pytest.raises(BadInput, match="train.exposure.*train.recipe to fast"):
        make_config(STAGE, {"recipe": "paper", "device": device, "exposure": True})
    assert make_config(STAGE, {"recipe": "fast", "device": device, "exposure": True}).exposure


@pytest.mark.skipif(why_not() is None, reason="there is a GPU here")
def test_cuda_without_a_gpu_says_what_is_missing_and_what_to_do():
    with pytest.raises(BadInput, match="cuda, but .*(GPU|driver|\\.\\[gpu\\]).*train.device to cpu"):
        check_device("cuda")


def test_the_losses_of_the_papers_text_are_refused_where_another_recipe_would_pass_them_over():
    assert make_config(STAGE, {"recipe": "paper", "paper_text": True}).paper_text
    with pytest.raises(BadInput, match="train.paper_text is of recipe paper"):
        make_config(STAGE, {"paper_text": True})


def test_the_gpu_is_told_what_the_configuration_and_the_recipe_say():
    made = make_recipe(TrainConfig(mask=0.5, mu_rate=2e-3, exposure=True), 3000, batch=3)
    assert (made.mask, made.mu_rate, made.batch, made.steps) == (0.5, 2e-3, 3, config.FAST_STEPS["cuda"])
    assert made.largest == schedule.longest_axis(TrainConfig(), 3000) == TrainConfig().largest * 2
    assert (made.end, made.mu_end) == (schedule.END, schedule.MU_END)
    assert (made.offset_share, made.gain_rate) == (schedule.OFFSET_SHARE, schedule.GAIN_RATE)
    assert make_recipe(TrainConfig(steps=7), 12000).steps == 7 and make_recipe(TrainConfig(), 12000).gain_rate == 0
    shared = {f.name for f in fields(TrainConfig)} & {f.name for f in fields(made)}
    told = TrainConfig(steps=9)
    assert {n: getattr(make_recipe(told, 12000), n) for n in shared} == {n: getattr(told, n) for n in shared}


def test_lpips_is_in_the_loss_of_recipe_paper_and_of_fast_only_where_asked_and_able(monkeypatch):
    from gsac.avatar.camera import Camera
    from gsac.avatar.cuda import perceptual
    from gsac.stages.train.stage import without_lpips

    told = {(recipe, lpips): TrainConfig(recipe=recipe, lpips=lpips).in_loss()
            for recipe in get_args(config.Recipe) for lpips in get_args(config.Lpips)}
    assert {wish: name for wish, name in told.items() if name} == {
        ("paper", "auto"): "lpips-vgg", ("paper", "loss"): "lpips-vgg", ("fast", "loss"): "lpips-vgg",
        ("paper", "vgg-hed"): "vgg-hed", ("fast", "vgg-hed"): "vgg-hed"}
    frames, small = Camera((500, 500), (150, 200), 300, 400), Camera((50, 50), (31, 40), 63, 80)
    paper, fast = (TrainConfig(recipe=recipe, lpips="loss") for recipe in ("paper", "fast"))
    assert without_lpips(paper, "cpu", frames) is None and "recipe paper" in without_lpips(fast, "cpu", frames)
    assert "64 px" in without_lpips(paper, "cpu", small)
    for why in (None, "torch cannot use the GPU"):
        monkeypatch.setattr(perceptual, "why_not", lambda why=why: why)
        for asked in (fast, paper, TrainConfig(recipe="paper")):
            assert without_lpips(asked, "cuda", frames) is why


@pytest.mark.skipif(why_not() is not None, reason=f"CUDA path: {why_not()}")
def test_one_seed_gives_the_same_bytes_on_a_gpu_and_the_same_choice_of_a_size(job):
    found = []
    for name in ("a", "b"):
        made = job(name, device="cuda", gaussians="auto", steps=400)
        run(made)
        figures = json.loads((made.out / "metrics.json").read_text())
        found.append([*((made.out / file).read_bytes() for file in ("avatar.npz", "body.npz")), figures["size_curve"],
                      [row["loss"] for row in figures["curve"]], figures["heldout"]])
    assert found[0] == found[1] and len(found[0][2]) > 1

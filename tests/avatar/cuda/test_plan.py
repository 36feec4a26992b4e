"""What holds of the CUDA trainer without a GPU: its plan, its lists, its structs, and what it says."""

import ctypes
import shutil
import subprocess
import sys

import numpy as np
import pytest

from gsac.avatar.cuda import adjacency, structs, why_not
from gsac.avatar.cuda.recipe import FROM_CONFIG, Recipe, draw_plan


def test_importing_the_cuda_path_loads_nothing_heavy():
    code = ("import sys, gsac.avatar.cuda, gsac.avatar.cuda.recipe, gsac.avatar.cuda.kernels; "
            "print([m for m in ('torch', 'numba', 'cuda', 'cuda.bindings') if m in sys.modules])")
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"


@pytest.mark.skipif(why_not() is None, reason="there is a GPU here")
def test_without_a_gpu_the_device_says_why_it_cannot_be_used():
    from gsac.avatar.cuda.device import Device, NoDeviceError

    with pytest.raises(NoDeviceError, match="GPU|driver|\\.\\[gpu\\]"):
        Device()


def test_structs_are_laid_out_alike_for_host_and_kernels(tmp_path):
    compiler = shutil.which("g++") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no gcc here: the structs' layout is not compiled")
    sizes = ", ".join(f"sizeof({name})" for name in ("Frame", "Plan", "State", "Scene"))
    text = structs.declarations() + f"\n#include <cstddef>\nextern \"C\" void sizes(int *out) {{ int all[] = {{{sizes}, " \
        "(int)offsetof(Scene, ssim), (int)offsetof(Frame, fx)}; for (int i = 0; i < 6; ++i) out[i] = all[i]; }"
    (tmp_path / "sizes.cpp").write_text(text)
    subprocess.run([compiler, "-shared", "-fPIC", "-o", tmp_path / "sizes.so", tmp_path / "sizes.cpp"], check=True)
    out = (ctypes.c_int * 6)()
    ctypes.CDLL(str(tmp_path / "sizes.so")).sizes(out)
    assert list(out) == [*(ctypes.sizeof(getattr(structs, name)) for name in ("Frame", "Plan", "State", "Scene")),
                         structs.Scene.ssim.offset, structs.Frame.fx.offset]


def test_the_plan_draws_what_the_cpu_recipe_draws():
    drawn = draw_plan(Recipe(steps=30, seed=5, coarse_share=0.5, mu_rate=1.5e-3), 7, 2)
    random, left = np.random.default_rng(5), []
    for step in range(30):
        if not left:
            left = list(random.permutation(7))
        assert drawn.order[step, 0] == left.pop()
        np.testing.assert_array_equal(drawn.background[step, 0], random.random(3).astype(np.float32))
    assert (drawn.rates["level"] == np.repeat([0, 1], 15)).all()
    np.testing.assert_allclose(drawn.rates["mu"], 1.5e-3 * 0.01 ** (np.arange(30) / 30), rtol=1e-6)


def test_steps_on_sides_take_no_frame_from_the_round_and_teach_nothing_that_only_frames_tell():
    sides = np.where(np.arange(30) % 3 == 2, np.arange(30) // 3 % 4, -1)
    told = {"pose_rate": 1e-3, "gain_rate": 1e-3, "joint_rate": 1e-4, "offset_rate": 1e-3, "mu_rate": 1e-3}
    drawn, plain = (draw_plan(Recipe(steps=30, seed=5, sides=given, **told), 7, 1) for given in (sides, None))
    looks = sides >= 0
    np.testing.assert_array_equal(drawn.order[looks, 0], 7 + sides[looks])
    for name in ("pose", "gain", "joints", "offset"):
        assert (drawn.rates[name][looks] == 0).all() and (drawn.rates[name][~looks] > 0).all()
    np.testing.assert_array_equal(drawn.rates["mu"], plain.rates["mu"])
    on_frames = drawn.order[~looks, 0]
    assert all(len(set(on_frames[k:k + 7])) == 7 for k in range(0, 14, 7))


def test_a_recipe_that_is_told_nothing_learns_nothing_counts_nothing_and_limits_nothing():
    plain = Recipe(steps=3)
    drawn = draw_plan(plain, 2, 1)
    assert (drawn.rates["centre"] == -1).all()
    assert not any(drawn.rates[name].any() for name in drawn.rates.dtype.names if name != "centre")
    assert (plain.ssim, plain.sobel, plain.mask, plain.pose_pull) == (0, 0, 0, 0)
    assert np.isinf([plain.needle, plain.largest, plain.reach]).all()


def test_a_recipe_names_the_fields_that_a_configuration_lacks_instead_of_learning_without_them():
    from types import SimpleNamespace

    config = SimpleNamespace(**dict.fromkeys(FROM_CONFIG, 0.5))
    made = Recipe.of(config, steps=3, ssim=0.2)
    assert (made.steps, made.ssim) == (3, 0.2) and all(getattr(made, name) == 0.5 for name in FROM_CONFIG if name != "ssim")
    del config.mu_rate, config.reach
    with pytest.raises(AttributeError, match="SimpleNamespace has no mu_rate, reach"):
        Recipe.of(config, steps=3)


def test_plans_of_the_other_trainers_hold_their_frames_and_rates():
    from types import SimpleNamespace

    from gsac.avatar.cuda.align import Aligner, AlignRecipe
    from gsac.avatar.cuda.paper import PaperRecipe, PaperTrainer
    from gsac.avatar.cuda.rounds import Round, RoundsRecipe, RoundsTrainer

    def plan(kind, recipe, frames):
        return kind.plan(SimpleNamespace(recipe=recipe, frames=frames), 1)

    still = plan(Aligner, AlignRecipe(steps=12, pose_rate=1e-3, pose_end=0.05), 3)
    assert still.order[:, 0].tolist() == [0] * 4 + [1] * 4 + [2] * 4 and (still.background == 1).all()
    np.testing.assert_allclose(still.rates["pose"], np.tile(1e-3 * 0.05 ** (np.arange(4) / 4), 3), rtol=1e-6)
    assert not any(still.rates[name].any() for name in ("mu", "quat", "log_scale", "rgb", "opacity", "offset", "place_pull"))

    grounds = np.random.default_rng(0).random((2, 3, 3))
    rounds = [Round(np.array([2, 0, 1]), grounds[0], 0.0), Round(np.array([1, 2, 0]), grounds[1], 0.3)]
    found = plan(RoundsTrainer, RoundsRecipe(steps=6, mu_rate=1.5e-3, offset_rate=1e-3, offset_share=0.6, gain_rate=2e-3,
                                              rounds=rounds), 3)
    assert found.order[:, 0].tolist() == [2, 0, 1, 1, 2, 0] and not found.rates["pose"].any()
    np.testing.assert_allclose(found.background[:, 0], grounds.reshape(-1, 3), rtol=1e-6)
    np.testing.assert_allclose(found.rates["mu"], np.repeat([1.5e-3, 1.5e-3 * 0.01**0.3], 3), rtol=1e-6)
    np.testing.assert_allclose(found.rates["offset"], np.repeat([1e-3, 1e-3 * 0.1**0.5], 3), rtol=1e-6)
    np.testing.assert_allclose(found.rates["gain"], np.repeat([2e-3, 2e-3 * 0.1**0.3], 3), rtol=1e-6)

    order, seen = np.arange(40).reshape(10, 4) % 6, np.arange(10) > 3
    found = plan(PaperTrainer, PaperRecipe(steps=10, batch=4, order=order, background=grounds, centre=order, mu_rates=np.arange(10),
                                           counts=seen, rgb_rate=5e-3, beta_rate=2e-4, expression_rate=2e-5), 6)
    assert found.order is order and found.background is grounds and (found.rates["centre"] == -1).all()
    assert (found.rates["rgb"] == np.float32(5e-3)).all() and (found.rates["betas"] == np.float32(2e-4)).all()
    assert (found.rates["expression"] == np.float32(2e-5)).all()
    assert found.rates["mu"].tolist() == list(range(10)) and (found.rates["counts"] == seen).all()


def test_a_step_never_holds_a_frame_twice():
    order = draw_plan(Recipe(steps=50, batch=4), 6, 1).order
    assert all(len(set(row)) == 4 for row in order)
    assert draw_plan(Recipe(steps=2, batch=4), 3, 1).order.shape == (2, 3)


def test_lists_hold_every_corner_weight_and_child_once():
    random = np.random.default_rng(0)
    faces, face = random.integers(0, 9, (20, 3)), random.integers(0, 20, 50)
    start, item = adjacency.face_corners(faces, face, 9)
    assert sorted(item) == list(range(150))
    for v in range(9):
        mine = item[start[v]:start[v + 1]]
        assert (faces[face].reshape(-1)[mine] == v).all() and (np.diff(mine) > 0).all()
    index, weight = random.integers(0, 5, (30, 4)), random.random((30, 4)) * (random.random((30, 4)) > 0.3)
    start, vertex, kept = adjacency.joint_vertices(index, weight, 5)
    for j in range(5):
        np.testing.assert_allclose(kept[start[j]:start[j + 1]].sum(), weight[index == j].sum())
    assert start[-1] == (weight != 0).sum() and len(vertex) == start[-1]
    start, child = adjacency.joint_children(np.array([-1, 0, 0, 1, 3]))
    assert [list(child[start[j]:start[j + 1]]) for j in range(5)] == [[1, 2], [3], [], [4], []]
    assert list(adjacency.joint_levels(np.array([-1, 0, 0, 1, 3]))) == [0, 1, 1, 2, 3]

"""The search for a size: the rule on made-up figures, the whole on the small person."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gsac.avatar.gaussians import Gaussians
from gsac.stages.contract import BadInput, make_config
from gsac.stages.train import STAGE, choose_heldout
from gsac.stages.train.fast import refit, size_search, trainer
from gsac.stages.train.fast.cpu import Cpu
from gsac.stages.train.fast.size_rule import SizeScore, choose, optimism, standard_error
from gsac.stages.train.gaussians import joint_cuts
from gsac.stages.train.stage import run


def is_handed_out(count, size):
    """Whether an avatar of so many gaussians is what becomes of `size`: less a speck, and with halves where joints bend."""
    return size - 1 <= count <= (1 + joint_cuts.MOST) * size


def score(count, psnr, detail=0.9, spread=0.1):
    wobble = np.array([-1, 0, 1, 0])
    return SizeScore(count, list(psnr + spread * wobble), list(detail + 0.02 * wobble))


def test_the_smallest_size_within_one_standard_error_of_the_best_is_chosen():
    error = standard_error(score(1, 0.0).psnr_fg)
    scores = [score(8000, 26.0), score(4000, 26.01), score(2000, 26.01 - 0.9 * error), score(1000, 26.01 - 1.1 * error)]
    assert choose(scores).n_gaussians == 2000


def test_a_blurred_size_is_not_chosen_however_good_its_psnr():
    assert choose([score(8000, 26.0), score(4000, 26.0, detail=0.8)]).n_gaussians == 8000


def test_frames_that_differ_much_excuse_no_loss_above_the_bar():
    scores = [score(8000, 26.0, spread=4), score(4000, 25.8, spread=4), score(2000, 25.7, spread=4)]
    assert choose(scores).n_gaussians == 4000


def test_frames_that_would_have_chosen_as_the_others_do_flatter_nothing():
    assert optimism([score(8000, 26.0), score(4000, 26.01), score(2000, 25.0)]) == 0


def test_a_choice_that_hangs_on_one_frame_flatters_it():
    scores = [SizeScore(8000, [26.0, 26.0, 26.0, 26.0], [0.9] * 4), SizeScore(4000, [25.9, 25.9, 25.9, 26.4], [0.9] * 4)]
    assert choose(scores).n_gaussians == 4000
    assert optimism(scores) == pytest.approx((26.4 - 26.0) / 4)


def test_text_that_is_not_auto_is_refused():
    with pytest.raises(BadInput, match="train.gaussians is 'many'"):
        make_config(STAGE, {"gaussians": "many"})


def test_a_size_is_the_mean_of_its_last_steps():
    config, places = make_config(STAGE, {"steps": 100}), []

    class Steps:
        values = {"mu": np.zeros((2, 3), np.float32)}

        def learn(self, steps):
            self.values = {"mu": self.values["mu"] + np.float32(steps[-1].number)}
            places.append(self.values["mu"])

        def free_buffers(self):
            """It has no buffers."""

    refitted = Cpu().refit(SimpleNamespace(config=config, trained=np.arange(3)), Steps(), dict.fromkeys(range(3)),
                            refit.Pace(share=0.4, begin=0.15, averaged=0.1, widened=3.0))
    assert len(places) == 20
    np.testing.assert_allclose(refitted.values["mu"], np.mean(places[-2:], 0))


@pytest.mark.slow
def test_sizes_are_judged_as_they_are_handed_out(job_anywhere, monkeypatch):
    level_heights, judge, judged = trainer.level_heights, size_search.judge_person, []

    def marked(gaussians, frames):
        return replace(level_heights(gaussians, frames), rgb=np.full_like(gaussians.rgb, 0.25))

    def watched(candidates):
        judged.append(candidates[0].gaussians)
        assert {view.camera.height for view in candidates[0].views.values()} == {128}, "as filmed, whatever is trained on"
        return judge(candidates)

    monkeypatch.setattr(size_search, "list_sizes", lambda largest: (400, 40))
    monkeypatch.setattr(trainer, "level_heights", marked)
    monkeypatch.setattr(size_search, "judge_person", watched)
    run(job_anywhere(gaussians="auto", height=64, frames=6, steps=12, pose_rounds=0, pose_test_steps=0))
    assert len(judged) == 2 and all((gaussians.rgb == 0.25).all() for gaussians in judged)


@pytest.mark.slow
def test_auto_walks_down_until_the_held_out_frames_tell_a_difference(job_anywhere, monkeypatch):
    monkeypatch.setattr(size_search, "list_sizes", lambda largest: (1200, 600, 60, 30))
    monkeypatch.setattr(size_search, "OF_SIZE", refit.OF_SIZE._replace(share=0.13))
    made = job_anywhere(gaussians="auto", pose_test_steps=0)
    run(made)
    figures = json.loads((made.out / "metrics.json").read_text())
    curve = figures["size_curve"]
    assert [row["n_gaussians"] for row in curve] in ([1200, 600], [1200, 600, 60]), "60 gaussians are not enough for a person"
    chosen = [row["n_gaussians"] for row in curve if row["chosen"]]
    assert len(chosen) == 1
    assert is_handed_out(len(Gaussians.read(made.out / "avatar.npz")), chosen[0])
    assert curve[-1]["n_gaussians"] != chosen[0] and curve[-1]["psnr_fg_mean"] < curve[-2]["psnr_fg_mean"]
    assert curve[1]["psnr_fg_mean"] > curve[0]["psnr_fg_mean"] - 2, "what is left after merging covers the person"
    assert figures["size_frames"] == figures["heldout_frames"], "a short clip needs its frames for training"


def test_a_blurred_size_is_not_chosen_though_its_psnr_is_the_best():
    frames = [-0.4, 0.4, 0.0, 0.0]
    sharp = SizeScore(9000, [25.0 + f for f in frames], [0.74] * 4)
    blurred = SizeScore(4500, [25.1 + f for f in frames], [0.58] * 4)
    assert choose([sharp, blurred]) is sharp
    assert choose([sharp, SizeScore(6000, blurred.psnr_fg, [0.72] * 4), blurred]).n_gaussians == 6000


def test_a_single_frame_tells_no_sizes_apart_by_a_tenth_of_a_decibel():
    sizes = [SizeScore(9000, [23.35], [0.74]), SizeScore(6000, [23.42], [0.63]), SizeScore(4500, [23.45], [0.58])]
    assert choose(sizes) is sizes[0]
    assert choose([*sizes, SizeScore(2000, [23.9], [0.5])]).n_gaussians == 2000, "by more than a quarter they do"


@pytest.mark.slow
def test_a_long_clip_is_judged_on_frames_that_did_not_choose(job_anywhere, monkeypatch):
    monkeypatch.setattr(size_search, "list_sizes", lambda largest: (500, 60))
    monkeypatch.setattr(choose_heldout, "LONG", 6)
    made = job_anywhere(gaussians="auto", frames=10, steps=8, holdout=4, pose_rounds=0, pose_test_steps=0)
    run(made)
    figures = json.loads((made.out / "metrics.json").read_text())
    chose, judged = figures["size_frames"], figures["heldout_frames"]
    assert len(chose) == len(judged) == 2 and not set(chose) & set(judged)
    assert figures["trained_frames"] == 6


@pytest.mark.slow
def test_every_size_is_tried_where_that_is_asked_for_and_the_choice_is_the_rules(job_anywhere, monkeypatch):
    monkeypatch.setattr(size_search, "list_sizes", lambda largest: (400, 40, 20))
    made = job_anywhere(gaussians="auto", every_size=True, frames=6, steps=12, pose_rounds=0, pose_test_steps=0)
    run(made)
    curve = json.loads((made.out / "metrics.json").read_text())["size_curve"]
    assert [row["n_gaussians"] for row in curve] == [400, 40, 20]
    scores = [SizeScore(row["n_gaussians"], row["psnr_fg"], row["detail"]) for row in curve]
    assert [row["n_gaussians"] for row in curve if row["chosen"]] == [choose(scores).n_gaussians]
    assert is_handed_out(len(Gaussians.read(made.out / "avatar.npz")), choose(scores).n_gaussians)


@pytest.mark.slow
def test_auto_without_held_out_frames_takes_the_largest_size(job_anywhere, monkeypatch):
    monkeypatch.setattr(size_search, "list_sizes", lambda largest: (700, 300))
    made = job_anywhere(gaussians="auto", frames=3, steps=5)
    run(made)
    assert is_handed_out(json.loads((made.out / "metrics.json").read_text())["n_gaussians"], 700)

"""The whole stage on a small turning person."""

import json
from functools import partial

import numpy as np
import pytest

from gsac.avatar.artifacts import read_arrays
from gsac.avatar.body import LOST, Body, BodyParams
from gsac.avatar.frame_files import read_frame
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.metrics import summary
from gsac.stages.contract import BadInput, StageError, make_config
from gsac.stages.train import STAGE, stage
from gsac.stages.train.fast import trainer
from gsac.stages.train.judge.heldout import judge
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.stage import run
from gsac.stages.train.views import read_whole

QUICK = {"frames": 6, "steps": 8, "pose_rounds": 0, "pose_test_steps": 6}


def metrics(job):
    for output in STAGE.outputs:
        output.check(job.out / output.path)
    return json.loads((job.out / "metrics.json").read_text())


@pytest.mark.slow
def test_held_out_frames_are_rendered_better_as_training_goes_on_and_poses_come_nearer_the_truth(job_anywhere):
    made = job_anywhere(curve=10)
    run(made)
    figures = metrics(made)
    assert figures["psnr_fg"] > 15.5 and figures["alpha_iou"] > 0.8
    assert figures["psnr_fg"] > next(r["psnr_fg"] for r in figures["curve"] if "psnr_fg" in r) + 0.4
    assert figures["psnr_fg"] > figures["psnr_fg_fit"] + 2, "the neighbours' pose correction reaches held-out frames"
    assert figures["psnr_fg_ttpo"] > figures["psnr_fg"] and figures["lpips"] is None
    assert figures["flip"] is None and figures["psnr_hands_ttpo"] > 5
    assert 0 <= figures["stray_alpha"] < 0.2 and figures["needle_share"] == 0
    assert "NaN" not in (made.out / "metrics.json").read_text()
    assert sum("psnr_fg" in row for row in figures["curve"]) == 10 and len(figures["curve"]) == 20
    assert len(figures["heldout_frames"]) == 3 and figures["trained_frames"] == 9
    assert (made.out / f"heldout/{figures['heldout_frames'][0]:06d}_render.png").is_file()
    before, after = read_arrays(made.inputs["smplx/body.npz"]), read_arrays(made.out / "body.npz")
    error = [abs(np.median(a["transl"][:, 0])) for a in (before, after)]
    assert error[1] < 0.6 * error[0]
    np.testing.assert_array_equal(before["betas"], after["betas"])


EVERY_IMAGE = {"psnr_full", "psnr_full_black", "psnr_fg", "psnr_edge", "psnr_inside", "stray_edge_alpha", "ssim", "ssim_black",
               "lpips_alex", "lpips_vgg", "lpips_alex_black", "lpips_vgg_black", "flip", "alpha_iou", "psnr_face", "detail"}
TOGETHER = EVERY_IMAGE | {"psnr_full_pooled", "psnr_full_black_pooled", "psnr_fg_pooled", "psnr_hands", "lpips", "lpips_black"}


@pytest.mark.slow
def test_every_figure_is_told_of_all_images_and_of_each_with_and_without_the_pose_moved_to_the_image(job_anywhere):
    made = job_anywhere(steps=10, flip=True)
    run(made)
    figures = metrics(made)
    for names, told in ((TOGETHER, figures), (EVERY_IMAGE | {"psnr_left_hand", "psnr_right_hand"}, figures["heldout"][1])):
        for name in {*names, *(f"{name}_ttpo" for name in names)}:
            assert name in told, name
            assert told[name] is None if "lpips" in name else np.isfinite(told[name]) or "hand" in name, name
    assert {"stray_alpha", "needle_share", "psnr_fg_fit"} <= set(figures) and set(figures["pose_at_test"])
    mean = np.mean([row["psnr_full_black_ttpo"] for row in figures["heldout"]])
    assert figures["psnr_full_black_ttpo"] == pytest.approx(mean)
    assert figures["psnr_fg_pooled"] <= figures["psnr_fg"]
    assert 0 < figures["flip_ttpo"] <= figures["flip"] * 1.05 < 1
    assert all(0 < row["flip"] < 1 for row in figures["heldout"])


def test_held_out_frames_are_judged_as_filmed_and_at_the_small_size_whatever_was_trained_on(job, monkeypatch):
    monkeypatch.setattr(stage, "SMALL", 64)
    half, whole = job("half", height=64, **QUICK), job("whole", height=128, **QUICK)
    run(half)
    run(whole)
    told = {}
    for made, trained in ((half, [36, 64]), (whole, [72, 128])):
        told[trained[1]] = figures = metrics(made)
        assert figures["image_size"] == [72, 128] and figures["trained_size"] == trained
        shapes = {read_frame(path).shape for path in (made.out / "heldout").glob("0*.png")}
        assert shapes == {(128, 72, 3)}, "pictures are as filmed"
        small = figures["at_64"]
        assert set(small) == {f"{name}{end}" for name in stage.ALSO_SMALL for end in ("", "_ttpo")}
        assert small["psnr_fg"] != figures["psnr_fg"] and small["psnr_fg_ttpo"] > small["psnr_fg"]
        assert figures["psnr_fg_ttpo"] > figures["psnr_fg"] + 0.5, "poses are moved onto the frames as filmed"
        boxes = [row["face_box"] for row in figures["heldout"] if row["face_box"]]
        assert boxes and all(0 <= x0 < x1 <= 72 and 0 <= y0 < y1 <= 64 for x0, y0, x1, y1 in boxes)
    params, held = BodyParams.read(half.out / "body.npz"), told[64]["heldout_frames"]
    views = read_whole(half.inputs["split/frames"], half.inputs["segment/alpha"], params.camera(72, 128), held)
    rows = judge(Gaussians.read(half.out / "avatar.npz"), Poses(Body.load(), params), held, views)
    assert told[64]["psnr_fg"] == pytest.approx(summary(rows)["psnr_fg"], abs=0.01), "of the frames as they are on disk"


@pytest.mark.slow
@pytest.mark.parametrize("values", [{"steps": 40}, {"steps": 4, "recipe": "paper"}], ids=["fast", "paper"])
def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_avatar(job_anywhere, monkeypatch, values):
    monkeypatch.setattr("gsac.stages.train.paper.densify.FIRST", 1)
    monkeypatch.setattr("gsac.stages.train.paper.densify.EVERY", 2)
    monkeypatch.setattr("gsac.stages.train.paper.densify.PHASE", 0)
    jobs = [job_anywhere(name, pose_test_steps=0, seed=seed, **values) for name, seed in (("a", 0), ("b", 0), ("c", 1))]
    for each in jobs:
        run(each)
    for name in ("avatar.npz", "body.npz"):
        assert (jobs[0].out / name).read_bytes() == (jobs[1].out / name).read_bytes()
    assert (jobs[0].out / "avatar.npz").read_bytes() != (jobs[2].out / "avatar.npz").read_bytes()


@pytest.mark.slow
def test_any_number_of_cores_gives_the_same_bytes(job, monkeypatch):
    written = set()
    for cores in (1, 2, 5):
        monkeypatch.setattr("gsac.avatar.threads.available_cores", partial(int, cores))
        made = job(f"cores{cores}", steps=41, pose_test_steps=0)
        run(made)
        written.add((made.out / "avatar.npz").read_bytes() + (made.out / "body.npz").read_bytes())
    assert len(written) == 1


@pytest.mark.slow
def test_the_resting_face_is_handed_on_and_alters_no_gaussian_but_recipe_paper_keeps_the_published_neutral_one(job):
    made = {name: job(name, frames=6, steps=2, pose_test_steps=0, recipe=recipe, pose_rounds=rounds)
            for name, recipe, rounds in (("neutral", "fast", 0), ("own", "fast", 0), ("moved", "fast", 1),
                                         ("published", "paper", 0))}
    run(made["neutral"])
    body = made["own"].inputs["smplx/body.npz"]
    params = BodyParams.read(body)
    params.rest_expression = np.linspace(0, 0.3, params.expression.shape[1], dtype=np.float32)
    params.write(body)
    run(made["own"]), run(made["moved"]), run(made["published"])
    assert (made["neutral"].out / "avatar.npz").read_bytes() == (made["own"].out / "avatar.npz").read_bytes()
    np.testing.assert_array_equal(BodyParams.read(made["own"].out / "body.npz").rest_expression, params.rest_expression)
    away = np.abs(BodyParams.read(made["moved"].out / "body.npz").rest_expression - params.rest_expression).max()
    assert 1e-6 < away < 0.05, "it moves as the frames' expressions are corrected"
    assert BodyParams.read(made["published"].out / "body.npz").rest_expression is None


@pytest.mark.slow
def test_judging_is_a_phase_of_its_own_after_the_last_step(job):
    heard = []
    made = job(frames=6, steps=2, pose_test_steps=0)
    made.progress = lambda done, total, unit: heard.append((done, total, unit))
    run(made)
    assert heard.index((2, 2, "steps")) < heard.index((0, 4, "parts of judging"))
    assert heard[-1] == (3, 4, "parts of judging"), "never full before the stage ends"


@pytest.mark.slow
def test_empty_masks_are_left_out_with_a_warning_that_names_the_frames(job_anywhere):
    made = job_anywhere(blank=(2, 5), steps=10)
    run(made)
    figures = metrics(made)
    assert "2 of 12 frames (2, 5)" in made.warnings[0]
    assert figures["trained_frames"] + len(figures["heldout_frames"]) == 10
    assert not {2, 5} & set(figures["heldout_frames"])


def test_the_turn_in_the_figures_is_that_of_the_warning_which_counts_no_empty_mask(job):
    made = job(frames=6, blank=(2, 3), steps=2, gaussians=200, pose_test_steps=0)
    run(made)
    assert metrics(made)["turn_degrees"] == pytest.approx(180, abs=3)
    assert any(f"from {metrics(made)['turn_degrees']:.0f} of 360 degrees" in w for w in made.warnings)


@pytest.mark.slow
def test_frames_without_a_fitted_body_are_neither_trained_on_nor_judged(job_anywhere):
    made = job_anywhere(steps=20, pose_test_steps=0)
    path = made.inputs["smplx/body.npz"]
    params = BodyParams.read(path)
    params.sigma_joints[[2, 3]] = LOST
    params.write(path)
    run(made)
    figures = metrics(made)
    assert not {2, 3} & set(figures["heldout_frames"])
    assert figures["trained_frames"] + len(figures["heldout_frames"]) == 10
    assert any("2 of 12 frames (2-3)" in warning for warning in made.warnings)


def test_of_a_frame_of_nobody_that_was_not_fitted_the_empty_mask_is_not_told_again(job):
    made = job(frames=6, blank=(2, 3), steps=2, gaussians=200, pose_test_steps=0)
    path = made.inputs["smplx/body.npz"]
    params = BodyParams.read(path)
    params.sigma_joints[2] = LOST
    params.write(path)
    run(made)
    assert [warning for warning in made.warnings if "not trained on" in warning] == [
        "The mask is empty or missing in frame 3; not trained on."]
    assert metrics(made)["trained_frames"] + len(metrics(made)["heldout_frames"]) == 4


def test_masks_that_are_all_empty_stop_the_stage(job):
    made = job(frames=2, blank=(0, 1), steps=5)
    with pytest.raises(StageError, match="every mask is empty"):
        run(made)


@pytest.mark.slow
def test_a_turn_that_was_seen_in_part_is_warned_of_and_a_whole_one_is_not(job_anywhere):
    whole, part = job_anywhere("whole", steps=4), job_anywhere("part", steps=4)
    params = BodyParams.read(part.inputs["smplx/body.npz"])
    run(whole)
    params.global_orient[:] = params.global_orient[6] + np.linspace(0, 0.1, len(params.global_orient))[:, None]
    folder = part.out.parent / "front"
    folder.mkdir()
    params.write(folder / "body.npz")
    part.inputs = part.inputs | {"smplx/body.npz": folder / "body.npz"}
    run(part)
    assert not any("of 360 degrees" in w for w in whole.warnings)
    assert any("of 360 degrees" in w for w in part.warnings)
    assert not any("No frame shows the" in w for w in whole.warnings)


@pytest.mark.slow
def test_one_photo_gives_an_avatar_without_a_measure_and_says_so(job_anywhere):
    made = job_anywhere(frames=1, steps=10, timestamps=False)
    run(made)
    figures = metrics(made)
    assert figures["psnr_fg"] is None and figures["psnr_full_ttpo"] is None and figures["heldout_frames"] == []
    assert any("not measured" in w for w in made.warnings)


def test_poses_that_do_not_belong_to_the_frames_are_refused(job):
    made = job(frames=2, steps=5)
    (made.inputs["split/frames"] / "000001.png").unlink()
    with pytest.raises(StageError, match="2 poses.*1 frames"):
        run(made)


def test_a_number_that_is_not_finite_stops_with_step_and_quantity(job, monkeypatch):
    made = job(frames=2, steps=5, holdout=0)
    plain = trainer.Trainer._image_loss

    def poisoned(self, image, target, spans, workspace):
        loss, gradient = plain(self, image, target, spans, workspace)
        self.calls = getattr(self, "calls", 0) + 1
        return (float("nan"), gradient) if self.calls == 3 else (loss, gradient)

    monkeypatch.setattr(trainer.Trainer, "_image_loss", poisoned)
    with pytest.raises(StageError, match="loss is not finite at step [23]"):
        run(made)


@pytest.mark.parametrize("name, value", [("recipe", "magic"), ("lpips", "on"), ("holdout", 1), ("gaussians", 3), ("steps", 0),
                                         ("pose_rate", -1.0), ("curve", -1), ("pose_rate", float("nan"))])
def test_wrong_parameters_are_named(name, value):
    with pytest.raises(BadInput, match=f"train.{name}"):
        make_config(STAGE, {name: value})

"""Tables and charts of trainings, on made-up ones."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.zbuffer import rasterise
from gsac.benchmarks import training
from gsac.benchmarks.command import names
from gsac.benchmarks.size import bench as size
from gsac.benchmarks.size import chart as size_chart
from gsac.benchmarks.speed_accuracy import chart, novel_poses, table
from gsac.benchmarks.speed_accuracy.trial import Trial, hypervolume, pareto_front, seconds_to
from gsac.stages.contract import BadInput
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View


def made(recipe, curve, clip="a", steps=100, seed=0):
    return Trial(clip, recipe, steps, seed, curve, *curve[-1], curve[-1][1] + 1, 0.95, 0.9, 1000, 0.5)


FAST = made("fast", [(2.0, 21.0), (10.0, 25.0), (40.0, 26.5)])
PAPER = made("paper", [(50.0, 22.0), (400.0, 25.0)])


def test_seconds_to_a_quality_are_those_of_the_first_checkpoint_that_has_it():
    assert seconds_to(FAST, 25.0) == 10.0 and seconds_to(FAST, 25.1) == 40.0 and seconds_to(PAPER, 26.0) is None


def test_the_pareto_line_holds_what_nothing_beats():
    assert pareto_front(FAST.curve + PAPER.curve) == FAST.curve
    assert pareto_front([(1.0, 21.0), (1.0, 23.0), (2.0, 22.0)]) == [(1.0, 23.0)]


def test_hypervolume_is_the_area_to_an_hour_and_20_db():
    assert hypervolume([(36.0, 25.0)]) == pytest.approx(10.0)
    assert hypervolume([(36.0, 25.0), (360.0, 26.0)]) == pytest.approx(11.0)
    assert hypervolume([(36.0, 19.0), (5000.0, 30.0)]) == 0


def test_the_comparison_names_the_ratio_and_the_difference():
    words = table.text([FAST, PAPER])
    assert "reaches paper's 25.00 dB after 10.0 CPU s, 40.0x sooner" in words and "best end is +1.50 dB" in words
    assert "never reaches paper's 27.00 dB" in table.text([FAST, made("paper", [(400.0, 27.0)])])


def test_spread_of_seeds_and_unreached_qualities_are_in_the_table():
    row = table.text([FAST, made("fast", [(2.0, 21.0), (20.0, 24.5)], seed=1)]).splitlines()[2]
    assert f"{np.std([26.5, 24.5], ddof=1):.2f}" in row and row.split()[-1] == "-"
    assert row.split()[-4:-2] == ["15.0", "-"], "24 dB after 10 and 20 s; 25 dB by one of the two only"


def test_charts_and_csv_are_written(tmp_path):
    table.write_csv([FAST, PAPER], tmp_path / "s.csv")
    assert len(list(csv.reader((tmp_path / "s.csv").read_text().splitlines()))) == 6
    rungs = [{"n_gaussians": n, "psnr_fg_mean": 25.0, "psnr_fg_error": 0.1, "detail_mean": 0.9, "detail_error": 0.01,
              "chosen": n == 400} for n in (1000, 400)]
    size.write_csv({"a": rungs}, tmp_path / "n.csv")
    assert list(csv.reader((tmp_path / "n.csv").read_text().splitlines()))[2][1] == "400"
    assert size.text({"a": rungs}).splitlines()[2].endswith("*")
    for path in chart.draw([FAST, PAPER], tmp_path) + size_chart.draw({"a": rungs}, {"a": [(400, 24.0)]}, tmp_path):
        assert path.stat().st_size > 5000


def test_ends_are_compared_in_novel_poses_where_both_were_judged_there():
    fast, paper = replace(FAST, psnr_novel=21.5, flip_novel=0.2), replace(PAPER, psnr_novel=20.0, flip_novel=0.25)
    assert "novel poses +1.50 dB, FLIP -0.0500" in table.text([fast, paper])
    assert "novel poses" not in table.text([fast, PAPER])


def test_trainings_side_by_side_share_the_cores_and_come_back_in_order(monkeypatch):
    monkeypatch.setattr(training.os, "sched_getaffinity", lambda pid: set(range(5)))
    used = training.side_by_side(lambda k, cores: (k, tuple(cores)), [(k,) for k in range(6)], 2)
    assert [k for k, _ in used] == list(range(6)) and {cores for _, cores in used} <= {(0, 1), (2, 3, 4)}
    assert training.side_by_side(lambda k, cores: cores, [(1,)], 1) == [None], "alone a training may use all cores"


def test_joints_are_moved_onto_the_rays_of_the_truth():
    rng = np.random.default_rng(0)
    truth = rng.normal(0, 0.4, (22, 3)) + [0.2, 0.1, 4.0]
    small, shift = 0.9 * truth, np.array([0.3, -0.2, 0.5])
    assert novel_poses.solve_translation(small - shift, truth) == pytest.approx(shift, abs=1e-9), "nearer and smaller looks alike"


def test_a_floater_is_stray_and_a_missing_limb_a_hole_in_the_true_outline():
    body = Body.load()
    params = BodyParams.from_pose(np.array([[[np.pi, 0, 0], *np.zeros((54, 3))]]), np.array([[0, 0, 4.0]]), np.zeros(4),
                                  np.zeros((1, body.exprdirs.shape[2])), 300.0, (110.0, 110.0))
    poses, camera = Poses(body, params), params.camera(220, 220)
    mask = np.uint8(255 * (rasterise(poses.vertices(0), body.faces, camera)[0] >= 0))
    views = [View(camera, np.dstack([mask] * 4), (0, 0))]
    gaussians = Gaussians.area(body.v_template, body.faces, 6000)
    clean = novel_poses.judge_outline(gaussians, poses, views)
    assert clean["stray"] < 0.06 and clean["holes"] < 0.03
    places = body.v_template[body.faces[gaussians.face, 0]]
    bald = novel_poses.judge_outline(gaussians[places[:, 1] < np.quantile(places[:, 1], 0.9)], poses, views)
    assert bald["holes"] > clean["holes"] + 0.03 and bald["stray"] < clean["stray"]
    gaussians.mu[0, 1] -= 0.5 / face_frames(body.v_template, body.faces).k[gaussians.face[0]]
    gaussians.log_scale[0] += 2
    assert novel_poses.judge_outline(gaussians, poses, views)["stray"] > clean["stray"] + 0.001


def test_a_folder_that_is_no_run_is_refused_by_name(tmp_path):
    with pytest.raises(BadInput, match="there is no split/frames"):
        training.read_run(tmp_path)


def test_every_benchmark_is_found_by_its_name():
    assert {"fit", "size", "speed-accuracy"} <= set(names())

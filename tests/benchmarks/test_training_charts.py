"""Tables and charts of trainings, on made-up ones."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.frame_files import write_frame, write_image
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.zbuffer import rasterise
from gsac.benchmarks import as_filmed, training
from gsac.benchmarks.command import names
from gsac.benchmarks.size import bench as size
from gsac.benchmarks.size import chart as size_chart
from gsac.benchmarks.speed_accuracy import chart, novel_poses, table
from gsac.benchmarks.speed_accuracy.bench import main, parser, settings_before, train_values
from gsac.benchmarks.speed_accuracy.published import POINTS
from gsac.benchmarks.speed_accuracy.trial import Trial, make_trial, seconds_to
from gsac.pipeline.quality import QUALITIES
from gsac.stages.contract import BadInput
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View


def made(way, curve, clip="a", steps=100, seed=0, device="cpu", **more):
    seconds, psnr = curve[-1]
    end = {"psnr_fg_ttpo": psnr + 1, "flip": 0.2, "ssim": 0.95, "detail": 0.9, "n_gaussians": 1000, "peak_gb": 0.5} | more
    return Trial(clip, way, device, seed, steps, seconds, seconds, psnr, **end, curve=curve)


FAST = made("standard", [(2.0, 21.0), (10.0, 25.0), (40.0, 26.5)])
PAPER = made("paper", [(50.0, 22.0), (400.0, 25.0)])


def test_seconds_to_a_quality_are_those_of_the_first_checkpoint_that_has_it():
    assert seconds_to(FAST, 25.0) == 10.0 and seconds_to(FAST, 25.1) == 40.0 and seconds_to(PAPER, 26.0) is None


def test_the_comparison_names_the_ratio_and_the_difference():
    words = table.text([FAST, PAPER])
    assert "reaches paper's 25.00 dB after 10.0 s, 40.0x sooner" in words and "its end is +1.50 dB" in words
    assert "never reaches paper's 27.00 dB" in table.text([FAST, made("paper", [(400.0, 27.0)])])
    assert "paper's" not in table.text([FAST, made("paper", [(4.0, 27.0)], device="cuda")]), "one device is not told by the other"


def test_the_table_has_the_spread_of_seeds():
    row = table.text([FAST, made("standard", [(2.0, 21.0), (20.0, 24.5)], seed=1)]).splitlines()[2].split()
    assert row[3] == "2" and f"{np.std([26.5, 24.5], ddof=1):.2f}" in row and "30.0" in row, "40 and 20 s"


def test_the_seconds_are_from_clip_to_avatar():
    metrics = {"device": "cpu", "seed": 0, "steps": 9, "psnr_fg": 24.0, "cpu_seconds": 50.0, "seconds": 26.0, "psnr_fg_ttpo": None,
               "flip": 0.1, "ssim": 0.9, "detail": 0.5, "n_gaussians": 7, "peak_gb": 0.6,
               "curve": [{"loss": 1.0}, {"psnr_fg": 22.0, "cpu_seconds": 20.0, "seconds": 11.0}]}
    before, after = np.array([30.0, 16.0]), np.array([2.0, 1.0])
    trial = make_trial("a", "standard", metrics, before, after)
    assert (trial.cpu_s, trial.wall_s, trial.seconds) == (82.0, 43.0, 82.0)
    assert trial.curve == [(50.0, 22.0), (80.0, 24.0)], "the curve begins after the stages before training"
    on_gpu = make_trial("a", "standard", metrics | {"device": "cuda"}, before, after)
    assert on_gpu.seconds == 43.0 and on_gpu.curve[0] == (27.0, 22.0)


def test_stages_before_training_are_counted_from_the_runs_own_record(tmp_path):
    rows = [{"name": name, "cpu_seconds": cpu, "seconds": wall} for name, cpu, wall in
            (("split", 4.0, 2.0), ("smplx", 10.0, 6.0), ("train", 60.0, 30.0), ("export", 1.0, 1.0))]
    (tmp_path / "run.json").write_text(json.dumps({"stages": rows}))
    assert training.seconds_before(tmp_path).tolist() == [14.0, 8.0]
    (tmp_path / "run.json").write_text(json.dumps({"stages": rows[:2]}))
    assert training.seconds_before(tmp_path).tolist() == [14.0, 8.0]


def test_trials_come_back_from_the_sheet_as_they_were_written(tmp_path):
    beside = made("fine", [(3.0, 27.0)], device="cuda", seed=2)
    beside.wall_s = None
    table.write_csv([FAST, PAPER, beside], tmp_path / "s.csv")
    assert table.read_csv(tmp_path / "s.csv") == [FAST, PAPER, beside]
    (tmp_path / "s.csv").write_text("clip,way\na,fine\n")
    with pytest.raises(BadInput, match="s.csv.*curve_seconds.*device"):
        table.read_csv(tmp_path / "s.csv")


def test_parts_that_ran_on_their_own_come_together_as_one_sheet(tmp_path):
    again = made("standard", [(5.0, 26.0)])
    parts = [[made("paper", [(9.0, 22.0)], device="cuda"), PAPER], [made("standard", [(6.0, 26.1)], seed=1), FAST], [again]]
    options = ["--seeds", "--out", str(tmp_path / "all")]
    for at, trials in enumerate(parts):
        table.write_csv(trials, tmp_path / f"{at}.csv")
        options += ["--beside", str(tmp_path / f"{at}.csv")]
    assert main(options) == 0
    found = table.read_csv(tmp_path / "all" / "speed_accuracy.csv")
    assert [(t.device, t.way, t.seed) for t in found] == [("cpu", "standard", 0), ("cpu", "standard", 1), ("cpu", "paper", 0),
                                                          ("cuda", "paper", 0)]
    assert found[0] == again, "a training that is in two parts counts once, as in the last"
    assert (tmp_path / "all" / "speed_accuracy.png").stat().st_size > 5000


def test_every_way_is_a_preset_or_the_papers_recipe_and_draft_keeps_its_fewer_frames():
    assert parser().parse_args([]).ways == [*QUALITIES, "paper"] and parser().parse_args([]).repeats == 3
    assert settings_before("draft", "cpu") == ("split.count=40",) and settings_before("standard", "cpu") == ()
    assert train_values("paper", "cpu") == {"recipe": "paper"} and train_values("fine", "cuda")["gaussians"] == 25000


def test_charts_and_csv_are_written(tmp_path):
    rungs = [{"n_gaussians": n, "psnr_fg_mean": 25.0, "psnr_fg_error": 0.1, "detail_mean": 0.9, "detail_error": 0.01,
              "chosen": n == 400} for n in (1000, 400)]
    size.write_csv({"a": rungs}, tmp_path / "n.csv")
    assert list(csv.reader((tmp_path / "n.csv").read_text().splitlines()))[2][1] == "400"
    assert size.text({"a": rungs}).splitlines()[2].endswith("*")
    on_gpu = made("standard", [(30.0, 26.0)], device="cuda")
    for path in chart.draw([FAST, PAPER, on_gpu], tmp_path) + size_chart.draw({"a": rungs}, {"a": [(400, 24.0)]}, tmp_path):
        assert path.stat().st_size > 5000
    words = (tmp_path / "speed_accuracy.svg").read_text()
    assert all(point.system in words for point in POINTS) and "another protocol" in words


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


@pytest.fixture
def standing():
    """A plain avatar of 6,000 gaussians, its pose, and a view in which the person is white."""
    body = Body.load()
    params = BodyParams.from_pose(np.array([[[np.pi, 0, 0], *np.zeros((54, 3))]]), np.array([[0, 0, 4.0]]), np.zeros(4),
                                  np.zeros((1, body.exprdirs.shape[2])), 300.0, (110.0, 110.0))
    poses, camera = Poses(body, params), params.camera(220, 220)
    mask = np.uint8(255 * (rasterise(poses.vertices(0), body.faces, camera)[0] >= 0))
    return Gaussians.area(body.v_template, body.faces, 6000), poses, [View(camera, np.dstack([mask] * 4), (0, 0))]


def test_a_floater_is_stray_and_a_missing_limb_a_hole_in_the_true_outline(standing):
    gaussians, poses, views = standing
    body = poses.body
    clean = novel_poses.judge_outline(gaussians, poses, views)
    assert clean["stray"] < 0.06 and clean["holes"] < 0.03
    places = body.v_template[body.faces[gaussians.face, 0]]
    bald = novel_poses.judge_outline(gaussians[places[:, 1] < np.quantile(places[:, 1], 0.9)], poses, views)
    assert bald["holes"] > clean["holes"] + 0.03 and bald["stray"] < clean["stray"]
    gaussians.mu[0, 1] -= 0.5 / face_frames(body.v_template, body.faces).k[gaussians.face[0]]
    gaussians.log_scale[0] += 2
    assert novel_poses.judge_outline(gaussians, poses, views)["stray"] > clean["stray"] + 0.001


def test_an_avatar_that_is_wider_than_its_mask_errs_more_about_the_outline_and_strays_farther(standing):
    gaussians, poses, views = standing
    shown = dict(enumerate(views))
    clean = as_filmed.judge_edge(gaussians, poses, shown)
    gaussians.log_scale += 0.7
    wide = as_filmed.judge_edge(gaussians, poses, shown)
    assert wide["stray_edge"] > 2 * clean["stray_edge"] and wide["edge_error"] > clean["edge_error"]


def test_a_true_mask_is_the_alpha_of_its_frame_and_one_that_is_not_there_is_named(tmp_path):
    write_frame(tmp_path / "frame.png", np.full((8, 6, 3), 100, np.uint8))
    mask = np.zeros((8, 6), np.uint8)
    mask[2:6], mask[6] = 255, 128
    write_image(tmp_path / "mask.png", mask)
    params = BodyParams.from_pose(*(np.zeros(shape) for shape in ((1, 55, 3), (1, 3), 10, (1, 52))), 10, (3, 4))
    pixels = novel_poses.read_view(tmp_path / "frame.png", tmp_path / "mask.png", params).pixels
    assert (pixels[..., 3] == mask).all() and (pixels[3, :, :3] == 100).all() and (pixels[6, :, :3] == 50).all()
    with pytest.raises(FileNotFoundError, match="other.png: there is no such mask"):
        novel_poses.read_view(tmp_path / "frame.png", tmp_path / "other.png", params)


def test_a_folder_that_is_no_run_is_refused_by_name(tmp_path):
    with pytest.raises(BadInput, match="there is no split/frames"):
        training.read_run(tmp_path)


def test_every_benchmark_is_found_by_its_name():
    assert {"fit", "size", "speed-accuracy"} <= set(names())

"""The faults of the stability benchmark, what counts as said, and what a trial's end is."""

import csv
import time
from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.artifacts import KEYPOINT_SHAPES, Clip, frame_paths
from gsac.avatar.frame_files import read_frame
from gsac.benchmarks.fit.truth import Truth
from gsac.benchmarks.stability import bench, chart, outcome, pairs, stages, table, trial, workers
from gsac.benchmarks.stability.code import hash_code
from gsac.benchmarks.stability.fault import Origin
from gsac.benchmarks.stability.faults import FAULTS, QUICK
from gsac.benchmarks.stability.footage import Film
from gsac.benchmarks.stability.take import Take
from gsac.benchmarks.stability.trial import CLEAN, DEFAULT, PAPER, End, Task, Trial
from gsac.cache.code import code_parts
from gsac.pipeline.clip_check import ClipCheck
from gsac.pipeline.journal import plain_journal
from gsac.stages.contract import BadInput, StageError
from gsac.turntable.options import TurntableOptions

FRAMES, HEIGHT, WIDTH = 20, 64, 36


def make_take():
    """A bright figure before a grey wall, which turns once."""
    rng = np.random.default_rng(1)
    masks = np.zeros((FRAMES, HEIGHT, WIDTH), bool)
    for t, mask in enumerate(masks):
        mask[8:56, 10 + t % 4:24] = True
    frames = rng.integers(90, 110, (FRAMES, HEIGHT, WIDTH, 3)).astype(np.uint8)
    frames[masks] = rng.integers(150, 220, (masks.sum(), 3))
    points = np.tile([18.0, 30.0], (FRAMES, 23, 1))
    truth = Truth(np.arange(22), rng.normal(size=(FRAMES, 22, 3)), None, points, 67.0, (18.0, 32.0), masks[:, :1, :1])
    yaw = np.linspace(0, 2 * np.pi, FRAMES, endpoint=False)
    return Take(frames, masks, points, np.arange(FRAMES) / 10, yaw, np.arange(FRAMES), np.ones(FRAMES, bool),
                np.tile(np.eye(3), (FRAMES, 1, 1)), truth)


def make_clean(origin):
    """What faults of an origin change, without a fault."""
    rng = np.random.default_rng(2)
    if origin is Origin.TAKE:
        return make_take()
    if origin is Origin.FILM:
        return Film(make_take())
    if origin is Origin.ALPHA:
        return make_take().masks.astype(np.float32)
    if origin is Origin.POINTS:
        return {name: rng.uniform(0.1, 0.9, [FRAMES if s == "T" else s for s in shape]).astype(np.float32)
                for name, shape in KEYPOINT_SHAPES.items()}
    if origin is Origin.BODY:
        return {"body_pose": np.zeros((FRAMES, 63), np.float32), "transl": np.zeros((FRAMES, 3), np.float32)}
    return {"seed": 7}


def same(a, b):
    if a is None or b is None:
        return a is b
    if isinstance(a, Film):
        return same(a.take, b.take) and replace(a, take=None) == replace(b, take=None)
    if isinstance(a, Take):
        return all(same(getattr(a, name), getattr(b, name)) for name in ("frames", "times", "asked", "number", "rotation", "focal"))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[name], b[name]) for name in a)
    return np.array_equal(np.asarray(a), np.asarray(b), equal_nan=np.asarray(a).dtype.kind == "f")


@pytest.mark.parametrize("fault", FAULTS.values(), ids=list(FAULTS))
def test_severity_0_is_the_clean_clip_and_the_same_seed_gives_the_same_fault(fault):
    clean, untouched = make_clean(fault.origin), make_clean(fault.origin)
    assert same(fault.inject(clean, 0, 3)[0], clean)
    for severity in (1, 3, 5):
        once, touched = fault.inject(clean, severity, 3)
        assert same(clean, untouched), "the clean clip itself was changed"
        assert same(once, fault.inject(clean, severity, 3)[0])
        assert not same(once, clean)
        assert touched.dtype == bool and (fault.origin is Origin.PERSON or touched.any())
        if isinstance(once, Take):
            assert len(once.frames) == len(once.number) == len(once.asked) == len(once.times) == len(touched)
            assert once.frames.dtype == np.uint8 and once.frames.shape[1:] == clean.frames.shape[1:]


def test_the_film_of_severity_0_is_the_clean_film_byte_for_byte(tmp_path):
    take = make_take()
    Film(take).write(tmp_path / "a.mp4")
    Film(FAULTS["blur"].inject(take, 0, 1)[0]).write(tmp_path / "b.mp4")
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_a_severity_beyond_5_is_refused():
    with pytest.raises(ValueError, match="expected 0 to 5"):
        FAULTS["blur"].inject(make_take(), 6, 0)


def test_nothing_is_asked_of_pictures_that_show_another_time_or_nobody():
    for name in ("frozen", "mirrored", "black-frames", "no-person"):
        changed, touched = FAULTS[name].inject(make_take(), 3, 0)
        assert not changed.asked[touched].any() and changed.asked[~touched].all()


def test_pictures_without_the_person_show_nothing_of_the_person_even_where_no_picture_shows_the_scene():
    take = make_take()
    assert take.masks.all(0).any()
    changed, touched = FAULTS["no-person"].inject(take, 3, 0)
    assert changed.frames[touched].max() < 120 and not changed.masks[touched].any()


def test_a_picture_out_of_order_keeps_its_own_truth():
    changed, touched = FAULTS["out-of-order"].inject(make_take(), 3, 0)
    clean = make_take()
    assert np.array_equal(changed.frames, clean.frames[changed.number]) and np.array_equal(changed.times, clean.times)
    assert touched.sum() == 10


def test_the_truth_rolls_with_the_camera():
    changed, _ = FAULTS["roll"].inject(make_take(), 5, 0)
    assert np.allclose(changed.rotation[0] @ [1, 2, 3], [-1, -2, 3])
    quarter, _ = FAULTS["roll"].inject(make_take(), 4, 0)
    corner = np.zeros((HEIGHT, WIDTH), bool)
    corner[31, 35] = True  # a point at the right edge
    turned, _ = FAULTS["roll"].inject(replace(make_take(), masks=np.tile(corner, (FRAMES, 1, 1))), 4, 0)
    row = np.argwhere(turned.masks[0]).mean(0)[0]
    assert turned.size == (WIDTH, HEIGHT)
    assert np.sign(row - WIDTH / 2) == np.sign((quarter.rotation[0] @ [1, 0, 0])[1])


def test_a_take_turned_by_quarters_shows_its_points_where_they_are_and_comes_back():
    take = make_take()
    mask = np.zeros((FRAMES, HEIGHT, WIDTH), bool)
    mask[:, 9, 4] = True
    take = replace(take, masks=mask, points=np.tile([4.5, 9.5], (FRAMES, 23, 1)))
    turned = take
    for _ in range(3):
        turned = turned.turned(1)
        y, x = np.argwhere(turned.masks[0])[0]
        assert np.allclose(turned.points[0, 0], (x + 0.5, y + 0.5))
    assert np.array_equal(turned.masks, take.turned(3).masks) and np.allclose(turned.points, take.turned(3).points)
    back = turned.turned(1)
    assert np.array_equal(back.masks, mask) and np.allclose(back.points, take.points) and np.allclose(back.rotation, take.rotation)


@pytest.mark.parametrize("name", ["head-cut", "feet-cut", "leaves"])
def test_a_camera_aimed_elsewhere_takes_the_truth_with_it(name):
    clean = make_take()
    true = np.array([[-0.2, -0.6, 3.0], [0.1, 0.5, 2.5]])
    project = lambda x: (x @ clean.camera.T)[..., :2] / (x @ clean.camera.T)[..., 2:]  # noqa: E731
    clean = replace(clean, points=np.tile(project(true), (FRAMES, 1, 1)))
    changed, _ = FAULTS[name].inject(clean, 3, 0)
    assert np.abs(changed.points - clean.points).max() > 3, "px"
    assert np.allclose(changed.points, project(np.einsum("tab,pb->tpa", changed.rotation, true)), atol=1e-3)


@pytest.mark.parametrize("name", ["rotation-tag", "uneven-rate", "long-clip", "ten-bit"])
def test_a_film_gives_upright_pictures_at_the_times_of_the_take(tmp_path, name):
    take = make_take()
    film, _ = FAULTS[name].inject(Film(take), 1, 0)
    film.write(tmp_path / "clip.mp4")
    stages.run_stage("split", {"count": 400, "crop": False}, {"clip": tmp_path / "clip.mp4"}, tmp_path / "split")
    number = film.number(np.array(Clip.read(tmp_path / "split" / "clip.json").timestamps_s))
    seen = [read_frame(path).astype(int) for path in frame_paths(tmp_path / "split" / "frames")]
    assert len(seen) == {"rotation-tag": FRAMES, "uneven-rate": FRAMES - 2, "long-clip": 100, "ten-bit": FRAMES}[name]
    grey = [np.mean(pictures, axis=-1)[take.masks[number]] for pictures in (seen, take.frames[number])]
    assert np.corrcoef(grey)[0, 1] > 0.7, "the same pictures, upright"
    assert number[0] == 0 and (np.diff(number) != 0).all()


@pytest.mark.parametrize("severity", range(1, 6))
def test_a_person_who_behaves_otherwise_is_one_that_the_turntable_can_render(severity):
    people = [fault for fault in FAULTS.values() if fault.origin is Origin.PERSON]
    for fault in people:
        TurntableOptions(**fault.inject({"seed": 7}, severity, 0)[0]).check()
    assert len(people) > 10


def test_a_person_who_behaves_otherwise_is_rendered_at_the_size_and_times_of_the_trial(tmp_path, monkeypatch):
    asked = {}
    monkeypatch.setattr(trial, "read_take", lambda *_: make_take())
    monkeypatch.setattr(trial, "render_clip", lambda folder, say, **options: asked.update(options) or folder)
    trial.render_person(replace(make_task(tmp_path / "seed7_60", "hoodie"), frames=FRAMES, height=HEIGHT), FAULTS["hoodie"])
    assert (asked["seed"], asked["top"], asked["frames"], asked["height"]) == (7, "hoodie", FRAMES, HEIGHT)
    assert asked["fps"] == pytest.approx(10), "as many frames a second as the clean take has"


@pytest.mark.parametrize("name", ["points-missing", "masks-missing"])
def test_at_severity_5_nothing_is_left_of_a_missing_artifact(name):
    changed, touched = FAULTS[name].inject(make_clean(FAULTS[name].origin), 5, 0)
    assert not len(changed["xy"] if name == "points-missing" else changed) and touched.sum() == FRAMES


def finding(code, frames, severity="poorer"):
    return {"code": code, "severity": severity, "frames": frames, "figure": None, "message": code}


def one(fault=CLEAN, severity=0, method=DEFAULT, mm=15.0, **more):
    return Trial("a", fault, severity, 0, method, mean_mm=mm, still_mm=215.0, **more)


def test_quality_is_1_for_the_clean_clip_and_0_for_a_body_that_stands_still():
    assert outcome.retain(one(), one()) == 1
    assert outcome.retain(one("pole", 3, mm=115.0), one()) == pytest.approx(0.5)
    assert outcome.retain(one("pole", 3, mm=400.0), one()) == 0
    assert outcome.retain(one("pole", 3, end=End.REFUSED), one()) == 0
    trained, best = one("pole", 3, psnr=16.0, flat_psnr=11.0), one(psnr=22.0, flat_psnr=10.0)
    assert outcome.retain(trained, best) == pytest.approx(0.5), "held-out dB where both were trained"


def test_a_failure_is_silent_unless_something_names_the_frames_that_went_wrong():
    off = {"left_wrist": [4, 5, 6, 7, 8]}
    def silent(*found, clean=(), **more):
        return outcome.find_outcome(one("pole", 3, off=off, findings=list(found), **more), one(findings=list(clean))).silent

    assert silent()
    assert silent(finding("not_fitted", [1, 2])), "it names other frames"
    assert not silent(finding("not_fitted", [8, 9]))
    assert not silent(finding("cut_off", [])), "it is of the whole clip"
    assert silent(finding("cut_off", []), clean=[finding("cut_off", [])]), "the clean clip says so as well"
    assert silent(finding("no_lpips", [], "news"))
    assert not silent(end=End.REFUSED), "a refusal is a sentence"


def test_a_joint_that_is_off_in_fewer_than_five_frames_or_in_the_clean_clip_too_is_no_failure():
    assert not outcome.find_outcome(one("pole", 3, off={"left_wrist": [4, 5, 6, 7]}), one()).failed
    five = {"left_wrist": [4, 5, 6, 7, 8]}
    assert not outcome.find_outcome(one("pole", 3, off=five), one(off={"left_wrist": [8]})).failed
    assert outcome.find_outcome(one("pole", 3, off=five), one(off={"right_wrist": [8]})).failed


def test_the_check_agrees_where_it_and_the_run_find_something_or_neither_does():
    def foretold(checked, mm=15.0, **more):
        return outcome.find_outcome(one("pole", 3, mm=mm, checked=checked, **more), one(checked=["far_away"])).foretold

    assert foretold(["far_away"]) and not foretold(["cut_off"])
    assert foretold(["cut_off"], mm=115.0) and not foretold(["far_away"], mm=115.0)
    assert foretold([End.REFUSED.value], end=End.REFUSED)
    assert foretold(None) is None and foretold(["cut_off"], end=End.CRASHED) is None


def test_the_check_looks_as_far_as_the_body_and_no_farther_than_there_is_hope(tmp_path, monkeypatch):
    ran = []

    def run(name, values, ports, folder):
        ran.append(name)
        if name in fails:
            raise StageError("no")
        return [finding(code, [], severity) for stage, code, severity in found if stage == name]

    monkeypatch.setattr(trial, "run_stage", run)
    monkeypatch.setattr(trial, "check_clip", lambda clip, points, said: ClipCheck(None, None, said))
    ports = dict.fromkeys(("split/clip.json", "keypoints/keypoints.npz"), tmp_path)
    fails, found = [], [("keypoints", "repeated", "news"), ("smplx", "arm_doubtful", "poorer")]
    assert trial._check(ports, [finding("blurred", [1])], tmp_path) == ["arm_doubtful", "blurred"]
    assert ran[-1] == "smplx" and "train" not in ran
    fails, found = ["segment"], [("keypoints", "hardly_any_person", "hopeless")]
    assert trial._check(ports, [], tmp_path) == ["hardly_any_person"]
    found = []
    assert trial._check(ports, [], tmp_path) == [End.REFUSED.value]


TRIALS = [one(), one("pole", 3, mm=115.0), one("pole", 5, end=End.CRASHED, message="ValueError"), one("blur", 3, mm=25.0),
          one(method=PAPER), one("pole", 3, PAPER, mm=215.0), one("blur", 5, PAPER, mm=35.0)]


def test_the_area_runs_straight_between_severities_and_the_breakdown_is_the_first_below_four_fifths():
    curves = {(c.fault, c.method): c for c in outcome.draw_curves(outcome.find_outcomes(TRIALS))}
    pole = curves["pole", DEFAULT]
    assert pole.severities == (0, 3, 5) and pole.retained == (1.0, 0.5, 0.0)
    assert pole.area == pytest.approx((3 * 0.75 + 2 * 0.25) / 5)
    assert (pole.breakdown, pole.crashed, pole.silent) == (3, 1, 1)
    assert curves["blur", DEFAULT].breakdown is None and curves["blur", DEFAULT].errors == (1.0, pytest.approx(25 / 15))
    assert curves["blur", PAPER].retained[1] == pytest.approx(0.9) and curves["blur", PAPER].breakdown == 5, "over twice the error"


def test_both_methods_are_compared_on_the_same_input_by_their_own_clean_clips_and_by_the_better_one():
    trials = [one(mm=15.0), one(method=PAPER, mm=65.0), one("pole", 3, mm=65.0), one("pole", 3, PAPER, mm=65.0),
              one("blur", 3, mm=15.0)]
    pair, = pairs.find_pairs(trials)
    assert (pair.fault, pair.by_own, pair.by_one) == ("pole", pytest.approx(-0.25), pytest.approx(0.0))
    own, shared = pairs.describe_pairs([pair])
    assert "behind by over 0.02 in 1" in own and "behind by over 0.02 in 0" in shared
    assert pairs.find_pairs(trials[1:]) == [] and pairs.describe_pairs([]) == []


def test_table_csv_and_chart_hold_every_fault(tmp_path):
    outcomes = outcome.find_outcomes(TRIALS)
    curves = outcome.draw_curves(outcomes)
    words = table.text(curves, ["default less paper"])
    assert words.splitlines()[2].startswith("pole   paper") and words.splitlines()[-1] == "default less paper"
    assert "| pole | 0.55 | 3 | 1 of 2 | 0.30 | 3 | 1 of 1 |" in table.markdown(curves).splitlines()
    table.write_csv(outcomes, tmp_path / "stability.csv")
    rows = list(csv.DictReader((tmp_path / "stability.csv").read_text().splitlines()))
    assert [(r["fault"], r["severity"], r["silent"]) for r in rows][:2] == [("pole", "3", "1"), ("pole", "5", "0")]
    paths = chart.draw(curves, tmp_path)
    assert paths[0].read_bytes()[:4] == b"\x89PNG"


def test_finished_trials_are_read_back_and_a_torn_last_line_is_left_out(tmp_path):
    lines = tmp_path / "trials.jsonl"
    for each in TRIALS:
        table.add_line(each, lines)
    lines.write_text(lines.read_text() + '{"clip": "a"')
    assert table.read_lines(lines) == TRIALS


def make_task(tmp_path, fault=CLEAN):
    return Task(tmp_path, fault, 3 if fault != CLEAN else 0, 0, DEFAULT, tmp_path / "out", FRAMES, HEIGHT)


@pytest.mark.parametrize(("error", "end"), [(StageError("no"), End.REFUSED), (KeyError("no"), End.CRASHED)])
def test_a_sentence_is_a_refusal_and_anything_else_a_crash(tmp_path, monkeypatch, error, end):
    def fail(*_):
        raise error

    monkeypatch.setattr(trial, "read_take", lambda *_: make_take())
    monkeypatch.setattr(trial, "run_stage", fail)
    assert trial.run_trial(make_task(tmp_path)).end is end


def test_a_worker_that_hangs_or_dies_costs_its_trial_only(tmp_path, monkeypatch):
    task = make_task(tmp_path)  # no truth clip is there
    worker = workers.Worker([0])
    try:
        assert worker.run(task, 0.0).end is End.HUNG
        assert worker.run(task, 60).end is End.CRASHED
    finally:
        worker.close()


def test_default_methods_come_first_and_every_fault_is_tried(tmp_path):
    clip = tmp_path / "seed1"
    options = bench.parser().parse_args(["--clip", str(clip), "--seeds", "0", "--severities", "3", "--out", str(tmp_path)])
    tasks = bench.list_tasks(options, None)
    assert [t.method for t in tasks] == sorted(t.method for t in tasks)
    assert {t.fault for t in tasks} == {CLEAN, *(f.name for f in FAULTS.values() if f.origin is not Origin.BODY)}
    assert {FAULTS[name].origin for name in QUICK} >= {Origin.TAKE, Origin.POINTS, Origin.ALPHA}


def test_a_clip_whose_name_tells_no_seed_is_spared_the_faults_that_need_it_and_they_are_named(tmp_path, capsys):
    options = bench.parser().parse_args(["--clip", str(tmp_path / "ada"), "--clip", str(tmp_path / "seed4_60"), "--seeds", "0", "1",
                                         "--severities", "3", "--methods", DEFAULT, "--out", str(tmp_path)])
    tasks = bench.list_tasks(options, plain_journal())
    anew = {f.name for f in FAULTS.values() if f.origin is Origin.PERSON}
    tried = {clip: {t.fault for t in tasks if t.clip.name == clip} for clip in ("ada", "seed4_60")}
    assert tried["seed4_60"] - tried["ada"] == anew and "blur" in tried["ada"]
    said = " ".join(capsys.readouterr().err.split())
    assert f"{tmp_path / 'ada'}:" in said and "hoodie" in said and "only a folder named seedN tells it" in said


def test_a_fault_that_needs_the_seed_is_refused_before_anything_runs_where_the_name_tells_none(tmp_path):
    with pytest.raises(BadInput, match="ada: no clip for hoodie: .* only a folder named seedN tells it"):
        bench.main(["--clip", str(tmp_path / "ada"), "--fault", "blur", "hoodie", "--out", str(tmp_path / "out")])
    assert not (tmp_path / "out" / "trials.jsonl").exists()


def test_trials_of_other_settings_are_not_mixed(tmp_path):
    def options(*more):
        return bench.parser().parse_args(["--out", str(tmp_path), *more])

    bench.keep_settings(options())
    bench.keep_settings(options("--seeds", "1"))
    with pytest.raises(BadInput, match="give another --out"):
        bench.keep_settings(options("--frames", "60"))
    with pytest.raises(BadInput, match="give another --out"):
        bench.keep_settings(options("--kept", "10"))


def test_trials_of_other_code_do_not_count_and_run_again(tmp_path, capsys):
    lines = tmp_path / "trials.jsonl"
    options = bench.parser().parse_args(["--clip", str(tmp_path), "--fault", "blur", "--seeds", "0", "--severities", "3",
                                         "--methods", DEFAULT, "--out", str(tmp_path)])
    say = plain_journal()
    clean, blurred = bench.list_open(options, lines, say)
    table.add_line(Trial.of(clean), lines)
    table.add_line(replace(Trial.of(blurred), code="0" * 12), lines)
    assert bench.list_open(options, lines, say) == [blurred]
    assert "holds 1 trials of other code" in capsys.readouterr().err
    assert blurred.code in blurred.folder.parts, "what stages made by other code is not taken up either"


def test_the_digest_covers_what_makes_results_and_nothing_else():
    parts = code_parts("gsac.benchmarks.stability.trial", ("gsac.stages.smplx.stage",))
    assert {"gsac.benchmarks.stability.trial", "gsac.stages.smplx.stage", "gsac.avatar.body"} < parts.keys()
    assert hash_code("gsac.benchmarks.stability.trial") != hash_code("gsac.turntable.clip")


def test_a_dry_run_says_what_a_sweep_takes_and_runs_nothing(tmp_path, capsys):
    assert bench.main(["--clip", str(tmp_path), "--fault", "blur", "pole", "--seeds", "0", "--dry-run", "--frames", "20",
                       "--out", str(tmp_path / "out")]) == 0
    assert "22 trials, about 7 CPU minutes" in capsys.readouterr().err
    assert not (tmp_path / "out" / "trials.jsonl").exists()


def test_seed_k_is_the_kth_person(tmp_path):
    clips = [tmp_path / name for name in ("seed1", "seed2", "seed3")]
    options = bench.parser().parse_args([part for clip in clips for part in ("--clip", str(clip))] + ["--out", str(tmp_path)])
    assert {(t.seed, t.clip.name) for t in bench.list_tasks(options, None)} == {(0, "seed1"), (1, "seed2"), (2, "seed3")}


def test_an_early_end_of_the_sweep_has_all_persons_at_severity_3(tmp_path):
    options = bench.parser().parse_args(["--clip", str(tmp_path), "--fault", "blur", "--methods", DEFAULT, "--out", str(tmp_path)])
    assert [(t.severity, t.seed) for t in bench.list_tasks(options, None)][1:5] == [(3, 0), (3, 1), (3, 2), (5, 0)]


@pytest.mark.slow
def test_quick_runs_a_few_faults_of_every_origin_without_a_crash(tmp_path, capsys):
    began = time.process_time()
    assert bench.main(["--quick", "--out", str(tmp_path)]) == 0
    found = table.read_lines(tmp_path / "trials.jsonl")
    assert {t.fault for t in found} == {CLEAN, *QUICK}
    assert not [t for t in found if t.end in (End.CRASHED, End.HUNG)], [t.message for t in found]
    assert "default: area under the curve" in capsys.readouterr().out
    assert time.process_time() - began < 60

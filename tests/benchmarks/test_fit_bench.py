"""The fit benchmark's table, chart and windows, on made-up trials."""

import csv

import numpy as np
import pytest

from gsac.avatar.wholebody import ARM, HANDS
from gsac.benchmarks.fit import bench, chart, hidden_wrist, table
from gsac.benchmarks.fit.clips import prepare_case
from gsac.benchmarks.fit.trial import FitTrial
from gsac.stages.contract import BadInput
from gsac.stages.handgap.fill import METHODS


def trial(clip, method, given, seconds, mm):
    scores = {"joints_median_mm": mm * 0.8, "joints_mean_mm": mm, "iou_mean": 0.9, "iou_worst": 0.8, "reprojection_px": 5.0,
              "focal_error": 0.0 if given else 0.04}
    return FitTrial(clip, method, given, seconds, seconds * 2, scores)


TRIALS = [trial("a", "lm", True, 4.0, 20.0), trial("a", "paper", True, 40.0, 30.0),
          trial("b", "lm", True, 6.0, 30.0), trial("b", "paper", True, 80.0, 50.0)]


def test_the_table_has_a_row_a_trial_the_mean_of_each_method_and_the_bar():
    rows = table.rows(TRIALS)
    both = [[clip, "given", method] for clip in ("a", "b", "all clips") for method in ("lm", "paper")]
    assert [row[:3] for row in rows[1:]] == [*both, ["bar", "given", "lm"]]
    column = rows[0].index("mean mm")
    assert [row[column] for row in rows[5:]] == ["25.0", "40.0", "30.0"]
    assert rows[5][rows[0].index("vertices mm")] == "-"
    lines = table.text(TRIALS).splitlines()
    assert len({len(line) for line in lines}) == 1


def test_one_clip_needs_no_mean_row():
    assert len(table.rows(TRIALS[:2])) == 1 + 2 + 1


def test_the_gain_is_said_in_wall_and_cpu_time():
    assert table.compare_speed(TRIALS) == ["focal given: lm is 12.0x faster than paper by the clock and 12.0x by CPU time, "
                                    "at 0.62 of its mean joint error"]
    assert table.compare_speed(TRIALS[:1]) == []


def test_the_csv_holds_every_score_unrounded(tmp_path):
    table.write_csv(TRIALS, tmp_path / "fit.csv")
    rows = list(csv.DictReader((tmp_path / "fit.csv").read_text().splitlines()))
    assert [(r["clip"], r["method"]) for r in rows] == [("a", "lm"), ("a", "paper"), ("b", "lm"), ("b", "paper")]
    assert float(rows[1]["joints_mean_mm"]) == 30 and float(rows[1]["cpu_s"]) == 80


def test_the_chart_is_written_as_picture_and_as_vectors(tmp_path):
    gap = {"place": "inside", "lost": "arm"}
    filled = [gap | {"gap": n, "method": m, "mean_px": n + i} for i, m in enumerate(METHODS) for n in (2, 8)]
    paths = chart.draw(TRIALS, filled, tmp_path)
    assert [p.name for p in paths] == ["fit.png", "fit.svg"]
    assert paths[0].read_bytes()[:4] == b"\x89PNG" and "<svg" in paths[1].read_text()[:600]


def test_a_folder_that_is_no_truth_clip_is_refused_by_name(tmp_path):
    with pytest.raises(BadInput, match="expected a truth clip"):
        prepare_case(tmp_path, None, tmp_path / "out", None)


def test_clips_that_measured_the_detector_are_not_what_is_reported():
    options = bench.parser().parse_args([])
    assert not {*options.seeds, *options.bare_seeds} & {11, 12, 41, 42, 43, 44}


def test_a_bare_clip_is_rendered_without_clothes(tmp_path, monkeypatch):
    from gsac.benchmarks.fit import clips
    from gsac.turntable import clip

    asked = []
    monkeypatch.setattr(clip, "make_clip", lambda folder, **options: asked.append((folder.name, options["clothing"])))
    clips.render_seed(tmp_path / "seed5", 5, None)
    clips.render_seed(tmp_path / "bare5", 5, None, clothing=0.0)
    assert asked == [("seed5", 1.0), ("bare5", 0.0)]


def test_windows_of_one_hand_are_apart_and_as_long_as_they_say():
    for frames in (60, 40, 24):
        found = list(hidden_wrist.list_windows(frames))
        assert found and all(last <= frames - hidden_wrist.MARGIN for *_, last in found)
        for side in HANDS:
            ends = [0, *(t for s, *span in found if s == side for t in span)]
            assert np.diff(ends)[::2].min() >= hidden_wrist.MARGIN
    lengths = sorted(last - first for side, first, last in hidden_wrist.list_windows(60) if side == "left")
    assert lengths == sorted(hidden_wrist.GAPS["left"])


def test_masking_hides_arm_and_hand_there_and_nothing_else():
    seen = {"xy": np.ones((60, 133, 2)), "score": np.ones((60, 133)), "world": np.ones((60, 133, 3))}
    masked = hidden_wrist.mask_windows(seen)
    hide = np.zeros((60, 133), bool)
    for side, first, last in hidden_wrist.list_windows(60):
        hide[first:last, [*range(133)[HANDS[side]], *ARM[side][1:3]]] = True
    assert np.array_equal(masked["score"] == 0, hide) and np.array_equal(np.isnan(masked["world"]).all(-1), hide)
    assert seen["score"].all()


def test_the_hidden_wrists_table_has_a_line_for_each_gap_and_one_for_all():
    found = [hidden_wrist.Hidden("a", "left", 3, np.full(4, 10.0)), hidden_wrist.Hidden("a", "right", 9, np.full(8, 40.0))]
    lines = hidden_wrist.text(found).splitlines()
    assert [line.split()[0] for line in lines[2:]] == ["4", "8", "all", "bar"]
    assert lines[4].split()[1:] == ["2", "40.0", "30.0", "40.0"]

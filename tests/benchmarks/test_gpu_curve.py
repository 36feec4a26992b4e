"""The GPU's curve: from metrics to the chart's file and back, and drawn beside the CPU's."""

import pytest

from gsac.benchmarks.gpu import curve
from gsac.benchmarks.speed_accuracy import chart
from gsac.stages.contract import BadInput


def metrics(recipe, ends, steps=100):
    """ends: (gpu seconds, dB) of the checkpoints."""
    rows = [{"gpu_seconds": s, "seconds": 2 * s, "psnr_fg": q, "n_gaussians": 50} for s, q in ends]
    rows.insert(0, {"step": 1, "loss": 1.0})
    return {"recipe": recipe, "steps": steps, "seed": 0, "psnr_fg_ttpo": 30.0, "curve": rows} | rows[-1]


def test_checkpoints_come_back_from_the_file_as_they_were_written(tmp_path):
    ends = [(0.1, 20.0), (0.2, 22.5)]
    rows = curve.list_rows("a", "cuda", metrics("fast", ends)) + curve.list_rows("a", curve.TORCH, metrics("fast", ends[:1]))
    curve.write(rows, tmp_path / "curve.csv")
    ours, torch = curve.read(tmp_path / "curve.csv")
    assert (ours.clip, ours.recipe, ours.device, ours.steps, ours.n_gaussians) == ("a", "fast", "cuda", 100, 50)
    assert ours.points == [*ends, ends[-1]] and torch.device == curve.TORCH and torch.points == [ends[0]] * 2


def test_a_file_that_is_no_curve_is_refused_by_the_column_that_it_lacks(tmp_path):
    (tmp_path / "curve.csv").write_text("clip,recipe\na,fast\n")
    with pytest.raises(BadInput, match="curve.csv.*device.*gpu_seconds"):
        curve.read(tmp_path / "curve.csv")
    (tmp_path / "curve.csv").write_text("")
    with pytest.raises(BadInput, match="no row"):
        curve.read(tmp_path / "curve.csv")


def test_the_summary_says_when_fast_is_first_as_good_as_paper():
    fast, paper = metrics("fast", [(0.1, 20.0), (0.2, 22.0), (0.3, 23.0)]), metrics("paper", [(3.0, 21.0)])
    found = curve.summarise("a", {("fast", 100): fast, ("paper", 100): paper})
    assert found["paper_psnr_fg"] == 21.0 and found["fast_reaches_it_gpu_seconds"] == 0.2
    assert "21.00 dB after 0.200 s on the GPU, 0.40 in all" in curve.describe(found)[-1]
    found = curve.summarise("a", {("fast", 100): fast, ("paper", 100): metrics("paper", [(3.0, 25.0)])})
    assert found["fast_reaches_it_gpu_seconds"] is None and "never" in curve.describe(found)[-1]


def test_the_chart_draws_gpu_curves_of_clips_that_the_cpu_did_not_train(tmp_path):
    lines = [curve.Curve("a", "fast", "cuda", 100, 50, [(0.1, 20.0), (0.2, 22.5)]),
             curve.Curve("a", "paper", curve.TORCH, 100, 50, [(9.0, 21.0)])]
    assert all(path.stat().st_size > 1000 for path in chart.draw([], tmp_path, lines))
    words = (tmp_path / "speed_accuracy.svg").read_text()
    assert "fast, 100 steps, GPU" in words and "paper, 100 steps, torch + gsplat" in words

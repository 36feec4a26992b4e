"""The GPU's curve: from metrics to its file, and its summary."""

import csv

from gsac.benchmarks.gpu import curve


def metrics(recipe, ends, steps=100):
    """ends: (gpu seconds, dB) of the checkpoints."""
    rows = [{"gpu_seconds": s, "seconds": 2 * s, "psnr_fg": q, "n_gaussians": 50} for s, q in ends]
    rows.insert(0, {"step": 1, "loss": 1.0})
    return {"recipe": recipe, "steps": steps, "seed": 0, "psnr_fg_ttpo": 30.0, "curve": rows} | rows[-1]


def test_the_file_has_a_row_for_each_judged_checkpoint_and_the_end(tmp_path):
    curve.write(curve.list_rows("a", curve.TORCH, metrics("fast", [(0.1, 20.0), (0.2, 22.5)])), tmp_path / "curve.csv")
    head, *rows = csv.reader((tmp_path / "curve.csv").read_text().splitlines())
    assert tuple(head) == curve.COLUMNS and [(row[2], float(row[-1])) for row in rows] == [
        (curve.TORCH, 20.0), (curve.TORCH, 22.5), (curve.TORCH, 22.5)]


def test_the_summary_says_when_fast_is_first_as_good_as_paper():
    fast, paper = metrics("fast", [(0.1, 20.0), (0.2, 22.0), (0.3, 23.0)]), metrics("paper", [(3.0, 21.0)])
    found = curve.summarise("a", {("fast", 100): fast, ("paper", 100): paper})
    assert found["paper_psnr_fg"] == 21.0 and found["fast_reaches_it_gpu_seconds"] == 0.2
    assert "21.00 dB after 0.200 s on the GPU, 0.40 in all" in curve.describe(found)[-1]
    found = curve.summarise("a", {("fast", 100): fast, ("paper", 100): metrics("paper", [(3.0, 25.0)])})
    assert found["fast_reaches_it_gpu_seconds"] is None and "never" in curve.describe(found)[-1]


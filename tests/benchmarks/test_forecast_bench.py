"""`gsac bench forecast`: told beside taken, and coefficients that fit."""

import json
import struct

import numpy as np
import pytest

from gsac.benchmarks.forecast import bench
from gsac.pipeline.cost_model import MODELS
from gsac.stages.contract import BadInput


def finished_run(folder, frames, times, waiting=0.6):
    """A run's folder as `gsac run` leaves it, whose split took so many times what is told."""
    (folder / "split" / "frames").mkdir(parents=True)
    for i in range(frames):
        (folder / "split" / "frames" / f"{i:06d}.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">2I", 720, 1280))
    (folder / "split" / "clip.json").write_text(json.dumps({"width": 720, "height": 1280, "timestamps_s": [0.0] * frames}))
    took = times * float(np.dot(MODELS["split", "cpu"].coefficients, (1, frames * 0.9216)))
    row = {"name": "split", "params": {}, "cpu_seconds": took, "seconds": waiting * took}
    (folder / "run.json").write_text(json.dumps({"stages": [row, row | {"name": "gone"}]}))
    return folder


def test_runs_are_told_beside_what_they_took_and_fitted(tmp_path, capsys):
    bench.main([str(finished_run(tmp_path / f"run{frames}", frames, 1.5)) for frames in (20, 60)])
    said = capsys.readouterr().out
    ratios = {cells[1].strip(): cells[4].strip() for line in said.splitlines() if len(cells := line.split("|")) == 9}
    assert ratios["run20"] == ratios["run60"] == "1.50"
    assert "| split | 1.50 to 1.50 |" in said and said.endswith("| 0.20 |\n")


def test_a_fit_finds_what_the_runs_tell_and_leaves_what_they_do_not():
    before, true = np.array([1.0, 0.1, 0.5]), np.array([2.0, 0.3, 0.2])
    terms = np.random.default_rng(0).uniform(1, 30, (12, 3))
    np.testing.assert_allclose(terms @ bench.fit(terms, terms @ true, before), terms @ true, rtol=0.03)
    terms[:, 2] = 0
    assert bench.fit(terms, terms @ true, before)[2] == pytest.approx(0.5), "no run has this term"


def test_a_folder_without_a_finished_run_is_refused(tmp_path):
    with pytest.raises(BadInput, match="no finished run; give the folder"):
        bench.main([str(tmp_path)])

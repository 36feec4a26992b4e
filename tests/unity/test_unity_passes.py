"""The benchmark of the package's passes: it runs what the C# asks for, and its table is of a frame that is right."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from gsac.benchmarks.unity.frame import index_bits, sort_steps

pytestmark = pytest.mark.slow

COUNTS = [1, 4096, 4097, 25000, 40000, 132000, 700000]


def test_the_benchmark_and_the_scripts_sort_by_the_same_dispatches(play):
    told = [line.split() for line in play("sort", *COUNTS).splitlines()]
    wanted = []
    for count in COUNTS:
        keys, steps = sort_steps(count)
        wanted.append(["keys", str(keys), str(index_bits(count))])
        wanted += [[name, *(str(parameters[f"GsacSort{word}"]) for word in ("Stage", "Shift", "Strides")), str(groups)]
                   for name, parameters, groups in steps]
    assert told == wanted


def test_the_table_times_every_pass_of_a_right_frame_and_the_picture_is_the_persons(gpu, files, figure, tmp_path):
    run = [sys.executable, "-m", "gsac.benchmarks.unity", "--software", "--avatar", files / "figure.gsac", "--size", "96",
           "--repeats", "3", "--distances", "1.5", "--people", "3", "--picture", tmp_path / "eye.png"]
    done = subprocess.run(list(map(str, run)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert "llvmpipe" in lines[0] and lines[1].endswith(" ok"), done.stdout
    rows = {line.split("  ")[0]: line.split()[-5:] for line in lines if "covered" not in line}
    for name in ("Skin", "Bind", "SortBlocks", "frame: all of them, once", "Join", "join and sort, once", "draw, 2 x 96x96, 1.5 m"):
        assert float(rows[name][1]) > 0 and float(rows[name][3]) >= 0, name
    assert f"3 people together, {3 * len(figure.gaussians)} gaussians:" in lines, "sorted, too"
    shown = np.asarray(Image.open(tmp_path / "eye-1.5m.png")).astype(int)
    red = np.argwhere((shown[..., 0] > 150) & (shown[..., 1] < 90))[:, 1]
    blue = np.argwhere((shown[..., 2] > 150) & (shown[..., 0] < 90))[:, 1]
    assert len(red) and len(blue) and red.mean() > 60 and blue.mean() < 36, "the left hand is at the right: it faces us"

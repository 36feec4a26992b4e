"""The viewer benchmark: both pages show the same view, and ratios are of medians."""

from gsac.benchmarks.viewer.avatar import make_avatar
from gsac.benchmarks.viewer.bench import pages, text
from gsac.benchmarks.viewer.frame_rate import FrameRate, cpu_seconds


def test_both_pages_look_at_the_same_point_from_the_same_distance():
    avatar = make_avatar(200)
    ours, theirs = pages(avatar).values()
    asked = [dict(part.split("=") for part in page.split("#")[1].split("&")) for page in (ours, theirs)]
    assert {k: asked[0][k] for k in ("fov", "dist", "bg")} == {k: asked[1][k] for k in ("fov", "dist", "bg")}
    target = float(asked[0]["target"].split(",")[1])
    assert abs(target - avatar.ground - float(asked[1]["height"])) < 1e-4
    assert len(avatar.gaussians) == 200 and list(avatar.clips)[0] == "walk"


def test_the_ratio_is_of_medians():
    counts = {"webgl": [FrameRate(10, .02), FrameRate(30, .04), FrameRate(12, .03)],
              "software": [FrameRate(18, .01)] * 3,
              "PlayCanvas": [FrameRate(6, .09), FrameRate(5, .06), FrameRate(7, .05)]}
    words = text(counts, 6000, 512)
    assert "6000 gaussians, 512 x 512" in words
    for name, frames, processor in (("webgl", "2.00", "2.00"), ("software", "3.00", "6.00"), ("PlayCanvas", "1.00", "1.00")):
        row = next(line for line in words.splitlines() if line.startswith(name))
        assert f" {frames} x PlayCanvas" in row and f"({processor} x)" in row


def test_processor_time_counts_a_child_that_works():
    import os
    import subprocess
    import sys
    before = cpu_seconds(os.getpid())
    child = subprocess.Popen([sys.executable, "-c", "print(sum(i * i for i in range(3000000)), flush=True); input()"],
                             stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    child.stdout.readline()
    assert cpu_seconds(os.getpid()) - before > 0.05
    child.communicate(b"\n")

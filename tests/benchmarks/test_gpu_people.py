"""The table of many people: both recipes of each, and their mean difference."""

from __future__ import annotations

from gsac.benchmarks.gpu.people import text


def test_the_mean_difference_stands_below_the_people_with_its_error():
    pairs = {"a": ({"psnr_fg": 24.0, "flip": 0.1}, {"psnr_fg": 22.0, "flip": 0.2}),
             "b": ({"psnr_fg": 25.0, "flip": 0.1}, {"psnr_fg": 24.0, "flip": 0.2})}
    head, _, first, second, last = text(pairs).splitlines()
    assert head == "| clip | held out, dB | FLIP |" and first == "| a | 24.00, 22.00 | 0.100, 0.200 |"
    assert second.startswith("| b | 25.00, 24.00")
    assert last == "| apart, mean | +1.50 +- 0.50 | -0.100 +- 0.000 |"


def test_what_one_training_lacks_is_left_out():
    pairs = {"a": ({"psnr_fg": 24.0, "psnr_novel": 15.0}, {"psnr_fg": 22.0})}
    assert text(pairs).splitlines()[0] == "| clip | held out, dB |"

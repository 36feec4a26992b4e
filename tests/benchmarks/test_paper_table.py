"""The paper's table: its figures from metrics, its rows from the settings of the hand fill."""

import pytest

from gsac.benchmarks.paper_table import table
from gsac.benchmarks.paper_table.bench import FILLS, GIVEN, parser
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project


def metrics(psnr, lpips=None):
    return {"seconds": 40.0, "n_gaussians": 12000, "psnr_full_black": psnr, "ssim_black": 0.98, "lpips_black": lpips,
            "psnr_fg": psnr - 8, "psnr_hands": None, "psnr_fg_ttpo": psnr - 7}


def test_a_cell_is_mean_and_spread_of_the_repeats_and_a_dash_where_one_was_not_measured():
    assert table.spread([metrics(30.0), metrics(32.0)], "psnr_full_black") == pytest.approx((31.0, 2**0.5))
    assert table.spread([metrics(30.0)], "psnr_full_black") == (30.0, 0.0)
    assert table.spread([metrics(30.0, 0.05), metrics(30.0)], "lpips_black") is None
    words = table.text({("a", "no fill"): [metrics(30.0), metrics(32.0)], ("a", "our fill"): [metrics(33.0)]})
    head, _, first, second = words.splitlines()
    assert [head.index(name) for name in ("time", "gaussians", "PSNR", "SSIM", "LPIPS")] == sorted(
        head.index(name) for name in ("time", "gaussians", "PSNR", "SSIM", "LPIPS"))
    assert "31.000 +- 1.414" in first and " - " in first and "33.000 +- 0.000" in second


def test_the_sheet_has_a_row_for_each_repeat(tmp_path):
    table.write_csv({("a", "no fill"): [metrics(30.0), metrics(32.0)]}, tmp_path / "t.csv")
    lines = (tmp_path / "t.csv").read_text().splitlines()
    assert len(lines) == 3 and lines[2].startswith("a,no fill,1,40.0,12000,32.0")


def test_every_way_to_fill_is_a_setting_that_the_stage_takes():
    configs = {name: resolve(Project.at_hand(), sets=settings, only="handgap")["handgap"] for name, settings in FILLS.items()}
    assert configs["detections as they are"].method == "none"
    assert (configs["paper's fill"].method, configs["paper's fill"].rule) == ("paper", "paper"), "with its own rule"
    assert configs["our fill"] == configs[GIVEN] == resolve(Project.at_hand(), only="handgap")["handgap"]
    assert parser().parse_args([]).repeats == 5

"""The paper's table: its figures from metrics, its rows from the settings of the hand fill."""

import pytest

from gsac.benchmarks.paper_table import table
from gsac.benchmarks.paper_table.bench import FILLS, GIVEN, main, parser
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.stages.contract import BadInput


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


def test_rows_that_ran_on_their_own_come_together_as_one_sheet(tmp_path):
    fills = {("b", "our fill"): [metrics(30.0)], ("a", "our fill"): [metrics(29.0), metrics(31.0, 0.05)]}
    table.write_csv(fills, tmp_path / "1.csv")
    table.write_csv({("a", GIVEN): [metrics(33.0)], ("b", "our fill"): [metrics(30.5)]}, tmp_path / "2.csv")
    assert main(["--seeds", "--beside", str(tmp_path / "1.csv"), "--beside", str(tmp_path / "2.csv"), "--out", str(tmp_path)]) == 0
    rows = table.read_csv(tmp_path / "paper_table.csv")
    assert list(rows) == [("a", GIVEN), ("a", "our fill"), ("b", "our fill")]
    assert [m["psnr_full_black"] for m in rows["a", "our fill"]] == [29.0, 31.0] and rows["a", "our fill"][0]["lpips_black"] is None
    assert rows["b", "our fill"][0]["psnr_full_black"] == 30.5, "of a row that is in two parts, that of the last"
    (tmp_path / "1.csv").write_text("clip,fill\na,our fill\n")
    with pytest.raises(BadInput, match="1.csv.*n_gaussians"):
        table.read_csv(tmp_path / "1.csv")


def test_every_way_to_fill_is_a_setting_that_the_stage_takes():
    configs = {name: resolve(Project.at_hand(), sets=settings, only="handgap")["handgap"] for name, settings in FILLS.items()}
    assert configs["detections as they are"].method == "none"
    assert (configs["paper's fill"].method, configs["paper's fill"].rule) == ("paper", "paper"), "with its own rule"
    assert configs["our fill"] == configs[GIVEN] == resolve(Project.at_hand(), only="handgap")["handgap"]
    assert parser().parse_args([]).repeats == 5

"""The table of where the Unity package was tried is made of the self-checks' files, and of nothing else."""

import json

from gsac.benchmarks.unity.checks import CHECKED, README, fill, read_reports, table


def view(name, mode="mono", decibels=41.23, drawn=.03):
    return {"view": name, "mode": mode, "decibels": decibels, "person_share": .03, "drawn_share": drawn}


def report(pipeline, *views):
    return {"report": "gsac-self-check", "unity": "6000.0", "pipeline": pipeline, "device": "Quest 3", "system": "Android",
            "gpu": "Adreno", "api": "Vulkan", "colours": "Linear", "humanoid": True, "views": list(views)}


def test_the_readmes_table_is_what_the_files_say_and_says_so_where_there_are_none():
    text = README.read_text()
    assert fill(text, read_reports(CHECKED)) == text, "out of date: python -m gsac.benchmarks.unity.checks"
    assert "Nobody has sent one yet" in fill(text, [])


def test_a_cell_is_the_worst_views_decibels_or_says_that_nobody_was_seen():
    eyes = view("left eye", "SinglePassInstanced", 39.9), view("right eye", "SinglePassInstanced", 12, drawn=0)
    reports = [report("URP", view("front"), view("turned", decibels=36.04)), report("HDRP", view("front"), *eyes)]
    device = "Quest 3, Android | Adreno, Vulkan | Linear | yes"
    assert table(reports).splitlines()[2:] == [
        f"| 6000.0 | HDRP | {device} | 41.2 dB | **nobody: right eye** (SinglePassInstanced) |",
        f"| 6000.0 | URP | {device} | 36.0 dB | not tried |"]


def test_other_reports_in_the_folder_are_passed_over(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(report("URP", view("front"))))
    (tmp_path / "b.json").write_text('{"report": "gsac-benchmark"}')
    assert [found["pipeline"] for found in read_reports(tmp_path)] == ["URP"]

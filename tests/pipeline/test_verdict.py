"""The verdict over avatars that were looked at and judged: docs/lab/verdict.json."""

import json
from pathlib import Path

import pytest

from gsac.pipeline.report.verdict import NAMES, Grade, give_verdict

ROOT = Path(__file__).resolve().parents[2]
TABLE = json.loads((ROOT / "docs/lab/verdict.json").read_text())
FITTED, UNSEEN, LARGE = ([row for row in TABLE if row["set"] == name] for name in ("fitted", "unseen", "large"))
RANK = {grade.word: grade.rank for grade in Grade}


def ranks(row):
    """Part -> its rank by the verdict and by eye; `whole` too."""
    given = give_verdict(row["metrics"], row["facts"])
    told = {"whole": given.grade} | {part: next(p.grade for p in given.parts if p.name == name) for part, name in NAMES.items()}
    return {part: (told[part].rank, RANK[row["judged"][part]]) for part in row["judged"]}


def count(rows):
    """Wholes as judged, parts as judged, and how far the worst whole is off."""
    wholes = [ranks(row)["whole"] for row in rows]
    parts = [pair for row in rows for part, pair in ranks(row).items() if part != "whole"]
    return sum(a == b for a, b in wholes), sum(a == b for a, b in parts), max(abs(a - b) for a, b in wholes)


def test_the_whole_is_right_in_eleven_of_twelve_avatars_that_its_bounds_were_fitted_to():
    wholes, parts, worst = count(FITTED)
    assert len(FITTED) >= 12 and worst == 0 and wholes >= 11 / 12 * len(FITTED)
    assert parts >= 4 * len(FITTED)


def test_no_whole_is_two_grades_off_in_avatars_that_it_never_saw():
    assert len(UNSEEN) >= 12 and count(UNSEEN)[2] <= 1


def test_avatars_of_footage_filmed_large_are_called_as_they_look():
    wholes, parts, worst = count(LARGE)
    assert len(LARGE) >= 9 and wholes >= len(LARGE) - 1 and worst <= 1
    poor = [row["what"] for row in LARGE if ranks(row)["whole"][0] == Grade.POOR.rank]
    assert poor == [row["what"] for row in LARGE if row["judged"]["whole"] == "poor"]  # none that looks right is called poor
    assert parts >= 0.7 * 5 * len(LARGE)


def test_a_part_that_is_not_good_is_told_with_the_side_from_which_it_is_least_alike():
    metrics = json.loads(json.dumps(UNSEEN[0]["metrics"]))
    for figures in metrics["likeness"].values():
        figures |= {"structure": 0.85, "psnr": 30.0, "worst": 0.9, "worst_view": "left side"}
    told = {part.name: part.sentence for part in give_verdict(metrics, {}).parts}
    assert "Least alike where the left side is seen." in told[NAMES["body"]] and "left side" in told[NAMES["face"]]
    metrics["likeness"]["body"] |= {"structure": 0.95}
    assert "left side" not in next(p.sentence for p in give_verdict(metrics, {}).parts if p.name == NAMES["body"])


def test_the_notebook_says_how_often_the_verdict_is_right():
    told = (ROOT / "docs/lab/verdict.md").read_text()
    for name, rows in (("fitted", FITTED), ("unseen", UNSEEN), ("large", LARGE)):
        wholes, parts, _ = count(rows)
        line = next(line for line in told.splitlines() if line.startswith(f"| `{name}`")).replace("*", "")
        assert line.endswith(f"| {len(rows)} | {wholes} | {parts} of {5 * len(rows)} | 0 wholes |")


def test_the_same_clip_grades_no_worse_for_more_detail():
    small, usual, large = (next(row for row in TABLE if row["what"].endswith(words)) for words in
                           ("train.height=270", "rendered clip, defaults", "12,000 gaussians"))
    assert ranks(small)["whole"][0] <= ranks(usual)["whole"][0] <= ranks(large)["whole"][0]
    assert ranks(small)["body"][0] == ranks(usual)["body"][0] == ranks(large)["body"][0] == Grade.GOOD.rank


@pytest.mark.parametrize("row", FITTED, ids=lambda row: row["what"])
def test_no_good_over_a_smeared_face_and_no_poor_over_a_likeness_that_is_recognised(row):
    told, judged = ranks(row)["whole"], row["judged"]
    assert told[0] < Grade.GOOD.rank or judged["face"] == "good"
    assert told[0] > Grade.POOR.rank or "poor" in (judged["face"], judged["body"])

"""The verdict over avatars that were looked at and judged: docs/lab/verdict.json."""

import json
from pathlib import Path

import pytest

from gsac.pipeline.report.verdict import NAMES, Grade, give_verdict

TABLE = json.loads((Path(__file__).resolve().parents[2] / "docs/lab/verdict.json").read_text())
RANK = {grade.word: grade.rank for grade in Grade}


def ranks(row):
    """Part -> its rank by the verdict and by eye; `whole` too."""
    given = give_verdict(row["metrics"], row["facts"])
    told = {"whole": given.grade} | {part: next(p.grade for p in given.parts if p.name == name) for part, name in NAMES.items()}
    return {part: (told[part].rank, RANK[row["judged"][part]]) for part in row["judged"]}


def test_the_whole_is_right_in_eleven_of_twelve_judged_avatars():
    assert len(TABLE) >= 12
    assert sum(told == judged for told, judged in (ranks(row)["whole"] for row in TABLE)) >= 11 / 12 * len(TABLE)


def test_the_parts_are_right_in_five_of_six_and_never_two_grades_off():
    every = [pair for row in TABLE for part, pair in ranks(row).items() if part != "whole"]
    assert sum(told == judged for told, judged in every) >= 5 / 6 * len(every)
    assert all(abs(told - judged) <= 1 for row in TABLE for told, judged in ranks(row).values())


def test_the_same_clip_grades_no_worse_for_more_detail():
    small, usual, large = (next(row for row in TABLE if row["what"].endswith(words)) for words in
                           ("train.height=270", "rendered clip, defaults", "12,000 gaussians"))
    assert ranks(small)["whole"][0] <= ranks(usual)["whole"][0] <= ranks(large)["whole"][0]
    assert ranks(small)["body"][0] == ranks(usual)["body"][0] == ranks(large)["body"][0] == Grade.GOOD.rank


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row["what"])
def test_no_good_over_a_smeared_face_and_no_poor_over_a_likeness_that_is_recognised(row):
    told, judged = ranks(row)["whole"], row["judged"]
    assert told[0] < Grade.GOOD.rank or judged["face"] == "good"
    assert told[0] > Grade.POOR.rank or "poor" in (judged["face"], judged["body"])

import pytest

from gsac.stages.counting import count_of, counted


@pytest.mark.parametrize(("count", "words"), [(0, "0 frames"), (1, "1 frame"), (12, "12 frames")])
def test_one_has_no_plural(count, words):
    assert counted(count, "frame") == words


@pytest.mark.parametrize(("count", "whole", "words"), [(12, 60, "12 of 60 frames"), (60, 60, "all 60 frames"),
                                                        (1, 1, "the only frame"), (0, 1, "0 of 1 frame")])
def test_all_of_them_are_told_as_all(count, whole, words):
    assert count_of(count, whole, "frame") == words

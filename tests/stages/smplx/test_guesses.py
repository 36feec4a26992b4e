"""What the fit had to guess is one sentence; there is none where nothing was guessed."""

from types import SimpleNamespace

import numpy as np
import pytest

from gsac.stages.findings import Code
from gsac.stages.severity import Severity
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.stage import describe_guesses, doubt_focal

PARAMS = SimpleNamespace(focal=np.array([1234.4, 1234.4]))


@pytest.mark.parametrize(("height", "focal", "words"), [
    (None, None, ("height", "`--height 1.78`", "1234 px")), (1.7, None, ("1234 px",)), (None, 900.0, ("`--height 1.78`",))])
def test_guessed_height_and_focal_length_are_one_sentence_that_says_how_to_fix_them(height, focal, words):
    told = describe_guesses(SmplxConfig(height_m=height), PARAMS, SimpleNamespace(focal_px=focal))
    assert told.startswith("Estimated: ") and all(word in told for word in words)
    assert ("height" in told) == (height is None) and ("px" in told) == (focal is None)


def test_nothing_is_said_where_height_and_focal_length_are_known():
    assert describe_guesses(SmplxConfig(height_m=1.7), PARAMS, SimpleNamespace(focal_px=900.0)) == ""
    assert describe_guesses(SmplxConfig(height_m=1.7, focal_px=900.0), PARAMS, SimpleNamespace(focal_px=None)) == ""


@pytest.mark.parametrize("ratio, said", [(0.3, True), (0.5, True), (0.8, False), (1.05, False), (2.0, False), (5.0, True)])
def test_a_focal_length_that_no_phone_has_is_doubted(ratio, said):
    doubt = doubt_focal(SmplxConfig(), SimpleNamespace(focal_px=1280 * ratio, longer_side=1280), 1280 * ratio)
    assert (doubt is not None) == said
    assert doubt is None or doubt.code is Code.ODD_FOCAL and doubt.figure == pytest.approx(ratio)


def test_no_focal_length_is_no_doubt():
    assert doubt_focal(SmplxConfig(), SimpleNamespace(focal_px=None, longer_side=1280), 1216.0) is None


def test_a_focal_length_that_the_pictures_contradict_is_named_with_the_one_that_is_used():
    doubt = doubt_focal(SmplxConfig(focal_px=500.0), SimpleNamespace(focal_px=None, longer_side=1280), 1234.4)
    assert doubt.code is Code.FOCAL_NOT_BELIEVED and doubt.figure == 1234.4 and doubt.code.value.severity is Severity.NEWS
    assert "500 px" in doubt.message and "1234 px" in doubt.message

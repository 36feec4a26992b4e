"""What stages find: every code's sentence can be filled in, and names what it is about."""

import string

import numpy as np
import pytest

from gsac.stages.findings import Code, Finding
from gsac.stages.severity import Severity


@pytest.mark.parametrize("code", Code)
def test_every_code_has_a_sentence_of_its_own_that_ends(code):
    assert sum(other.value.sentence == code.value.sentence for other in Code) == 1
    assert code.word == code.name.lower() and code.value.severity in Severity
    text = code.value.sentence + (" " + code.value.advice if code.value.advice else "")
    assert not text.endswith((" ", ";", ","))


@pytest.mark.parametrize("code", [code for code in Code if "frames" in [name for _, name, _, _ in string.Formatter().parse(
    code.value.sentence)]])
def test_a_sentence_about_frames_names_them_and_json_has_their_runs(code):
    words = {name for _, name, _, _ in string.Formatter().parse(code.value.sentence) if name} - {"frames", "figure"}
    found = Finding.of(code, np.array([1, 1, 0, 1, 0], bool), 0.5, **dict.fromkeys(words, "a thing"))
    assert "3 of 5 frames (0-1, 3)" in found.message
    assert found.to_json() == {"code": code.word, "severity": code.value.severity.value, "frames": [[0, 1], [3, 3]], "figure": 0.5}


def test_a_finding_of_the_whole_clip_names_no_frames():
    assert Finding.of(Code.FACE_AT_REST).to_json()["frames"] == []

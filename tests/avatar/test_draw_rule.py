"""One draw rule: what the viewer, Unity and the format's page repeat of it, and what CUDA is told, are its numbers."""

import re
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar import draw_rule
from gsac.avatar.cuda.kernels import source

ROOT = Path(__file__).resolve().parents[2]
FILE_NAMES = {"low_pass_px2": draw_rule.ADDED.px2, "alpha_max": draw_rule.MAX_ALPHA, "alpha_min": draw_rule.MIN_ALPHA}
NUMBER = r"([\d.]+f?(?: ?/ ?[\d.]+f?)?)"


def value(text: str) -> float:
    above, _, below = text.replace("f", "").partition("/")
    return float(above) / float(below or 1)


def found(pattern: str, *globs: str) -> set[float]:
    """The numbers at a pattern in all files that match."""
    files = [file for glob in globs for file in ROOT.glob(glob)]
    return {value(number) for file in files for number in re.findall(pattern, file.read_text())}


@pytest.mark.parametrize(("name", "expected"), FILE_NAMES.items())
def test_the_viewers_defaults_are_the_rule(name, expected):
    assert found(rf"{name}(?:: \w+)?\s*[=:]\s*{NUMBER}", "viewer/*.js") == {expected}


@pytest.mark.parametrize(("name", "expected"), list(zip(("LowPass", "AlphaMax", "AlphaMin"), FILE_NAMES.values(), strict=True)))
def test_unitys_defaults_are_the_rule(name, expected):
    assert found(rf"float {name} = {NUMBER};", "unity/Runtime/**/*.cs") == {expected}


def test_a_file_that_does_not_say_whether_the_low_pass_keeps_energy_is_drawn_by_the_rule_of_before():
    viewer, unity = ((ROOT / name).read_text() for name in ("viewer/reader.js", "unity/Runtime/Core/GsacData.cs"))
    assert "low_pass_energy: keepsEnergy = false" in viewer and "public bool KeepsEnergy;" in unity
    assert not draw_rule.ADDED.keeps_energy and '"low_pass_energy": false' in (ROOT / "docs" / "gsac-format.md").read_text()


@pytest.mark.parametrize(("name", "expected"), [("DARKEST", draw_rule.DARKEST), ("BRIGHTEST", draw_rule.BRIGHTEST)])
def test_the_lights_clamp_is_the_same_in_unity_and_the_viewer(name, expected):
    assert found(rf"#define GSAC_{name} {NUMBER}", "unity/Runtime/Resources/Gsac/*.hlsl") == {expected}
    assert found(rf"\b{name} = {NUMBER}", "viewer/*.js") == {expected}


def test_the_formats_page_states_the_rule():
    page = (ROOT / "docs" / "gsac-format.md").read_text()
    for name, expected in FILE_NAMES.items():
        assert value(re.search(rf'"{name}": {NUMBER}', page)[1]) == expected
    assert f"min({draw_rule.BRIGHTEST}, max({draw_rule.DARKEST}," in page


def test_the_cuda_text_holds_the_same_doubles():
    told = dict(re.findall(r"constexpr double (\w+) = (\S+);", source()))
    numbers = {name: number for name, number in vars(draw_rule).items() if isinstance(number, (int, float))}
    names = {name: "NEAR_PLANE" if name == "NEAR" else name for name in numbers}
    assert {name: float(told[cuda]) for name, cuda in names.items()} == numbers
    assert np.float32(told["MIN_ALPHA"]) == np.float32(1.0 / 255)

"""--height and --body: what a person knows, without the names of stages."""

import argparse

import pytest

from gsac.pipeline.cli import execute, make_parser
from gsac.pipeline.commands.batch import forwarded_arguments
from gsac.pipeline.commands.options import values_of_person
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project


def read(*argv: str) -> argparse.Namespace:
    return make_parser(list(argv)).parse_args(list(argv))


@pytest.mark.parametrize("command", ["run", "batch"])
def test_height_and_body_set_the_parameters_of_all_stages_that_have_them(command):
    project = Project.at_hand()
    arguments = read(command, "clips", "--height", "1.78", "--body", "mine")
    configs = resolve(project, options=values_of_person(arguments, project))
    assert configs["smplx"].height_m == 1.78
    assert {name for name, config in configs.items() if getattr(config, "body_model", "") == "mine"} == {"smplx", "train", "export"}


def test_what_set_says_comes_after():
    project = Project.at_hand()
    arguments = read("run", "clip.mp4", "--height", "1.78")
    assert resolve(project, None, ["smplx.height_m=1.6"], options=values_of_person(arguments, project))["smplx"].height_m == 1.6


def test_a_batch_hands_them_on_to_each_clip():
    words = forwarded_arguments(read("batch", "clips", "--height", "1.78", "--body", "mine"))
    assert words == ("--height", "1.78", "--body", "mine")


def test_a_height_in_centimetres_is_answered_by_the_option_that_was_typed(tmp_path, capsys):
    (tmp_path / "clip.mp4").touch()
    assert execute(["run", str(tmp_path / "clip.mp4"), "--height", "178"]) == ExitCode.USAGE
    assert "--height 178: smplx.height_m is 178.0; expected metres between 0.5 and 2.5" in capsys.readouterr().err


def test_an_unknown_body_is_named_before_the_start(tmp_path, capsys):
    (tmp_path / "clip.mp4").touch()
    assert execute(["run", str(tmp_path / "clip.mp4"), "--out", str(tmp_path / "out"), "--body", "nobody"]) == ExitCode.USAGE
    assert "unknown model file nobody" in capsys.readouterr().err and not (tmp_path / "out").exists()

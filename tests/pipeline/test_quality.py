"""--quality: one word for several parameters, told where it counts."""

import json

import pytest

from gsac.pipeline import quality
from gsac.pipeline.cli import execute, make_parser
from gsac.pipeline.commands.batch import forwarded_arguments
from gsac.pipeline.lost_files import recovery
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.pipeline.quality import QUALITIES, STANDARD, describe_quality, dial_names, quality_entry, resolve_quality
from gsac.pipeline.reference import quality_page

PROJECT = Project.at_hand()


def values(configs):
    return {f"{stage}.{key}": getattr(configs[stage], key) for stage, key in dial_names()}


@pytest.mark.parametrize("device", ["cpu", "cuda"])
@pytest.mark.parametrize("name", QUALITIES)
def test_every_preset_is_parameters_that_the_stages_accept(monkeypatch, name, device):
    monkeypatch.setenv("GSAC_DEVICE", device)
    given = {f"{stage}.{key}": value for stage, keys in QUALITIES[name].on(device).items() for key, value in keys.items()}
    found = values(resolve_quality(name, PROJECT))
    assert {key: found[key] for key in given} == given and quality_entry(name, resolve_quality(name, PROJECT))["otherwise"] == []


def test_standard_is_params_yaml():
    assert resolve_quality(STANDARD, PROJECT) == resolve(PROJECT)


def test_a_draft_asks_for_less_and_fine_for_more_than_standard():
    draft, standard, fine = (resolve_quality(name, PROJECT) for name in ("draft", STANDARD, "fine"))
    assert draft["split"].count < standard["split"].count and standard["split"].max_height < fine["split"].max_height
    assert isinstance(draft["train"].gaussians, int) and draft["train"].steps < fine["train"].steps


def test_params_come_after_quality_and_set_after_params(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("train: {steps: 300, height: 400}\n")
    train = resolve_quality("draft", PROJECT, file, ["train.height=300"])["train"]
    assert (train.gaussians, train.steps, train.height) == (QUALITIES["draft"].values["train"]["gaussians"], 300, 300)


def test_what_was_set_otherwise_is_named():
    entry = quality_entry("draft", resolve_quality("draft", PROJECT, None, ["train.steps=300", "train.seed=3"]))
    assert entry == {"name": "draft", "otherwise": ["train.steps"]} and describe_quality(entry) == "draft, but for train.steps"
    assert quality_entry(STANDARD, resolve(PROJECT, None, ["train.steps=60"]))["otherwise"] == ["train.steps"]
    assert describe_quality(None) == describe_quality({"name": ""}) == ""
    assert describe_quality({"name": "fine", "otherwise": 3}) == "fine", "whatever stands in a run.json"


def test_a_gpu_gets_more_and_training_that_is_kept_from_it_does_not(monkeypatch):
    monkeypatch.setattr(quality, "device_class", lambda: "cuda")
    more = QUALITIES["fine"].on_gpu["train"]
    assert resolve_quality("fine", PROJECT)["train"].steps == more["steps"]
    kept = resolve_quality("fine", PROJECT, None, ["train.device=cpu"])
    assert kept["train"].steps == QUALITIES["fine"].values["train"]["steps"] != more["steps"]
    assert quality_entry("fine", kept)["otherwise"] == []


@pytest.mark.parametrize("command", [["run", "clip.mp4"], ["batch", "clips"], ["demo"]])
def test_an_unknown_preset_is_answered_with_the_choices_before_anything_is_made(tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    assert execute([*command, "--quality", "drafty"]) == ExitCode.USAGE
    assert "--quality drafty: unknown (did you mean draft?); choices: draft, standard, fine" in capsys.readouterr().err
    assert not [path for path in tmp_path.iterdir() if path.name in ("demo", "clip-avatar")]


def test_a_batch_hands_it_on_to_each_clip():
    argv = ["batch", "clips", "--quality", "draft"]
    assert forwarded_arguments(make_parser(argv).parse_args(argv)) == ("--quality", "draft")


def test_run_json_the_object_of_json_and_the_report_tell_the_preset(toy):
    told = toy.run("--quality", "draft").json
    assert told["quality"] == json.loads((toy.out / "run.json").read_text())["quality"] == {"name": "draft", "otherwise": []}
    assert "Quality: draft." in (toy.out / "report.html").read_text()
    toy.ran()
    assert "Quality: standard." in (toy.out / "report.html").read_text(), "drawn anew, though no result changed"
    assert toy.gsac("stage", "left", toy.out, "--set", "left.word=last").code == 0
    assert json.loads((toy.out / "run.json").read_text())["quality"]["name"] == "standard", "another command keeps it"


def test_the_command_that_brings_lost_files_back_asks_for_the_same_preset(tmp_path):
    (tmp_path / "dvc.yaml").touch()
    for entry, words in ((None, ""), ({"name": STANDARD}, ""), ({"name": "draft"}, " --quality draft"), ({"name": ["draft"]}, "")):
        (tmp_path / "run.json").write_text(json.dumps({"quality": entry}))
        assert recovery(tmp_path / "train" / "avatar.npz") == f"gsac run CLIP --out {tmp_path}{words}"


def test_the_page_writes_every_preset_out():
    page = quality_page(PROJECT)
    for preset in QUALITIES.values():
        assert f"| `{preset.name}` | {preset.sentence} |" in page
        for stage, keys in preset.values.items():
            for key, value in keys.items():
                row = next(line for line in page.splitlines() if line.startswith(f"| `{stage}.{key}` |"))
                assert f"**{value}**" in row

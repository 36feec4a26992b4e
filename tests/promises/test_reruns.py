"""What reruns and what does not: the cache's promises, seen from the command."""

from __future__ import annotations

import shutil


def test_unchanged_inputs_run_nothing(toy, everything):
    assert toy.ran() == everything
    assert toy.result == "ALPHA ALPHA"
    assert toy.ran() == []
    assert toy.result == "ALPHA ALPHA"


def test_a_changed_input_reruns_exactly_what_depends_on_it(toy, everything):
    toy.ran()
    toy.clip.write_text("delta beta gamma")
    assert toy.ran() == everything
    assert toy.result == "DELTA DELTA"


def test_a_changed_parameter_reruns_exactly_that_stage_and_what_depends_on_it(toy):
    toy.ran()
    assert toy.ran("--set", "right.word=last") == ["right", "join"]
    assert toy.result == "ALPHA GAMMA"


def test_a_model_file_that_a_stage_only_wishes_for_reruns_it_once_it_is_brought_and_when_it_changes(toy):
    toy.edit("right/__init__.py", "models=lambda config: (config.model,) if config.model else ()", 'wishes=lambda config: ("net",)')
    toy.edit("right/stage.py", "job.models[job.config.model].read_text() if job.config.model else",
             'job.models["net"].read_text() if "net" in job.models else')
    toy.ran()
    assert toy.result == "ALPHA ALPHA"
    for text in (" one", " two"):
        (toy.root / "net.bin").write_text(text)
        assert toy.gsac("models", "add", "net", toy.root / "net.bin", "--force").code == 0
        assert toy.ran() == ["right", "join"] and toy.result == f"ALPHA ALPHA{text}"
        assert toy.ran() == []


def test_a_changed_model_file_reruns_exactly_that_stage_and_what_depends_on_it(toy):
    model = toy.root / "net.bin"
    model.write_text("one")
    assert toy.gsac("models", "add", "net", model).code == 0
    toy.ran("--set", "right.model=net")
    assert toy.ran("--set", "right.model=net") == []
    model.write_text("two")
    assert toy.gsac("models", "add", "net", model, "--force").code == 0
    assert toy.ran("--set", "right.model=net") == ["right", "join"]
    assert toy.result == "ALPHA ALPHAtwo"


def test_changed_stage_code_reruns_exactly_that_stage_and_what_depends_on_it(toy):
    toy.ran()
    toy.edit("right/stage.py", "spell(word) + model", "spell(word) + model + '!'")
    assert toy.ran() == ["right", "join"]
    assert toy.result == "ALPHA ALPHA!"


def test_changed_code_of_a_shared_module_reruns_every_stage_that_imports_it(toy, everything):
    toy.ran()
    toy.edit("common.py", "upper()", "lower()")
    assert toy.ran() == everything
    assert toy.result == "alpha alpha"


def test_a_changed_declared_package_version_reruns_exactly_that_stage_and_what_depends_on_it(toy):
    toy.ran()
    toy.set_package_version("2.0")
    assert toy.ran() == ["left"], "join gets the same text again, so it is cut off"


def test_another_device_class_reruns_the_stages_that_depend_on_the_device(toy):
    toy.ran(GSAC_DEVICE="cpu")
    assert toy.ran(GSAC_DEVICE="cuda") == ["right"]


def test_an_unchanged_output_cuts_off_what_is_below(toy):
    toy.ran()
    assert toy.ran("--set", "cut.keep=50") == ["cut"]


def test_a_comment_or_formatting_edit_reruns_nothing(toy):
    toy.ran()
    toy.edit("common.py", "def spell(text):\n    return text.strip().upper()",
             "# Spells.\n\n\ndef spell( text ):\n    '''Loud.'''\n    return (text.strip()\n            .upper())")
    toy.edit("dvc.yaml", "stages:", "# The stages.\nstages:")
    assert toy.ran() == []


def test_swapped_inputs_are_not_the_same_inputs(toy):
    toy.ran("--set", "right.word=last")
    assert toy.result == "ALPHA GAMMA"
    assert toy.ran("--set", "left.word=last") == ["left", "right", "join"]
    assert toy.result == "GAMMA ALPHA"


def test_clip_name_and_paths_are_not_in_the_key_so_equal_content_is_shared(toy):
    toy.ran()
    other = toy.root / "elsewhere" / "another name.mp4"
    other.parent.mkdir()
    shutil.copyfile(toy.clip, other)
    toy.runs_file.write_text("")
    assert toy.gsac("run", other, "--out", toy.root / "other out").code == 0
    assert toy.runs == []


def test_a_cached_stage_reports_the_time_and_memory_of_the_run_that_made_it(toy):
    first = toy.run("--set", "join.pause_s=0.3").json["stages"][-1]
    again = toy.run("--set", "join.pause_s=0.3").json["stages"][-1]
    assert first["status"] == "ran" and again["status"] == "cached"
    assert first["seconds"] >= 0.3 and first["peak_rss_mb"] > 5 and first["cpu_seconds"] > 0
    for figure in ("seconds", "cpu_seconds", "peak_rss_mb", "key"):
        assert again[figure] == first[figure]


def test_force_runs_again_and_writes_again(toy):
    first = toy.run().json["stages"]
    toy.runs_file.write_text("")
    second = toy.run("--force", "left")
    assert second.statuses == {"cut": "cached", "left": "ran", "right": "cached", "join": "cached"}
    assert toy.runs == ["left"]
    third = toy.run().json["stages"]
    assert third[1]["seconds"] == second.json["stages"][1]["seconds"] != first[1]["seconds"]

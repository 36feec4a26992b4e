"""gsac lineage: from an artifact back to the clip."""

import json
import shutil

from gsac.avatar.network_files import MODELS, OPTIONAL
from gsac.pipeline.lineage import BROUGHT, model_licence


def test_an_avatar_leads_back_to_the_clip_by_file_copy_digest_key_and_folder(toy):
    toy.ran("--set", "left.word=last")
    found = toy.gsac("lineage", toy.out / "join" / "out.txt", "--json").json
    assert [stage["stage"] for stage in found["stages"]][0] == "join" and found["stages"][-1]["stage"] == "cut"
    assert {stage["stage"] for stage in found["stages"]} == {"cut", "left", "right", "join"} and found["lost"] == {}
    left = next(stage for stage in found["stages"] if stage["stage"] == "left")
    assert left["params"]["word"] == "last" and left["packages"]["toyware"] == "1.0" and left["seconds"] >= 0
    assert "gsac.toy.left.stage" in left["code"]["modules"] and len(left["code"]["digest"]) == 64
    assert found["clips"] == [{"digest": found["stages"][-1]["inputs"]["clip"], "paths": [str(toy.clip)]}]
    elsewhere = toy.root / "elsewhere.txt"
    shutil.copyfile(toy.out / "join" / "out.txt", elsewhere)
    words = [elsewhere, found["artifacts"][0], found["artifacts"][0][:12], found["stages"][0]["key"], toy.out]
    for word in words:
        again = toy.gsac("lineage", word, "--json").json
        assert {stage["key"] for stage in again["stages"]} == {stage["key"] for stage in found["stages"]}, word
        assert again["clips"] == found["clips"]


def test_people_read_parameters_that_are_not_as_by_default_code_packages_and_the_clip(toy):
    toy.ran("--set", "left.word=last")
    done = toy.gsac("lineage", toy.out)
    assert "parameters  word=last, 4 by default" in done.out and "toyware 1.0" in done.out and f"  {toy.clip}" in done.out
    assert "code        " in done.out and " s on " in done.out


def test_of_equal_results_that_of_the_folder_counts_and_the_others_are_counted(toy):
    toy.ran()
    one = toy.gsac("lineage", toy.out / "join" / "out.txt", "--json").json
    toy.gsac("run", toy.clip, "--out", toy.root / "two", "--set", "left.keep=50")
    for folder in (toy.out, toy.root / "two"):
        found = toy.gsac("lineage", folder / "left" / "out.txt", "--json").json
        kept = next(stage for stage in found["stages"] if stage["stage"] == "left")
        assert kept["params"]["keep"] == (100 if folder == toy.out else 50)
    found = toy.gsac("lineage", toy.out / "join" / "out.txt", "--json").json
    left = next(stage for stage in one["stages"] if stage["stage"] == "left")
    assert found["stages"] == one["stages"] and found["same_bytes"] == {left["key"]: 1}


def test_a_record_that_is_gone_is_named_and_what_is_known_is_told(toy):
    toy.ran()
    next((toy.cache / "actions" / "left").iterdir()).unlink()
    done = toy.gsac("lineage", toy.out / "join" / "out.txt", "--json")
    assert done.code == 0 and list(done.json["lost"]) == ["left/out.txt"]
    assert {stage["stage"] for stage in done.json["stages"]} == {"join", "right", "cut"}
    assert "its record is not in the cache any more" in done.err


def test_what_the_cache_does_not_know_is_named(toy):
    toy.ran()
    (toy.root / "odd.txt").write_text("odd")
    for word, said in ((toy.root / "odd.txt", "knows no result of this content"), ("nonsense", "neither a file, nor the folder"),
                       ("a" * 64, "neither a file")):
        done = toy.gsac("lineage", word)
        assert done.code == 2 and said in done.err and "Traceback" not in done.err
    shutil.rmtree(toy.cache)
    done = toy.gsac("lineage", toy.out)
    assert done.code == 2 and "has none of its results; `gsac run` makes them again" in done.err


def test_a_model_file_comes_with_its_licence():
    for name, model in (MODELS | OPTIONAL).items():
        assert model_licence(name, model.sha256) == model.licence
    assert model_licence("my_body", "0" * 64) == BROUGHT
    assert model_licence(next(iter(MODELS)), "0" * 64) == BROUGHT


def test_a_lineage_is_one_object_of_plain_json(toy):
    toy.ran()
    found = toy.gsac("lineage", toy.out, "--json")
    assert json.loads(found.out) == found.json and found.json["papers"] == []

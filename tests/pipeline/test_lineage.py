"""gsac lineage: from an artifact back to the clip."""

import json
import shutil

import pytest

from gsac.avatar.network_files import MODELS, OPTIONAL, OWN_LICENCE, licence_of
from support.toy import Toy


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Toy:
    """A run that these tests only look at."""
    toy = Toy(tmp_path_factory.mktemp("finished"))
    toy.ran("--set", "left.word=last")
    return toy


def test_an_avatar_leads_back_to_the_clip_by_file_copy_digest_key_and_folder(finished, inside):
    found = inside(finished, "lineage", finished.out / "join" / "out.txt", "--json").json
    assert [stage["stage"] for stage in found["stages"]][0] == "join" and found["stages"][-1]["stage"] == "cut"
    assert {stage["stage"] for stage in found["stages"]} == {"cut", "left", "right", "join"} and found["lost"] == {}
    left = next(stage for stage in found["stages"] if stage["stage"] == "left")
    assert left["params"]["word"] == "last" and left["packages"]["toyware"] == "1.0" and left["seconds"] >= 0
    assert "gsac.toy.left.stage" in left["code"]["modules"] and len(left["code"]["digest"]) == 64
    assert found["clips"] == [{"digest": found["stages"][-1]["inputs"]["clip"], "paths": [str(finished.clip)]}]
    elsewhere = finished.root / "elsewhere.txt"
    shutil.copyfile(finished.out / "join" / "out.txt", elsewhere)
    words = [elsewhere, found["artifacts"][0], found["artifacts"][0][:12], found["stages"][0]["key"], finished.out]
    for word in words:
        again = inside(finished, "lineage", word, "--json").json
        assert {stage["key"] for stage in again["stages"]} == {stage["key"] for stage in found["stages"]}, word
        assert again["clips"] == found["clips"]


def test_people_read_parameters_that_are_not_as_by_default_code_packages_and_the_clip(finished, inside):
    done = inside(finished, "lineage", finished.out)
    assert "parameters  word=last, 4 by default" in done.out and "toyware 1.0" in done.out and f"  {finished.clip}" in done.out
    assert "code        " in done.out and " s on " in done.out


def test_of_equal_results_that_of_the_folder_counts_and_the_others_are_counted(finished, inside):
    one = inside(finished, "lineage", finished.out / "join" / "out.txt", "--json").json
    finished.gsac("run", finished.clip, "--out", finished.root / "two", "--set", "left.word=last", "--set", "left.keep=50",
                  "--until", "left")
    for folder, keep in ((finished.out, 100), (finished.root / "two", 50)):
        found = inside(finished, "lineage", folder / "left" / "out.txt", "--json").json
        assert found["stages"][0]["params"]["keep"] == keep
    assert "  1 other run gave the same bytes" in inside(finished, "lineage", finished.out / "join" / "out.txt").out
    found = inside(finished, "lineage", finished.out / "join" / "out.txt", "--json").json
    left = next(stage for stage in one["stages"] if stage["stage"] == "left")
    assert found["stages"] == one["stages"] and found["same_bytes"] == {left["key"]: 1}


def test_a_record_that_is_gone_is_named_and_what_is_known_is_told(finished, inside):
    record = next((finished.cache / "actions" / "right").iterdir())
    record.rename(finished.root / "aside")
    done = inside(finished, "lineage", finished.out / "join" / "out.txt", "--json")
    (finished.root / "aside").rename(record)
    assert done.code == 0 and list(done.json["lost"]) == ["right/out.txt"]
    assert {stage["stage"] for stage in done.json["stages"]} == {"join", "left", "cut"}
    assert "its record is not in the cache any more" in done.err


def test_what_the_cache_does_not_know_is_named(finished, inside):
    (finished.root / "odd.txt").write_text("odd")
    for word, said in ((finished.root / "odd.txt", "knows no result of this content"), ("a" * 64, "neither a file"),
                       ("nonsense", "neither a file, nor the folder")):
        done = inside(finished, "lineage", word)
        assert done.code == 2 and said in done.err and "Traceback" not in done.err
    done = inside(finished, "lineage", finished.out, GSAC_CACHE=str(finished.root / "empty"))
    assert done.code == 2 and "has none of its results; `gsac run` makes them again" in done.err


def test_a_model_file_comes_with_its_licence():
    for name, model in (MODELS | OPTIONAL).items():
        assert licence_of(name, model.sha256) == model.licence
    assert licence_of("my_body", "0" * 64) == OWN_LICENCE
    assert licence_of(next(iter(MODELS)), "0" * 64) == OWN_LICENCE


def test_a_lineage_is_one_object_of_plain_json(finished, inside):
    found = inside(finished, "lineage", finished.out, "--json")
    assert json.loads(found.out) == found.json and found.json["papers"] == []

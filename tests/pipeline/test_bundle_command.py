"""gsac bundle: a clip's results on another machine, and what may go wrong on the way."""

import json
import tarfile
from pathlib import Path

import pytest

from support.toy import Toy


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Toy:
    """A run that these tests only look at."""
    toy = Toy(tmp_path_factory.mktemp("finished"))
    toy.ran()
    return toy


@pytest.fixture
def other(tmp_path) -> Toy:
    """Another machine with the same clip."""
    (tmp_path / "other").mkdir()
    return Toy(tmp_path / "other")


def test_after_an_import_into_an_empty_cache_a_run_on_the_same_clip_is_all_hits(finished, other, everything, inside):
    (finished.root / "agreed.txt").write_text("Ada agreed: research only")
    done = inside(finished, "bundle", "export", finished.out, "--out", other.root / "ada.bundle", "--consent", "agreed.txt",
                  "--json")
    assert done.code == 0 and done.json["metrics"]["results"] == 4
    assert done.json["metrics"]["papers"] == ["papers/consent/agreed.txt"]
    done = inside(other, "bundle", "import", "ada.bundle", "--json")
    assert done.code == 0 and len(done.json["results"]) == 4
    run = other.run()
    assert run.statuses == dict.fromkeys(everything, "cached") and other.runs == [] and other.result == finished.result
    lineage = inside(other, "lineage", other.out, "--json").json
    assert lineage["papers"] == done.json["papers"] and "research only" in Path(lineage["papers"][0]).read_text()
    assert inside(other, "cache", "verify").code == 0
    again = inside(other, "bundle", "export", other.out, "--out", "again.bundle", "--json")
    assert again.json["metrics"]["papers"] == ["papers/consent/agreed.txt"]  # it goes on with the results


def test_a_bundle_tells_where_its_results_come_from_and_no_path_of_the_machine(finished, inside):
    done = inside(finished, "bundle", "export", finished.out, "--out", "one.bundle")
    assert done.out.splitlines()[-1] == str(finished.root / "one.bundle")
    with tarfile.open(finished.root / "one.bundle") as tar:
        lineage = json.load(tar.extractfile("lineage.json"))
    assert len(lineage["stages"]) == 4 and lineage["clips"][0]["paths"] == ["clip.mp4"]
    assert str(finished.root) not in json.dumps(lineage)


def test_a_result_that_is_not_what_the_folder_was_made_from_is_not_exported(toy, inside):
    toy.ran()
    toy.gsac("stage", "cut", "--set", "cut.keep=1", cwd=toy.out)
    done = inside(toy, "bundle", "export", toy.out, "--out", "one.bundle")
    assert done.code == 3 and "is not up to date" in done.err and not (toy.root / "one.bundle").exists()
    toy.gsac("stage", "cut", cwd=toy.out)
    next((toy.cache / "actions" / "left").iterdir()).unlink()
    done = inside(toy, "bundle", "export", toy.out, "--out", "one.bundle")
    assert done.code == 3 and "run again" in done.err


def test_a_file_that_is_no_bundle_is_a_mistake_of_one_sentence(finished, inside):
    (finished.root / "odd").write_bytes(b"PK\x03\x04" + bytes(2000))
    done = inside(finished, "bundle", "import", "odd")
    assert done.code == 2 and "is no bundle that can be trusted" in done.err and "Traceback" not in done.err
    folder = finished.root
    for words in (("import", "nowhere"), ("export", folder, "--out", "x"), ("export", folder, "--out", "no/such/folder/x")):
        done = inside(finished, "bundle", *words)
        assert done.code == 2 and "Traceback" not in done.err, words


def test_an_export_writes_over_nothing_unless_told_to(finished, inside):
    (finished.root / "one.bundle").write_text("mine")
    done = inside(finished, "bundle", "export", finished.out, "--out", "one.bundle")
    assert done.code == 2 and "--force" in done.err and (finished.root / "one.bundle").read_text() == "mine"
    done = inside(finished, "bundle", "export", finished.out, "--out", "one.bundle", "--consent", "nowhere.txt", "--force")
    assert done.code == 2 and "nowhere.txt: no such file" in done.err
    assert inside(finished, "bundle", "export", finished.out, "--out", "one.bundle", "--force").code == 0

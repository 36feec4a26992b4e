"""gsac cache ls | verify | gc on odd stores and odd words."""

import hashlib
import json
import os

import pytest

from gsac.cache.key import KeyParts
from gsac.cache.publish import publish
from gsac.cache.record import RunInfo
from gsac.cache.store import Store
from gsac.pipeline.cli import execute
from gsac.pipeline.commands.cache import declared_by
from gsac.pipeline.keys import Keys
from gsac.pipeline.model_store import ModelStore
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """The place of a cache that is not there yet."""
    monkeypatch.setenv("GSAC_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def gsac(capsys):
    """gsac(*words): exit code, and what was said."""

    def run(*words: str) -> tuple[int, str]:
        code = execute(list(words))
        said = capsys.readouterr()
        return int(code), said.err + said.out

    return run


def test_listing_a_cache_that_is_not_there_lists_nothing_and_makes_nothing(cache, gsac):
    code, said = gsac("cache", "ls", "--json")
    assert code == 0 and json.loads(said.splitlines()[-1])["results"] == []
    assert not cache.exists()


def test_verifying_what_is_no_cache_is_a_mistake_and_not_sound(cache, gsac):
    code, said = gsac("cache", "verify")
    assert code == 2 and f"there is no cache in {cache}" in said and not cache.exists()
    cache.mkdir()
    assert gsac("cache", "verify")[0] == 2 and list(cache.iterdir()) == []
    cache.rmdir()
    cache.write_text("a file")
    for does in ("verify", "ls"):
        code, said = gsac("cache", does)
        assert code == 2 and f"{cache} is a file; set GSAC_CACHE to the folder of a cache" in said


@pytest.mark.parametrize("words", [("cache", "ls"), ("cache", "verify"), ("models", "ls")])
def test_a_cache_in_the_home_of_nobody_is_named(monkeypatch, gsac, words):
    monkeypatch.setenv("GSAC_CACHE", "~nouser/x")
    code, said = gsac(*words)
    assert code == 2 and "GSAC_CACHE=~nouser/x: there is no such home folder" in said and len(said.splitlines()) == 1


@pytest.mark.parametrize(("words", "told"), [
    (("--keep-days", "nan"), "--keep-days nan: expected 0 or more"), (("--max-size", ""), "--max-size '': expected a size"),
    (("--keep-days", "-1"), "expected 0 or more"), (("--max-size", "nan"), "expected a size")])
def test_a_bound_of_gc_that_is_none_is_refused(cache, gsac, words, told):
    code, said = gsac("cache", "gc", *words)
    assert code == 2 and told in said


def add_model(store, tmp_path):
    (tmp_path / "mine").write_bytes(b"weights")
    return ModelStore(store).add("mine", tmp_path / "mine")


def test_verify_checks_model_files_and_names_what_the_user_has_to_bring_again(cache, gsac, tmp_path):
    path = add_model(Store(cache), tmp_path)
    assert gsac("cache", "verify")[0] == 0
    path.chmod(0o644)
    path.write_bytes(b"weighty")
    code, said = gsac("cache", "verify", "--json")
    found = json.loads(said.splitlines()[-1])
    assert code == 4 and found["damaged_models"] == found["gone_models"] == ["mine"] and not found["sound"]
    assert "bring it again with `gsac models add mine FILE`" in said
    assert gsac("cache", "verify")[0] == 4, "it is still gone"
    add_model(Store(cache), tmp_path)
    assert gsac("cache", "verify")[0] == 0


@pytest.mark.parametrize("before", [False, True])
def test_repair_pulls_damaged_model_files_again_also_those_found_before(cache, gsac, monkeypatch, before):
    from gsac.avatar import network_files

    content = hashlib.sha256(b"weights").hexdigest()
    path = Store(cache).root / "models" / content / "net"
    path.parent.mkdir()
    path.write_bytes(b"weighty")
    monkeypatch.setattr(network_files, "MODELS", {"net": network_files.ModelFile("net", content, "Apache-2.0", "a test")})
    pulled = []
    monkeypatch.setattr(ModelStore, "pull", lambda self, names, say: pulled.extend(names))
    if before:
        assert gsac("cache", "verify")[0] == 4 and pulled == []
    code, said = gsac("cache", "verify", "--repair", "--json")
    assert code == (0 if before else 4) and pulled == json.loads(said.splitlines()[-1])["repaired"] == ["net"]


def test_a_record_of_the_code_at_hand_must_have_the_outputs_that_its_stage_declares(cache):
    store, project = Store(cache), Project.at_hand()
    declared = declared_by(project, store)
    code = Keys(project, resolve(project), store).code("split")
    assert declared(KeyParts("split", code=code)) == project.outputs("split")
    assert declared(KeyParts("split", code=code | {"gsac.stages.split.stage": "0" * 64})) is None, "of an older gsac"
    assert declared(KeyParts("not a stage")) is None
    for parts in (KeyParts("split", code=code), KeyParts("split", code={"gsac.other": "0" * 64})):
        with store.private("split") as folder:
            (folder / "other.json").write_text("{}")
            publish(store, parts, folder, ("other.json",), RunInfo())
    assert execute(["cache", "verify"]) == 4
    assert len(store.record_files()) == 1


def test_results_of_another_version_of_gsac_are_no_damage(cache, gsac):
    store = Store(cache)
    (cache / "actions" / "split").mkdir()
    (cache / "actions" / "split" / f"{'a' * 64}.json").write_text('{"version": 1, "key": "' + "a" * 64 + '"}')
    assert gsac("cache", "verify")[0] == 0 and len(store.record_files()) == 1
    assert gsac("cache", "gc")[0] == 0 and store.record_files() == []


def test_the_memo_is_for_all_users_of_the_store(cache):
    before = os.umask(0o077)
    try:
        cache.mkdir(mode=0o775)
        cache.chmod(0o775)
        assert Store(cache).memo.file.stat().st_mode & 0o777 == 0o664
    finally:
        os.umask(before)

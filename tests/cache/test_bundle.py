"""Bundles: all of it comes out as it went in, or nothing does."""

import hashlib
import io
import json
import random
import tarfile

import pytest

from gsac.cache import bundle as bundle_module
from gsac.cache.bundle import BundleError, read_bundle, write_bundle
from gsac.cache.digest import canonical, typed_digest
from gsac.cache.errors import CacheError, CacheFullError, IntegrityError
from gsac.cache.record import Footprint, Record, RunInfo
from gsac.cache.remote import pack
from gsac.cache.store import Store
from gsac.cache.verify import verify

CLIP = "c" * 64
TEXTS = {"lineage.json": b"{}", "papers/consent/agreed.txt": b"research only", "papers/licences/body.txt": b"mine"}


@pytest.fixture
def bundled(store, make, parts_of, tmp_path):
    """A bundle of two results, one of whose outputs they share, and their records."""
    records = [make(parts_of(word="one")), make(parts_of(word="two"), "other"), make(parts_of(word="same as one"))]
    write_bundle(tmp_path / "one.bundle", store, records, CLIP, TEXTS)
    return tmp_path / "one.bundle", records


@pytest.fixture
def other(tmp_path) -> Store:
    return Store(tmp_path / "other")


def nothing_is_in(store: Store) -> bool:
    """Whether a store holds no object, record, paper or left-over."""
    return not [path for path in store.root.rglob("*") if path.is_file() and not path.name.startswith(("memo", "lock"))]


def members(file) -> list[tuple[str, bytes]]:
    with tarfile.open(file) as tar:
        return [(info.name, tar.extractfile(info).read()) for info in tar]


def written(file, entries, manifest=None, **changes):
    """A bundle of these members, whose manifest is right unless given."""
    if manifest is None:
        manifest = {"gsac bundle": 1, "clip": CLIP, "members": [
            [name, hashlib.sha256(data).hexdigest(), len(data)] for name, data in entries]}
    entries = [("manifest.json", json.dumps(manifest).encode()), *entries]
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w", format=tarfile.GNU_FORMAT) as tar:
        for name, data in entries:
            info = tarfile.TarInfo(name)
            info.size = len(data)
            for field, value in changes.get(name.replace("/", "_").partition(".")[0], {}).items():
                setattr(info, field, value)
            tar.addfile(info, io.BytesIO(data))
    end = out.getvalue().rstrip(b"\0")
    file.write_bytes(end + bytes(-len(end) % 512 + 1024))
    return file


def test_a_bundle_brings_results_and_papers_to_an_empty_store(bundled, store, other, contents):
    file, records = bundled
    bundle = read_bundle(file, other)
    assert bundle.clip == CLIP and bundle.bytes == file.stat().st_size
    for record in records:
        there = other.lookup(record.key, ("frames", "clip.json"), deep=True)
        assert there.outputs == record.outputs and there.info == record.info
        assert contents(other.path(there, "frames")) == contents(store.path(record, "frames"))
    assert verify(other).sound and list((other.root / "tmp").iterdir()) == []
    assert sorted((path.parent.name, path.read_bytes()) for path in bundle.papers) == [
        ("consent", b"research only"), ("licences", b"mine")]
    again = read_bundle(file, other)
    assert again.papers == bundle.papers and bundle_module.papers_of(other, CLIP).keys() == TEXTS.keys() - {"lineage.json"}


def test_a_bundle_is_a_plain_tar_with_its_manifest_first_and_the_same_bytes_each_time(bundled, store, tmp_path):
    file, records = bundled
    entries = members(file)
    manifest = json.loads(entries[0][1])
    assert entries[0][0] == "manifest.json" and [name for name, *_ in manifest["members"]] == [name for name, _ in entries[1:]]
    write_bundle(tmp_path / "again", store, reversed(records), CLIP, TEXTS)
    assert (tmp_path / "again").read_bytes() == file.read_bytes()


def test_a_paper_of_a_name_that_is_there_already_replaces_nothing(bundled, other, store, tmp_path):
    file, records = bundled
    read_bundle(file, other)
    write_bundle(tmp_path / "two", store, records, CLIP, {"papers/consent/agreed.txt": b"all rights"})
    bundle = read_bundle(tmp_path / "two", other)
    assert [path.read_bytes() for path in bundle.papers] == [b"all rights"]
    assert (other.root / "papers" / CLIP / "consent" / "agreed.txt").read_bytes() == b"research only"


def test_one_wrong_byte_anywhere_brings_nothing_into_the_store(bundled, other, tmp_path):
    whole, found = bundled[0].read_bytes(), 0
    places = random.Random(1)
    for at in [*range(0, 600, 37), *(places.randrange(len(whole)) for _ in range(150))]:
        spoiled = tmp_path / "spoiled"
        spoiled.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1:])
        with pytest.raises(BundleError, match="nothing of it was taken"):
            read_bundle(spoiled, other)
        found += 1
    assert found == 167 and nothing_is_in(other)


def test_a_bundle_that_is_cut_or_goes_on_is_refused(bundled, other, tmp_path):
    whole = bundled[0].read_bytes()
    for length in [0, 1, 511, 512, 2000, len(whole) // 2, len(whole) - 1024, len(whole) - 1]:
        (tmp_path / "cut").write_bytes(whole[:length])
        with pytest.raises(BundleError):
            read_bundle(tmp_path / "cut", other)
    (tmp_path / "longer").write_bytes(whole + b"x")
    with pytest.raises(BundleError):
        read_bundle(tmp_path / "longer", other)
    assert nothing_is_in(other)


@pytest.mark.parametrize("name", [
    "../evil", "/etc/evil", "papers/consent/../../evil", "papers/consent/..", "papers/other/x", "actions/split/x.json",
    "objects/" + "0" * 64 + "/x", "objects/..", "models/x",
])
def test_a_member_of_another_name_than_bundles_hold_is_refused(bundled, other, tmp_path, name):
    entries = members(bundled[0])[1:]
    with pytest.raises(BundleError):
        read_bundle(written(tmp_path / "odd", [(name, b"x"), *entries]), other)
    assert nothing_is_in(other) and not list(tmp_path.rglob("evil"))


@pytest.mark.parametrize("kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.DIRTYPE, tarfile.FIFOTYPE, tarfile.CHRTYPE])
def test_a_link_or_what_else_is_no_plain_file_is_refused(bundled, other, tmp_path, kind):
    entries = members(bundled[0])[1:]
    odd = written(tmp_path / "odd", entries, lineage={"type": kind, "linkname": "/etc/passwd"})
    with pytest.raises(BundleError, match="no plain file"):
        read_bundle(odd, other)
    assert nothing_is_in(other)


@pytest.mark.parametrize("manifest", [
    b"", b"[", b"[]", b"{}", b'{"gsac bundle": 2, "clip": "%s", "members": []}' % (b"c" * 64),
    b'{"gsac bundle": 1, "clip": "../../x", "members": [["lineage.json", "%s", 2]]}' % (b"0" * 64),
    b'{"gsac bundle": 1, "clip": "%s", "members": [["lineage.json", "%s", -2]]}' % (b"c" * 64, b"0" * 64),
    b"[" * 100000,
])
def test_a_manifest_of_another_form_is_refused(other, tmp_path, manifest):
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as tar:
        info = tarfile.TarInfo("manifest.json")
        info.size = len(manifest)
        tar.addfile(info, io.BytesIO(manifest))
    (tmp_path / "odd").write_bytes(out.getvalue())
    with pytest.raises(BundleError):
        read_bundle(tmp_path / "odd", other)


@pytest.mark.parametrize("missing", ["actions", "objects"])
def test_objects_that_no_record_names_and_records_without_their_objects_are_refused(bundled, other, tmp_path, missing):
    two = bundled[1][1]
    names = {"actions": f"actions/split/{two.key}.json", "objects": f"objects/{two.outputs['frames']}"}
    entries = [entry for entry in members(bundled[0])[1:] if entry[0] != names[missing]]
    with pytest.raises(BundleError, match="its objects are not those that its records name"):
        read_bundle(written(tmp_path / "odd", entries), other)
    assert nothing_is_in(other)


def test_results_of_another_clip_than_the_manifest_names_are_refused(bundled, other, store, tmp_path):
    write_bundle(tmp_path / "odd", store, bundled[1], "d" * 64, TEXTS)
    with pytest.raises(BundleError, match="none of its records is of the clip"):
        read_bundle(tmp_path / "odd", other)


def test_a_record_and_pack_that_agree_on_a_name_outside_write_nothing_there(parts_of, other, tmp_path):
    parts, text = parts_of(), canonical({"../../evil": [hashlib.sha256(b"").hexdigest(), 0]})
    digest = typed_digest("tree 1", text)
    record = Record(parts.key, parts, {"frames": digest}, RunInfo(), {"frames": Footprint(1, 0, "")})
    file = written(tmp_path / "odd", [(f"actions/split/{parts.key}.json", record.to_json().encode()),
                                      (f"objects/{digest}", pack.HEAD % len(text) + text)])
    with pytest.raises(BundleError, match="list of its files"):
        read_bundle(file, other)
    assert nothing_is_in(other) and not list(tmp_path.rglob("evil"))


def test_a_bundle_that_says_to_be_larger_than_the_disk_or_than_its_records_is_not_unpacked(parts_of, other, tmp_path):
    parts, digest = parts_of(), "0" * 64
    for size, error in ((1 << 60, CacheFullError), (-1, BundleError)):
        record = Record(parts.key, parts, {"frames": digest}, RunInfo(), {"frames": Footprint(1, size, "")})
        entries = [(f"actions/split/{parts.key}.json", record.to_json().encode()), (f"objects/{digest}", b"x")]
        file = written(tmp_path / "odd", entries)
        with pytest.raises(error):
            read_bundle(file, other)
    assert nothing_is_in(other)


def test_the_sizes_of_members_are_bound(monkeypatch, bundled, other, store, tmp_path):
    monkeypatch.setattr(bundle_module, "LARGEST_PAPER", 5)
    with pytest.raises(BundleError, match="manifest"):
        read_bundle(bundled[0], other)
    with pytest.raises(CacheError, match="expected at most 5"):
        write_bundle(tmp_path / "two", store, bundled[1], CLIP, TEXTS)
    monkeypatch.setattr(bundle_module, "LARGEST", 100)
    with pytest.raises(BundleError, match="of at most 100 bytes"):
        read_bundle(bundled[0], other)


def test_a_damaged_object_goes_into_no_bundle(store, make, parts_of, tmp_path):
    record = make(parts_of())
    file = store.path(record, "clip.json")
    file.chmod(0o644)
    file.write_text("resulx")
    with pytest.raises(IntegrityError, match="damaged"):
        write_bundle(tmp_path / "out", store, [record], CLIP, {})
    assert not (tmp_path / "out").exists()


def test_a_paper_needs_a_plain_name(store, make, parts_of, tmp_path):
    for name in ("papers/consent/" + "x" * 90, "papers/consent/a\0b", "papers/consent/" + "ü" * 60):
        with pytest.raises(CacheError, match="plain and short"):
            write_bundle(tmp_path / "out", store, [make(parts_of())], CLIP, {name: b""})

import json

import pytest

from gsac.cache.digest import canonical, tree_digest, typed_digest
from gsac.cache.errors import IntegrityError
from gsac.cache.objects import NO_MEMO
from gsac.cache.record import Footprint
from gsac.cache.remote import pack


@pytest.fixture
def tree(tmp_path, fill):
    """A folder, its digest, and what a record says of its size."""
    (tmp_path / "made").mkdir()
    fill(tmp_path / "made")
    return tmp_path / "made", *described(tmp_path / "made")


def described(path):
    digest, manifest = tree_digest(path, NO_MEMO)
    return digest, Footprint(len(manifest), sum(size for _, size in manifest.values()), "")


def made_up(manifest, *contents):
    """Pack and digest of a manifest that no folder has."""
    text = canonical(manifest)
    return pack.HEAD % len(text) + text + b"".join(contents), typed_digest("tree 1", text)


@pytest.mark.parametrize("part", [1, 7, 100, pack.PART])
def test_a_folder_comes_out_of_its_pack_as_it_went_in_however_it_is_cut(tree, tmp_path, contents, monkeypatch, part):
    path, digest, size = tree
    monkeypatch.setattr(pack, "PART", part)
    parts = list(pack.pack_parts(path, digest))
    assert len(parts) == pack.count_parts(path, digest) and all(len(one) == part for one in parts[:-1])
    pack.unpack(parts, digest, size, tmp_path / "out")
    assert contents(tmp_path / "out") == contents(path)


def test_a_single_file_and_an_empty_folder_can_be_packed(tmp_path, contents):
    (tmp_path / "file.json").write_text("{}")
    (tmp_path / "empty").mkdir()
    for name in ("file.json", "empty"):
        digest, size = described(tmp_path / name)
        pack.unpack(pack.pack_parts(tmp_path / name, digest), digest, size, tmp_path / f"{name}.out")
        assert contents(tmp_path / f"{name}.out") == contents(tmp_path / name)


def test_a_damaged_object_is_not_packed(tree):
    path, digest, _ = tree
    (path / "clip.json").write_text("other")
    with pytest.raises(IntegrityError, match="damaged"):
        next(pack.pack_parts(path, digest))


def test_one_wrong_bit_anywhere_in_a_pack_is_found(tree, tmp_path):
    path, digest, size = tree
    whole = b"".join(pack.pack_parts(path, digest))
    for number, at in enumerate(range(0, len(whole), 97)):
        spoiled = whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1:]
        with pytest.raises(pack.WrongBytesError):
            pack.unpack([spoiled], digest, size, tmp_path / f"out{number}")


def test_a_pack_that_is_cut_goes_on_or_is_of_another_size_than_its_record_says_is_refused(tree, tmp_path):
    path, digest, size = tree
    whole = b"".join(pack.pack_parts(path, digest))
    for number, (parts, expected) in enumerate([
        ([whole[:-1]], size), ([whole[:20]], size), ([], size), ([whole + b"more"], size),
        ([whole], Footprint(size.files, size.bytes - 1, "")), ([whole], Footprint(size.files + 1, size.bytes, "")),
    ]):
        with pytest.raises(pack.WrongBytesError):
            pack.unpack(parts, digest, expected, tmp_path / f"out{number}")


@pytest.mark.parametrize("name", ["../evil", "/evil", "a/../../evil", "a//b", ".", "a\0b", "\ud800"])
def test_a_pack_names_no_file_outside_of_its_folder(tmp_path, name):
    content = typed_digest("none", b"")
    bytes_, digest = made_up({name: [content, 0]})
    with pytest.raises(pack.WrongBytesError, match="list of its files"):
        pack.unpack([bytes_], digest, Footprint(1, 0, ""), tmp_path / "in" / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("manifest", [
    {"a": ["0" * 64, 1], "a/b": ["0" * 64, 1]}, {"": ["0" * 64, 0], "a": ["0" * 64, 0]}, {"a": ["0" * 64, -1]},
    {"a": ["0" * 64, True]}, {"a": ["xyz", 1]}, {"a": ["0" * 64]}, {"a": 1}, [1], 7,
])
def test_a_manifest_of_another_form_is_refused(manifest):
    with pytest.raises(pack.WrongBytesError, match="list of its files"):
        pack.read_names(json.dumps(manifest).encode())


def test_a_manifest_larger_than_any_is_refused_before_it_is_read(tmp_path):
    def parts():
        yield pack.HEAD % (pack.LARGEST_MANIFEST + 1)
        raise AssertionError("asked for more")

    with pytest.raises(pack.WrongBytesError, match="too many files"):
        pack.unpack(parts(), "0" * 64, Footprint(1, 0, ""), tmp_path / "out")

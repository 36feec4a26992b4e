import json
from dataclasses import replace

import pytest

from gsac.cache.key import KeyParts
from gsac.cache.record import RECORD_VERSION, Footprint, Record, RunInfo, is_inside, is_of_other_version
from support.poison import sign

PARTS = KeyParts("train", {"clip": "c" * 64}, {"fps": 5})
RECORD = Record(PARTS.key, PARTS, {"heldout/0.png": "a" * 64}, RunInfo(metrics={"psnr_fg": 11.9}, log_tail="done\n"),
                {"heldout/0.png": Footprint(1, 10, "b" * 64)})


def test_a_record_is_read_as_it_was_written_and_its_file_is_json():
    text = RECORD.to_json()
    assert Record.from_json(text) == RECORD
    assert json.loads(text)["info"]["metrics"] == {"psnr_fg": 11.9}


def test_no_bit_of_a_record_can_flip_unseen():
    data = RECORD.to_json().encode()
    for bit in range(len(data) * 8):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        text = flipped.decode("latin-1")
        assert Record.from_json(text) is None, bit
        assert not is_of_other_version(text), bit


def test_a_record_counts_only_with_the_declared_outputs():
    text = RECORD.to_json()
    assert Record.from_json(text, ("heldout/0.png",)) == RECORD
    for declared in ((), ("heldout",), ("heldout/0.png", "avatar.npz")):
        assert Record.from_json(text, declared) is None


@pytest.mark.parametrize("name", ["", "/", ".", "..", "/etc/passwd", "../a", "a/../b", "a/..", "./a", "a/.", "a//b", "a/", "a\0"])
def test_a_record_whose_output_is_no_plain_relative_path_does_not_count(name):
    assert not is_inside(name)
    print_of = {name: RECORD.footprints["heldout/0.png"]}
    assert Record.from_json(replace(RECORD, outputs={name: "a" * 64}, footprints=print_of).to_json()) is None


@pytest.mark.parametrize("digest", ["", "a" * 63, "A" * 64, "../" * 20 + "abcd", "a" * 64 + "\n", None, 7])
def test_a_record_whose_digest_is_none_does_not_count(digest):
    assert Record.from_json(replace(RECORD, outputs={"heldout/0.png": digest}).to_json()) is None


@pytest.mark.parametrize("change", [
    {"seconds": "12"}, {"seconds": True}, {"metrics": []}, {"warnings": [7]}, {"warnings": "none"}, {"unknown": 1},
    {"log_tail": None}])
def test_a_record_with_a_figure_of_another_type_does_not_count(change):
    raw = json.loads(RECORD.to_json())
    assert Record.from_json(sign(raw).decode()) == RECORD
    raw["info"] |= change
    assert Record.from_json(sign(raw).decode()) is None


def test_records_of_other_versions_are_told_from_damaged_ones():
    first = {name: value for name, value in json.loads(RECORD.to_json()).items() if name != "sha256"} | {"version": 1}
    later = sign(first | {"version": RECORD_VERSION + 1}).decode()
    for text in (json.dumps(first), later):
        assert Record.from_json(text) is None and is_of_other_version(text)
    for text in (RECORD.to_json(), json.dumps(first)[:-1], later.replace("train", "tr4in"), "", "[]", "{}", "[" * 100_000):
        assert not is_of_other_version(text)

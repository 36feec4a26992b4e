import json
import re
import tracemalloc
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsac.avatar.draw_rule import ADDED, PIXEL
from gsac.avatar.gsac_file.container import HEADER, MAGIC, MAX_FILE, VERSION, Fault, GsacError, pack, read_bytes, unpack
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes


def fault_of(data):
    with pytest.raises(GsacError) as e:
        RiggedAvatar.from_bytes(data, "some.gsac")
    assert "some.gsac" in str(e.value)
    return e.value.fault


def head_and_body(data):
    head_bytes = HEADER.unpack_from(data)[2]
    start = HEADER.size + head_bytes
    return json.loads(data[HEADER.size:start]), data[start:]


def rebuilt(head, body):
    """A file whose header and checksum are right, whatever its head says."""
    text = head if isinstance(head, bytes) else json.dumps(head).encode()
    text += b" " * (-(HEADER.size + len(text)) % 16)
    rest = text + body
    return HEADER.pack(MAGIC, VERSION, len(text), HEADER.size + len(rest), zlib.crc32(rest), 0) + rest


@pytest.fixture(scope="module")
def data(figure):
    return avatar_bytes(figure)


def test_the_correctives_of_a_body_are_written_and_read_and_move_the_mesh_within_a_tenth_of_a_millimetre(bent_arm, figure, data):
    back, avatar = RiggedAvatar.read(bent_arm.file), bent_arm.avatar
    np.testing.assert_array_equal(back.correctives.start, avatar.correctives.start)
    np.testing.assert_array_equal(back.correctives.joint, avatar.correctives.joint)
    np.testing.assert_allclose(back.posed(bent_arm.pose), bent_arm.vertices, atol=1e-4)
    assert not any(name.startswith("corrective") for name in head_and_body(data)[0]["blocks"]) and figure.correctives is None


def test_what_is_written_is_read(figure, data):
    back = RiggedAvatar.from_bytes(data)
    for name in ("vertices", "faces", "joints", "parents", "skin_index", "expression_start", "expression_vertex"):
        np.testing.assert_array_equal(getattr(back, name), getattr(figure, name))
    assert (back.joint_names, back.expression_names) == (figure.joint_names, figure.expression_names)
    assert (back.poses, back.licence, back.provenance) == (figure.poses, figure.licence, figure.provenance)
    np.testing.assert_allclose(back.skin_weight, figure.skin_weight, atol=2e-5)
    np.testing.assert_allclose(back.expression_delta, figure.expression_delta, atol=1e-5)
    for name, tolerance in (("mu", 2e-5), ("quat", 2e-5), ("log_scale", 3e-4), ("rgb", 5e-4), ("opacity", 1e-5)):
        np.testing.assert_allclose(getattr(back.gaussians, name), getattr(figure.gaussians, name), atol=tolerance)
    np.testing.assert_array_equal(back.gaussians.face, figure.gaussians.face)
    assert [len(level) for level in back.coarser] == [len(level) for level in figure.coarser]
    np.testing.assert_array_equal(back.coarser[1].mu, back.gaussians.mu[::9])
    for name, clip in figure.clips.items():
        assert (back.clips[name].fps, back.clips[name].joints) == (clip.fps, clip.joints)
        np.testing.assert_array_equal(back.clips[name].rotation, clip.rotation)


def test_a_light_is_written_and_read_and_without_one_no_block_is_there(figure, data):
    light = np.linspace(-.4, 1, 12, dtype=np.float32).reshape(4, 3)
    lit = replace(figure, gaussians=replace(figure.gaussians, light=light))
    back = RiggedAvatar.from_bytes(avatar_bytes(lit))
    np.testing.assert_array_equal(back.gaussians.light, light)
    assert avatar_bytes(back) == avatar_bytes(lit)
    assert "light" not in head_and_body(data)[0]["blocks"] and RiggedAvatar.from_bytes(data).gaussians.light is None


def test_the_heights_of_levels_and_the_low_pass_are_written_and_read_and_of_old_files_they_are_the_old_ones(figure, data):
    coarser = [replace(level, max_height_px=height) for level, height in zip(figure.coarser, (270.0, None), strict=True)]
    for rule in (ADDED, PIXEL._replace(px2=.25)):
        written = avatar_bytes(replace(figure, gaussians=replace(figure.gaussians, low_pass=rule), coarser=coarser))
        back = RiggedAvatar.from_bytes(written)
        assert [level.max_height_px for level in (back.gaussians, *back.coarser)] == [None, 270, None]
        assert back.gaussians.low_pass == back.coarser[0].low_pass == rule and avatar_bytes(back) == written
    head, body = head_and_body(data)
    for blend in ({}, {"alpha_max": .9}):
        assert RiggedAvatar.from_bytes(rebuilt(head | {"blend": blend}, body)).gaussians.low_pass == ADDED


def test_same_avatar_same_bytes_and_a_second_round_changes_nothing(figure, data):
    assert avatar_bytes(figure) == data
    assert avatar_bytes(RiggedAvatar.from_bytes(data)) == data


def test_blocks_are_aligned_and_little_endian(data):
    head, body = head_and_body(data)
    assert all(entry["offset"] % 16 == 0 for entry in head["blocks"].values())
    entry = head["blocks"]["gaussian.face"]
    assert int.from_bytes(body[entry["offset"] + 2:entry["offset"] + 4], "little") == 1


def test_the_specification_lists_the_blocks_and_keys_that_are_written(data, bent_arm):
    text = (Path(__file__).parents[3] / "docs" / "gsac-format.md").read_text()
    head, _ = head_and_body(data)
    rows = {name for line in text.splitlines() if line.startswith("| `") for name in re.findall(r"^\| `([^`]+)`", line)}
    written = {*head["blocks"], *head_and_body(bent_arm.file.read_bytes())[0]["blocks"]}
    blocks = {re.sub(r"^clip\.\w+\.", "clip.<name>.", re.sub(r"^gaussian\d+", "gaussian", name)) for name in written}
    assert blocks | {"light"} <= rows
    assert {name for name in rows if "." in name} == blocks
    assert set(head) - {"blocks"} <= rows
    assert {fault.name.lower() for fault in Fault} <= rows


def test_truncated_anywhere_is_a_named_error(data):
    for cut in [*range(64), *range(64, len(data), len(data) // 200), len(data) - 1]:
        assert fault_of(data[:cut]) in (Fault.TRUNCATED, Fault.NOT_GSAC)


def test_trailing_bytes_are_a_named_error(data):
    assert fault_of(data + b"\0") is Fault.OVERSIZED


def test_a_file_too_large_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "large.gsac"
    with open(path, "wb") as f:
        f.truncate(MAX_FILE + 1)
    with pytest.raises(GsacError) as e:
        read_bytes(path)
    assert e.value.fault is Fault.OVERSIZED


def test_another_version_is_a_named_error(data):
    assert fault_of(data[:8] + (2).to_bytes(4, "little") + data[12:]) is Fault.VERSION


def test_another_file_is_a_named_error(data):
    assert fault_of(b"\x89PNG\r\n\x1a\n" + data[8:]) is Fault.NOT_GSAC
    assert fault_of(data.replace(b"\r\n", b"\n", 1)) is Fault.NOT_GSAC


def test_a_flipped_bit_is_a_named_error(data):
    for at in range(HEADER.size, len(data), len(data) // 50):
        assert fault_of(data[:at] + bytes([data[at] ^ 4]) + data[at + 1:]) is Fault.CHECKSUM


@pytest.mark.parametrize("text", [b"", b"[]", b"{", b"[" * 100_000, b'{"blocks":{}, "x":NaN}', b"\xff\xfe",
                                  b'{"blocks":[]}', b'{"n":' + b"9" * 5000 + b"}"])
def test_a_head_that_is_not_ours_is_a_named_error(text):
    assert fault_of(rebuilt(text, b"")) is Fault.HEAD


@pytest.mark.parametrize("change", [
    {"offset": -16}, {"offset": 8}, {"offset": 1 << 60}, {"offset": 1e3}, {"offset": True}, {"offset": None},
    {"shape": [1 << 40, 3]}, {"shape": [-1, 3]}, {"shape": [1 << 26, 1 << 26, 1 << 26, 1 << 26]}, {"shape": "x"},
    {"shape": [2] * 60}, {"shape": [1.5]}, {"dtype": "f128"}, {"dtype": "object"}, {"dtype": None}, {"dtype": []},
    {"scale": 1e308}, {"scale": "1"}, {"scale": 0}])
def test_a_hostile_block_is_a_named_error_and_allocates_nothing(data, change):
    head, body = head_and_body(data)
    head["blocks"]["gaussian.mu"] |= change
    hostile = rebuilt(head, body)
    tracemalloc.start()
    assert fault_of(hostile) is Fault.BLOCK
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4 * len(hostile) + (1 << 20)


def test_overlapping_blocks_are_a_named_error(data):
    head, body = head_and_body(data)
    head["blocks"]["gaussian.rgb"]["offset"] = head["blocks"]["gaussian.mu"]["offset"]
    assert fault_of(rebuilt(head, body)) is Fault.BLOCK


def test_a_missing_block_is_a_named_error(data):
    head, body = head_and_body(data)
    for name in head["blocks"]:
        fewer = head | {"blocks": {k: v for k, v in head["blocks"].items() if k != name}}
        assert fault_of(rebuilt(fewer, body)) is Fault.BLOCK


@pytest.mark.parametrize(("name", "value"), [
    ("rest.faces", 60000), ("skin.index", 200), ("expression.vertex", 60000), ("expression.start", 60000),
    ("gaussian.face", 60000), ("skin.weight", 65535), ("rest.vertices", np.nan), ("gaussian.mu", np.inf),
    ("gaussian.quat", 0)])
def test_a_value_out_of_range_is_a_named_error(data, name, value):
    head, blocks = unpack(data)
    stored = {k: v.copy() for k, v in _stored(data, head).items()}
    stored[name][1 if stored[name].ndim == 1 else (1, slice(None))] = value
    scales = {k: e["scale"] for k, e in head["blocks"].items() if "scale" in e}
    del head["blocks"]
    assert fault_of(pack(head, stored, scales)) is Fault.VALUE


@pytest.mark.parametrize("change", [
    {"joints": None}, {"joints": {"names": ["a"], "parents": [0]}}, {"joints": {"names": [], "parents": []}},
    {"joints": {"names": ["a", "a"], "parents": [-1, 0]}}, {"levels": []}, {"levels": [{"prefix": 3, "count": 1}]},
    {"levels": [{"prefix": "gaussian", "count": 1}]}, {"poses": {"T": {"nobody": [0, 0, 0]}}}, {"poses": {"T": 1}},
    {"clips": [{}]}, {"clips": 3}, {"expressions": "abc"}, {"licence": {"x": 1}}, {"format": "other"}])
def test_a_head_with_other_content_is_a_named_error(data, change):
    head, body = head_and_body(data)
    assert fault_of(rebuilt(head | change, body)) in (Fault.HEAD, Fault.VALUE, Fault.BLOCK)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.data())
def test_fuzz_any_damage_gives_a_named_error_or_a_whole_avatar(data, draws):
    """Damage with a repaired checksum: the reader's own checks have to find it."""
    damaged = bytearray(data)
    for _ in range(draws.draw(st.integers(1, 4))):
        damaged[draws.draw(st.integers(HEADER.size, min(len(data), 6000) - 1))] = draws.draw(st.integers(0, 255))
    damaged[24:28] = zlib.crc32(damaged[HEADER.size:]).to_bytes(4, "little")
    try:
        avatar = RiggedAvatar.from_bytes(bytes(damaged))
    except GsacError:
        return
    assert np.isfinite(avatar.posed(avatar.pose(next(iter(avatar.poses)))) if avatar.poses else avatar.vertices).all()


def _stored(data, head):
    """Name -> array as stored, without scales."""
    plain = {k: {n: v for n, v in e.items() if n != "scale"} for k, e in head["blocks"].items()}
    _, body = head_and_body(data)
    return unpack(rebuilt(head | {"blocks": plain}, body))[1]

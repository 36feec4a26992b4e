"""npz files that somebody brings: whatever they say, a sentence with the bound and never more memory than it."""

import io
import struct
import zipfile

import numpy as np
import pytest

from gsac.avatar import npz
from gsac.avatar.artifacts import ArtifactError, read_arrays
from gsac.avatar.body_file import read_body_file
from gsac.avatar.flame_file import read_flame
from gsac.avatar.lpips import Lpips
from gsac.avatar.motion.files import read_motion
from gsac.avatar.motion.source import MotionError
from gsac.avatar.npz import MOST_BYTES, NpzError, read_npz
from gsac.avatar.weight_file import WeightsError, read_weights
from gsac.pipeline.model_check import check_model
from gsac.stages.contract import BadInput
from gsac.stages.train.checkpoint import Checkpoints
from support import mutate


def packed(members, method=zipfile.ZIP_DEFLATED):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as file:
        for name, content in members.items():
            file.writestr(name, content)
    return out.getvalue()


def with_header(text):
    """An array whose header is that text."""
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode() + bytes(24)


def patched(data, old, new):
    assert old in data
    return data.replace(old, new)


PLAIN = mutate.npy(np.arange(3.0))
WHOLE = packed({"poses.npy": PLAIN})
SHAPE = "{'descr': '<f8', 'fortran_order': False, 'shape': %s, }\n"
HOSTILE = {
    "plain": (PLAIN, "not a zip file"),
    "empty": (b"", "not a zip file"),
    "text": (b"hello", "not a zip file"),
    "cut": (WHOLE[:60], "not a zip file"),
    "encrypted": (patched(WHOLE, b"PK\x01\x02\x14\x03\x14\x00\x00", b"PK\x01\x02\x14\x03\x14\x00\x01"), "poses is encrypted"),
    "method 99": (patched(WHOLE, b"\x14\x03\x14\x00\x00\x00\x08\x00", b"\x14\x03\x14\x00\x00\x00\x63\x00"),
                  "poses is packed by method 99"),
    "no array": (packed({"poses": PLAIN}), "'poses' in it is no array"),
    "folder": (packed({"poses/": b""}), "'poses/' in it is no array"),
    "cut header": (packed({"poses.npy": PLAIN[:30]}), "header"),
    "odd header": (packed({"poses.npy": with_header("{'descr': '<f8', (((")}), "header"),
    "true shape": (packed({"poses.npy": with_header(SHAPE % "(True, 3)")}), r"poses says its shape is \(True, 3\)"),
    "long shape": (packed({"poses.npy": with_header(SHAPE % "(99999999999,)")}), f"at most {MOST_BYTES} numbers"),
    "other shape": (packed({"poses.npy": with_header(SHAPE % "(4,)")}), "poses says 32 bytes and has 24"),
    "no width": (packed({"poses.npy": with_header(SHAPE.replace("<f8", "<U0") % "(1152921504606846976,)")}), "numbers in all"),
    "object": (packed({"poses.npy": with_header(SHAPE.replace("<f8", "|O") % "(3,)")}), "poses is a pickled object"),
    "version 2": (packed({"poses.npy": PLAIN.replace(b"\x01\x00", b"\x02\x00", 1)}), "poses is of npy version 2.0"),
    "flipped": (patched(packed({"poses.npy": PLAIN}, zipfile.ZIP_STORED), np.float64(2).tobytes(), np.float64(3).tobytes()), "CRC"),
    "long list": (WHOLE[:-10] + (5 << 20).to_bytes(4, "little") + WHOLE[-6:],
                  "its list of arrays has 5242880 bytes; at most 4194304 are read"),
    "many": (packed(dict.fromkeys((f"{n}.npy" for n in range(10_001)), PLAIN)), "holds 10001 arrays; at most 10000"),
}


@pytest.fixture(params=HOSTILE)
def hostile(request, tmp_path):
    path = tmp_path / "odd.npz"
    path.write_bytes(HOSTILE[request.param][0])
    return path, HOSTILE[request.param][1]


def test_every_reader_of_npz_files_says_what_is_wrong_with_a_hostile_one(hostile, tmp_path):
    path, why = hostile
    with pytest.raises(NpzError, match=why):
        read_npz(path)
    with pytest.raises(ArtifactError, match=f"odd.npz: not a readable npz .*{why}"):
        read_arrays(path)
    with pytest.raises(MotionError, match="odd.npz: not a readable npz"):
        read_motion(path, [], np.zeros(0), np.zeros((0, 3)))
    with pytest.raises(WeightsError, match="odd.npz cannot be read"):
        read_weights(path)
    with pytest.raises(WeightsError, match="odd.npz cannot be read"):
        Lpips.read("lpips-alex", path)
    for read in (read_body_file, read_flame):
        with pytest.raises(ArtifactError, match="odd.npz: "):
            read(path)
    with pytest.raises(BadInput, match="odd.npz: .*it was not added as mine"):
        check_model("mine", path)
    path.rename(tmp_path / "checkpoint.npz")
    warnings = []
    kept = Checkpoints(tmp_path, lambda finding: warnings.append(finding.message))
    assert kept.read() is None and "training starts anew" in warnings[0]


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(npz, "MOST_BYTES", 1 << 20)
    monkeypatch.setattr(np.lib.format, "read_array", lambda *_, **__: pytest.fail("it was unpacked"))
    (tmp_path / "bomb.npz").write_bytes(mutate.bomb((1 << 18,)))
    assert (tmp_path / "bomb.npz").stat().st_size < 3000
    with pytest.raises(ArtifactError, match=r"bomb\.npz: .*its arrays have 2097\d+ bytes when unpacked; at most 1048576 are read"):
        read_arrays(tmp_path / "bomb.npz")


def test_what_numpy_writes_is_read_as_numpy_reads_it(tmp_path):
    arrays = {"a": np.asfortranarray(np.arange(6.0).reshape(2, 3)), "b": np.array("text"), "c": np.zeros((0, 3), np.float16),
              "d": np.array(True), "e": np.array([b"x", b"yz"]), "f": np.arange(3, dtype=">i4")}
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "a.npz", **arrays)
        found = read_npz(tmp_path / "a.npz")
        with np.load(tmp_path / "a.npz") as theirs:
            assert list(found) == theirs.files
            for name, array in found.items():
                np.testing.assert_array_equal(array, theirs[name], strict=True)
                assert array.flags.writeable and array.flags.f_contiguous == theirs[name].flags.f_contiguous
    assert list(read_npz(tmp_path / "a.npz", ("b", "gone"))) == ["b"]

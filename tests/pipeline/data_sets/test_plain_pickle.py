"""A pickle of arrays is read; one that would run something runs nothing and is refused."""

import os
import pickle

import numpy as np
import pytest

from gsac.pipeline.data_sets.plain_pickle import read_pickle
from gsac.stages.contract import BadInput


@pytest.mark.parametrize("protocol", range(6))
def test_arrays_and_plain_values_are_read_as_numpy_wrote_them(tmp_path, protocol):
    values = {"f": np.arange(6, dtype=np.float32).reshape(2, 3), "t": np.asfortranarray(np.eye(3)[:, :2]), "n": np.float64(2.5),
              "big": np.arange(3, dtype=">i4"), "plain": [1, "text", None, (True, 2.0)]}
    (tmp_path / "a.pkl").write_bytes(pickle.dumps(values, protocol))
    found = read_pickle(tmp_path / "a.pkl")
    for name in "f", "t", "big":
        np.testing.assert_array_equal(found[name], values[name])
    assert found["n"] == 2.5 and found["plain"] == values["plain"]


def test_a_pickle_of_python_2_is_read(tmp_path):
    text = (b"\x80\x02}q\x01U\x01fq\x02cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01b\x87R(K\x01K\x01\x85"
            b"cnumpy\ndtype\nU\x02f8K\x00K\x01\x87R(K\x03U\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb\x89U\x08"
            + np.float64(90).tobytes() + b"tbs.")
    (tmp_path / "a.pkl").write_bytes(text)
    assert read_pickle(tmp_path / "a.pkl")["f"].tolist() == [90.0]


class Calls:
    def __init__(self, what, *arguments):
        self.call = what, arguments

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize("hostile", [
    Calls(os.mkdir, "harm"), Calls(eval, "__import__('os').mkdir('harm')"), Calls(np.load, "x"), Calls(getattr, "x", "upper"),
    np.array([Calls(os.mkdir, "harm")], object), np.array(["text"]), np.array([{}], object), {1, 2},
    np.zeros(2, [("a", "f4")])], ids=lambda value: type(value).__name__)
def test_a_hostile_pickle_runs_nothing_and_is_named(tmp_path, monkeypatch, hostile):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "camera.pkl").write_bytes(pickle.dumps({"camera_f": hostile}, 2))
    with pytest.raises(BadInput, match="camera.pkl"):
        read_pickle(tmp_path / "camera.pkl")
    assert not (tmp_path / "harm").exists()


@pytest.mark.parametrize("content", [b"", b"no pickle", b"\x80\x02]q\x01h\x01a.",  # a list that holds itself
                                     b"(lp0\nP1\n."])
def test_a_damaged_pickle_is_named(tmp_path, content):
    (tmp_path / "camera.pkl").write_bytes(content)
    with pytest.raises(BadInput, match="camera.pkl"):
        read_pickle(tmp_path / "camera.pkl")

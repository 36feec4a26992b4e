"""What the page makes its avatar smaller by: every byte comes back, and what is foretold costs nothing."""

import json
import math
import shutil
import subprocess
import zlib

import numpy as np
import pytest

from gsac.avatar.gsac_file.container import pack, unpack
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.viewer.arrays import RULES, find_arrays, pack_arrays
from gsac.viewer.letters import encode_letters
from gsac.viewer.page import page_bytes
from support.page_modules import copy_modules

needs_node = pytest.mark.skipif(not shutil.which("node"), reason="needs the Debian package nodejs")
LETTERS = """
import { readFileSync } from "node:fs";
import { decodeLetters } from "./letters.js";
console.log(JSON.stringify(JSON.parse(readFileSync(0)).map((text) => [...decodeLetters(text)])));
"""
ARRAYS = """
import { readFileSync } from "node:fs";
import { inflateSync } from "node:zlib";
import { unpackArrays } from "./arrays.js";
import { decodeLetters } from "./letters.js";
const { text, arrays } = JSON.parse(readFileSync(0));
process.stdout.write(unpackArrays(new Uint8Array(inflateSync(decodeLetters(text))), arrays));
"""


def run(folder, script, given):
    """What a script makes of an object, in node."""
    (copy_modules(folder) / "run.mjs").write_text(script)
    done = subprocess.run(["node", "run.mjs"], cwd=folder, input=json.dumps(given).encode(), capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout


def unpacked(folder, container):
    data, arrays = pack_arrays(container)
    return run(folder, ARRAYS, {"text": encode_letters(data), "arrays": arrays})


@needs_node
def test_letters_give_back_bytes_of_any_number(tmp_path):
    rng = np.random.default_rng(0)
    data = [rng.integers(0, 256, n).astype(np.uint8).tobytes() for n in range(60)] + [b"\xff" * n for n in range(30)]
    assert json.loads(run(tmp_path, LETTERS, [encode_letters(one) for one in data])) == [list(one) for one in data]


def test_letters_mean_nothing_to_html_and_are_fewer_than_base64_needs():
    text = encode_letters(np.random.default_rng(0).integers(0, 256, 30000).astype(np.uint8).tobytes())
    assert set(text) <= {chr(code) for code in range(33, 127)} - set("<&\"")
    assert len(text) == math.ceil(30000 * 8 / 13 * 2)


@needs_node
def test_an_avatar_comes_back_byte_by_byte(figure, tmp_path):
    container = avatar_bytes(figure)
    assert unpacked(tmp_path, container) == container


@needs_node
@pytest.mark.parametrize("dtype", ["u1", "<u2", "<u4", "<i2", "<f4", "<f2"])
def test_numbers_that_nothing_foretells_come_back_too(dtype, tmp_path):
    rng = np.random.default_rng(1)
    shapes = {"none": (0, 3), "one": (1,), "column": (301,), "rows": (77, 3), "four": (90, 4), "deep": (5, 3, 9)}
    noise = {name: np.frombuffer(rng.bytes(math.prod(shape) * np.dtype(dtype).itemsize), dtype).reshape(shape)
             for name, shape in shapes.items()}
    rising = np.arange(0, 40000, 7).astype(dtype)
    container = pack({"format": "gsac"}, noise | {"rising": rising, "falling": rising[::-1].copy()})
    assert unpacked(tmp_path, container) == container


@needs_node
def test_quaternions_of_either_sign_and_weights_come_back_and_their_first_column_is_foretold(tmp_path):
    rng = np.random.default_rng(2)
    quat = rng.normal(size=(3000, 4))
    quat = np.rint(32767 * quat / np.linalg.norm(quat, axis=1, keepdims=True)).astype(np.int16)
    weight = rng.multinomial(65535, (.4, .3, .2, .1), 3000).astype(np.uint16)
    container = pack({"format": "gsac"}, {"quat": quat, "weight": weight})
    assert unpacked(tmp_path, container) == container
    data, arrays = pack_arrays(container)
    assert [rule for *_, rule in arrays] == ["turn", "share"]
    plain = len(zlib.compress(container, 9))
    assert len(data) < plain - 3000 * (1 + 1), "a byte of each row, at least"


def test_the_rules_are_those_that_the_page_knows():
    assert set(RULES) == {"", "rise", "share", "turn"}
    for rule in RULES.values():
        left = rule(np.zeros((0, 4), np.uint16))
        assert left is not None and left.shape == (0, 4)


def test_arrays_do_not_overlap_and_a_broken_file_is_packed_as_it_is(figure):
    container = avatar_bytes(figure)
    arrays = find_arrays(container)
    ends = [array.start + array.rows * array.columns * array.width for array in arrays]
    assert len(arrays) == len(unpack(container)[0]["blocks"])
    assert all(end <= after.start for end, after in zip(ends, arrays[1:], strict=False))
    broken = container[:-1]
    data, none = pack_arrays(broken)
    assert none == [] and zlib.decompress(data) == broken


def test_the_same_avatar_gives_the_same_page(figure):
    container = avatar_bytes(figure)
    assert page_bytes(container) == page_bytes(container)

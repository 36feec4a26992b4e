"""The readers of `.gsac` in Python, C# (Mono) and JavaScript (node): the same numbers, the same named faults."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsac import unity
from gsac.avatar.gsac_file.container import GsacError
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes
from support import hostile, mono
from support.page_modules import copy_modules

JS = r"""
import fs from "node:fs";
import path from "node:path";
import { GsacError } from "./container.js";
import { readAvatar } from "./reader.js";
for (const name of fs.readdirSync(process.argv[2])) {
  const bytes = fs.readFileSync(path.join(process.argv[2], name));
  let word = "ok";
  try {
    readAvatar(new Uint8Array(bytes).buffer);
  } catch (e) {
    if (!(e instanceof GsacError)) throw e;
    word = e.fault;
  }
  console.log(name, word);
}
"""


def python_words(files):
    words = {}
    for name, data in files.items():
        try:
            RiggedAvatar.from_bytes(data)
            words[name] = "ok"
        except GsacError as e:
            words[name] = e.fault.name.lower()
    return words


def words_of(text):
    return dict(line.split() for line in text.splitlines())


def csharp_words(folder, tmp_path):
    if mono.missing_packages():
        pytest.skip(f"needs the Debian packages {', '.join(mono.missing_packages())}")
    core = Path(unity.__file__).parent / "Runtime" / "Core"
    programs = mono.HERE / "programs"
    exe = mono.compile_csharp([*core.glob("*.cs"), programs / "Dump.cs", programs / "Read.cs"], tmp_path / "read.exe")
    return words_of(mono.run(exe, "faults", folder, heap="48m"))


def javascript_words(folder, tmp_path):
    if not shutil.which("node"):
        pytest.skip("needs node")
    modules = tmp_path / "modules"
    modules.mkdir()
    script = copy_modules(modules) / "read.js"
    script.write_text(JS)
    done = subprocess.run(["node", "--max-old-space-size=64", str(script), str(folder)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return words_of(done.stdout)


READERS = {"csharp": csharp_words, "javascript": javascript_words}


@pytest.fixture(scope="module")
def collection(figure):
    """Name -> (bytes, right words), the damaged and hostile files."""
    return hostile.files(avatar_bytes(figure))


@pytest.fixture(scope="module")
def fuzzed(figure):
    data = avatar_bytes(replace(figure, gaussians=replace(figure.gaussians, light=np.full((4, 3), .5, np.float32))))
    return hostile.fuzzed(data, 300) | hostile.rewritten(data, 300)


def folder_of(files, folder):
    folder.mkdir()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return folder


def wrong(words, collection):
    assert words.keys() == collection.keys()
    return {name: (word, collection[name][1]) for name, word in words.items() if word not in collection[name][1]}


def test_python_names_the_fault_of_every_hostile_file(collection):
    assert wrong(python_words({name: data for name, (data, _) in collection.items()}), collection) == {}


@pytest.mark.parametrize("reader", READERS)
def test_the_reader_names_the_fault_of_every_hostile_file_in_little_memory(reader, collection, tmp_path):
    folder = folder_of({name: data for name, (data, _) in collection.items()}, tmp_path / "files")
    assert wrong(READERS[reader](folder, tmp_path), collection) == {}


@pytest.mark.parametrize("reader", READERS)
def test_fuzz_a_file_that_python_refuses_the_reader_refuses_and_none_crashes_it(reader, fuzzed, tmp_path):
    words = READERS[reader](folder_of(fuzzed, tmp_path / "files"), tmp_path)
    expected = python_words(fuzzed)
    differ = {name: (words[name], word) for name, word in expected.items() if (words[name] == "ok") != (word == "ok")}
    assert differ == {}
    assert 0.2 < sum(word != "ok" for word in expected.values()) / len(expected) < 0.99, "some of both"

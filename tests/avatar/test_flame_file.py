import pickle

import numpy as np
import pytest

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.flame_file import ARRAYS, read_flame, read_flame_points


@pytest.fixture(scope="module")
def arrays():
    rng = np.random.default_rng(0)
    made = {name: rng.normal(0, 0.01, shape).astype(np.float32) for name, shape in ARRAYS.items()}
    made["f"] = rng.integers(0, 5023, (9976, 3)).astype(np.uint32)
    made["weights"] = np.full((5023, 5), 0.2)
    made["kintree_table"] = np.array([[2**32 - 1, 0, 1, 1, 1], [0, 1, 2, 3, 4]], np.int64)
    return made


def written(tmp_path, arrays):
    np.savez(tmp_path / "FLAME_NEUTRAL.npz", **arrays)
    return tmp_path / "FLAME_NEUTRAL.npz"


def test_a_file_of_the_official_shapes_is_read(tmp_path, arrays):
    flame = read_flame(written(tmp_path, arrays))
    assert flame.parents.tolist() == [-1, 0, 1, 1, 1]
    assert flame.shapedirs.shape == (5023, 3, 300) and flame.exprdirs.shape == (5023, 3, 100)
    expected = arrays["v_template"] + 2 * arrays["shapedirs"][:, :, 1] - arrays["shapedirs"][:, :, 300]
    np.testing.assert_allclose(flame.rest([0, 2], [-1]), expected, atol=1e-6)


@pytest.mark.parametrize("name", list(ARRAYS))
def test_an_array_that_is_missing_or_misshapen_is_named(tmp_path, arrays, name):
    wrong = arrays | {name: arrays[name][:-1]}
    with pytest.raises(ArtifactError, match=f"array {name} has shape .* expected"):
        read_flame(written(tmp_path, wrong))
    del wrong[name]
    with pytest.raises(ArtifactError, match=f"array {name} is missing"):
        read_flame(written(tmp_path, wrong))


def test_pickles_are_refused_without_being_read(tmp_path):
    with pytest.raises(ArtifactError, match="run code"):
        read_flame(tmp_path / "generic_model.pkl")
    (tmp_path / "kept-by-name").write_bytes(pickle.dumps({"v_template": 0}))
    for read in (read_flame, read_flame_points):
        with pytest.raises(ArtifactError, match="run code"):
            read(tmp_path / "kept-by-name")


def test_a_name_without_suffix_is_as_good(tmp_path, arrays):
    """The model store keeps files under the user's own names."""
    assert read_flame(written(tmp_path, arrays).rename(tmp_path / "my-head")).faces.shape == (9976, 3)


def test_where_the_networks_points_lie_is_read_and_checked(tmp_path, arrays):
    path = tmp_path / "mediapipe_landmark_embedding.npz"
    good = {"landmark_indices": np.array([3, 470, 7]), "lmk_face_idx": np.array([5, 6, 9975]),
            "lmk_b_coords": np.full((3, 3), 1 / 3)}
    np.savez(path, **good)
    points, flame = read_flame_points(path), read_flame(written(tmp_path, arrays))
    assert points.index.tolist() == [3, 7]  # the iris is of no head
    np.testing.assert_allclose(points.on(flame, flame.v_template)[1], flame.v_template[flame.faces[9975]].mean(0), atol=1e-6)
    wrong = {"lmk_b_coords": np.ones((3, 3)), "lmk_face_idx": np.array([1, 2, 9976]), "landmark_indices": np.arange(4)}
    for name, array in wrong.items():
        np.savez(path, **good | {name: array})
        with pytest.raises(ArtifactError, match=name):
            read_flame_points(path)


def test_pickled_objects_inside_are_refused(tmp_path, arrays):
    with pytest.raises(ArtifactError, match="array v_template is a pickled object"):
        read_flame(written(tmp_path, arrays | {"v_template": np.array([{}], object)}))


@pytest.mark.parametrize(("name", "array", "why"), [
    ("v_template", np.full((5023, 3), "x"), "holds <U1, expected numbers"), ("f", np.zeros((9976, 3), bool), "holds bool"),
    ("kintree_table", np.array([[0, 4, 3, 2, 1], range(5)]), "names a parent that is no earlier joint")])
def test_arrays_of_another_kind_are_named(tmp_path, arrays, name, array, why):
    with pytest.raises(ArtifactError, match=f"array {name} {why}"):
        read_flame(written(tmp_path, arrays | {name: array}))


def test_faces_and_weights_must_make_sense(tmp_path, arrays):
    with pytest.raises(ArtifactError, match="names vertex 5023"):
        read_flame(written(tmp_path, arrays | {"f": np.full((9976, 3), 5023)}))
    with pytest.raises(ArtifactError, match="sum to one"):
        read_flame(written(tmp_path, arrays | {"weights": np.full((5023, 5), 0.1)}))

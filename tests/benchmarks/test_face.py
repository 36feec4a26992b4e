"""The made-up people on whom the face's table is measured, and the committed table on people whom it never saw."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.artifacts import read_arrays
from gsac.avatar.body import Body
from gsac.avatar.facemesh import MODELS, Face
from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.avatar.region import Region
from gsac.benchmarks.face import people as face_people
from gsac.benchmarks.face.drawing import Head, Portrait
from gsac.benchmarks.face.people import DRAWN, Reader, sample_expression
from gsac.benchmarks.perception import ACTIONS
from gsac.stages.face.actions import TABLE, Actions, smooth, smoothing_sigma, solve
from gsac.stages.face.config import FaceConfig
from gsac.stages.face.landmarks import align, read_averaged
from gsac.turntable.motion import make_expressions
from gsac.turntable.options import TurntableOptions
from support.scripts import script

face_actions = script("face_actions")

UNKNOWN = (5001, 5002)
FILMED = (5002, 5003, 5004)
LENGTH, RATE = 28, 10.0
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def store() -> Path:
    root = Path(os.environ.get("GSAC_CACHE", "~/.cache/gsac")).expanduser()
    try:
        for name in {*MODELS, *FaceConfig().models()}:
            model_path(name, root)
    except ModelMissingError as missing:
        pytest.skip(str(missing))
    return root


@pytest.fixture(scope="module")
def people(tmp_path_factory, store) -> list[dict]:
    """One of the turntable and a drawn one, a few frames each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(face_people, "FRAMES", 18)
        patch.setattr(face_people, "DRAWN", UNKNOWN[1])
        reader = Reader(store)
        return [reader.read(seed, tmp_path_factory.mktemp("people")) for seed in UNKNOWN]


def drawn_clip(reader: Reader, mirror: np.ndarray, seed: int) -> dict[str, np.ndarray]:
    """A drawn head that turns past the camera, 50 to 110 px between the eyes' outer corners, with a truth clip's expressions."""
    body, rng = Body.load(), np.random.default_rng([seed, 78])
    head, share = Head(body, rng.normal(0, 1, body.num_figure), Portrait.sample(rng)), rng.uniform(0.45, 1)
    expression = make_expressions(body, TurntableOptions(seed=seed, frames=90), np.random.default_rng([seed, 2]))[:LENGTH]
    nod = 0.1 * np.sin(np.arange(LENGTH) / 5 + seed) - 0.05
    turn = Rotation.from_euler("YX", np.stack([np.linspace(-0.95, 0.95, LENGTH), nod], 1)).as_matrix()
    landmarks = np.full((LENGTH, 468, 3), np.nan)
    for t in range(LENGTH):
        image = head.draw(turn[t], expression[t], share, rng)
        face = reader.mesh.find(image, Region((len(image) / 2,) * 2, float(len(image))))
        if face is not None:
            landmarks[t] = read_averaged(reader.network, image, face.points, mirror).points
    return {"landmarks": landmarks, "expression": expression}


def aligned(landmarks: np.ndarray, actions: Actions) -> tuple[np.ndarray, np.ndarray]:
    """landmarks: (T, 468, 3) px. The points (T, 468, 3) m and where the face looks (T, 3)."""
    faces = [Face(points.astype(float), 1.0) for points in landmarks]
    return tuple(np.array(a) for a in zip(*[align(f.points, actions.neutral, f.facing()) for f in faces], strict=True))


def test_nobody_is_measured_on_whom_truth_clips_show():
    assert not set(face_actions.SEEDS) & {*range(100), *UNKNOWN} and min(face_actions.SEEDS) < DRAWN <= max(face_actions.SEEDS)


def test_expressions_are_in_range_and_now_and_then_at_rest():
    names = Body.load().expression_names
    rng = np.random.default_rng(0)
    many = np.array([sample_expression(names, rng) for _ in range(300)])
    assert many.min() == 0 and many.max() <= 1 and 10 < (~many.any(axis=1)).sum() < 60
    assert (many > 0).any(axis=0).all()


def test_the_large_face_of_someone_it_never_saw_is_read(people):
    actions, config = Actions.load(), FaceConfig()
    person = people[0]
    seen = np.isfinite(person["landmarks"][:, 0, 0])
    assert seen.sum() >= 14
    said, _ = solve(*aligned(person["landmarks"][seen], actions), actions, config.sparsity, config.doubt)
    true = person["expression"][seen]
    for what, least in (("jaw", 0.9), ("blink", 0.8), ("smile", 0.8)):
        columns = [actions.names.index(name) for name in ACTIONS[what]]
        assert np.corrcoef(said[:, columns].mean(1), true[:, columns].mean(1))[0, 1] >= least, what


def test_faces_of_another_renderer_are_read_as_well(store):
    """Three clips of people whom the table never saw, each less its own mean: what moves is right, brows too."""
    actions, config, reader = Actions.load(), FaceConfig(), Reader(store)
    said, true = [], []
    for seed in FILMED:
        clip = drawn_clip(reader, actions.mirror, seed)
        seen = np.isfinite(clip["landmarks"][:, 0, 0])
        assert seen.sum() >= 24
        times = np.flatnonzero(seen) / RATE
        points, looks = aligned(clip["landmarks"][seen], actions)
        found, _ = solve(points, looks, actions, config.sparsity, config.doubt, times, config.smooth_brow)
        sigma = smoothing_sigma(actions.names, config.smooth_lids, config.smooth, config.smooth_slow, 1 / RATE)
        found = smooth(found, times, sigma)
        said.append(found - found.mean(axis=0))
        true.append(clip["expression"][seen] - clip["expression"][seen].mean(axis=0))
    said, true = np.concatenate(said), np.concatenate(true)
    for members, least in ((ACTIONS["jaw"], 0.8), (ACTIONS["blink"], 0.8), (ACTIONS["smile"], 0.8), (ACTIONS["brow"], 0.6),
                           (("browDownLeft", "browDownRight"), 0.6)):
        columns = [actions.names.index(name) for name in members]
        assert np.corrcoef(said[:, columns].mean(1), true[:, columns].mean(1))[0, 1] >= least, members


def test_a_table_of_a_few_looks_has_the_shipped_ones_arrays(people):
    small, shipped = face_actions.measure(people), read_arrays(TABLE)
    assert {name: (a.shape, a.dtype) for name, a in small.items()} == {name: (a.shape, a.dtype) for name, a in shipped.items()}
    assert (small["mirror"] != shipped["mirror"]).sum() <= 4
    assert np.abs(small["neutral"] - shipped["neutral"]).max() < 0.02

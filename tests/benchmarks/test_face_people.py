"""The people that the face's table is measured on, and what the shipped table makes of one whom it never saw."""

import os
from pathlib import Path

import numpy as np
import pytest
from gsac.avatar.artifacts import read_arrays
from gsac.avatar.body import Body
from gsac.avatar.facemesh import MODELS, Face
from gsac.avatar.models import ModelMissingError, model_path
from gsac.benchmarks import face_people
from gsac.benchmarks.face_actions import SEEDS, measure
from gsac.benchmarks.face_people import DRAWN, Reader, any_expression
from gsac.benchmarks.perception import ACTIONS
from gsac.stages.face.actions import TABLE, Actions, solve
from gsac.stages.face.config import FaceConfig
from gsac.stages.face.landmarks import align

UNKNOWN = (5001, 5002)
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def people(tmp_path_factory) -> list[dict]:
    """One of the turntable and a drawn one, a few frames each."""
    root = Path(os.environ.get("GSAC_CACHE", "~/.cache/gsac")).expanduser()
    try:
        for name in MODELS:
            model_path(name, root)
    except ModelMissingError as missing:
        pytest.skip(str(missing))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(face_people, "FRAMES", 18)
        patch.setattr(face_people, "DRAWN", UNKNOWN[1])
        reader = Reader(root)
        return [reader.person(seed, tmp_path_factory.mktemp("people")) for seed in UNKNOWN]


def test_nobody_is_measured_on_whom_truth_clips_show():
    assert not set(SEEDS) & {*range(100), *UNKNOWN} and min(SEEDS) < DRAWN <= max(SEEDS)


def test_expressions_are_in_range_and_now_and_then_at_rest():
    names = Body.load().expression_names
    rng = np.random.default_rng(0)
    many = np.array([any_expression(names, rng) for _ in range(300)])
    assert many.min() == 0 and many.max() <= 1 and 10 < (~many.any(axis=1)).sum() < 60
    assert (many > 0).any(axis=0).all()


def test_the_large_face_of_someone_it_never_saw_is_read(people):
    actions, config = Actions.load(), FaceConfig()
    person = people[0]
    seen = np.isfinite(person["landmarks"][:, 0, 0])
    faces = [Face(p.astype(float), 1.0) for p in person["landmarks"][seen]]
    assert len(faces) >= 14
    points, looks = (np.array(a) for a in zip(*[align(f.points, actions.neutral, f.facing()) for f in faces], strict=True))
    said, _ = solve(points, looks, actions, config.sparsity, config.doubt)
    true = person["expression"][seen]
    for what, least in (("jaw", 0.9), ("blink", 0.8), ("smile", 0.8)):
        columns = [actions.names.index(name) for name in ACTIONS[what]]
        assert np.corrcoef(said[:, columns].mean(1), true[:, columns].mean(1))[0, 1] >= least, what


def test_a_table_of_a_few_looks_has_the_shipped_ones_arrays(people):
    small, shipped = measure(people), read_arrays(TABLE)
    assert {name: (a.shape, a.dtype) for name, a in small.items()} == {name: (a.shape, a.dtype) for name, a in shipped.items()}
    assert (small["mirror"] != shipped["mirror"]).sum() <= 4
    assert np.abs(small["neutral"] - shipped["neutral"]).max() < 0.02

import os
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.artifacts import KEYPOINT_SHAPES, Clip, read_arrays, write_arrays
from gsac.avatar.body import Body
from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.avatar.wholebody import FACE
from gsac.benchmarks.perception import run_face, run_keypoints, score_expression, video_frames, write_split
from gsac.stages.contract import Job, StageError
from gsac.stages.face import STAGE
from gsac.stages.face.config import FaceConfig
from gsac.stages.face.stage import run
from support.artifacts import blank

FOOTAGE = Path(__file__).resolve().parents[4] / "shared" / "footage"
AT_REST = "The face was never seen from the front; the avatar's face stays at rest."


@pytest.fixture(scope="module")
def store() -> Path:
    root = Path(os.environ.get("GSAC_CACHE", "~/.cache/gsac")).expanduser()
    try:
        for name in STAGE.models(FaceConfig()):
            model_path(name, root)
    except ModelMissingError as missing:
        pytest.skip(str(missing))
    return root


def need(path: Path) -> Path:
    if not path.exists():
        pytest.skip(f"footage {path.parent.name}/{path.name} is not here")
    return path


def unseen(folder: Path, frames: int, said: int, score: float = 0.0) -> dict[str, Path]:
    """Ports of a clip of grey frames whose keypoints, of `said` frames, saw no face from the front; score: of its points."""
    ports = write_split(iter([np.full((64, 48, 3), 120, np.uint8)] * frames), folder / "split")
    ports["keypoints/keypoints.npz"] = folder / "keypoints.npz"
    scores = np.zeros((said, 133), np.float32)
    scores[:, FACE] = score
    write_arrays(folder / "keypoints.npz", **blank(KEYPOINT_SHAPES, T=said) | {
        "score": scores, "world": np.full((said, 133, 3), np.nan), "face_mesh": np.full((said, 468, 3), np.nan)})
    return ports


@pytest.mark.parametrize(("score", "said"), [(0.0, []), (0.5, [AT_REST])])
def test_a_face_that_is_never_seen_rests_and_is_named_where_keypoints_has_not_said_so(tmp_path, store, score, said):
    face, notes = run_face(unseen(tmp_path, 3, 3, score), tmp_path, store)
    assert not face["valid"].any() and face["expression"].shape == (3, 52) and not face["expression"].any()
    assert np.isnan(face["landmarks"]).all() and not face["shape"].any()
    assert not {"head_vertices", "rest_expression"} & face.keys()
    assert notes["warnings"] == said


def test_keypoints_of_another_clip_are_refused(tmp_path, store):
    with pytest.raises(StageError, match="keypoints.npz holds 3 frames, and the clip has 2"):
        run_face(unseen(tmp_path, 2, 3), tmp_path, store)


@pytest.mark.footage
@pytest.mark.slow
def test_actions_of_the_rendered_clip_are_read_from_its_small_face(tmp_path, store):
    truth = read_arrays(need(FOOTAGE / "truth-a" / "truth.npz"))
    assert tuple(str(n) for n in truth["expr_names"]) == Body.load().expression_names
    frames = list(video_frames(need(FOOTAGE / "truth-a" / "clip.mp4")))
    near = [t for t in range(60) if min(t, 60 - t) <= 13]
    _, _, ports = run_keypoints(iter([frames[t] for t in near]), tmp_path, store)
    face, _ = run_face(ports, tmp_path, store)
    figures = score_expression(face, {**truth, "exprs": truth["exprs"][near]})
    assert figures["face_valid"] >= 13
    assert figures["jaw"] >= 0.9 and figures["blink"] >= 0.8 and figures["smile"] >= 0.8 and figures["brow"] >= 0.6
    assert figures["actions_at_rest_mean"] < 0.06


@pytest.mark.footage
def test_photos_have_no_time_so_an_unseen_face_rests_at_once(tmp_path, store):
    frames = list(video_frames(need(FOOTAGE / "truth-a" / "clip.mp4")))
    _, _, ports = run_keypoints(iter([frames[3], frames[30]]), tmp_path, store)
    clip = Clip.read(ports["split/clip.json"])
    clip.timestamps_s = clip.fps = None
    clip.write(ports["split/clip.json"])
    face, notes = run_face(ports, tmp_path, store)
    assert face["valid"].tolist() == [True, False]
    np.testing.assert_array_equal(face["rest_expression"], face["expression"][0], err_msg="one look is all that is known")
    assert not face["expression"][1].any() and np.isfinite(face["landmarks"][0]).all()
    away = np.linalg.norm(face["head_vertices"] - face["head_template"], axis=1)  # the open body's head, as the person has it
    assert 1e-4 < away.mean() < 0.02 and face["head_faces"].max() < len(away) and face["head_eyes"].shape == (2, 3)
    assert notes["warnings"] == []


@pytest.mark.footage
def test_a_brought_flame_head_joins_the_face(tmp_path, store, flame_file, flame_points_file):
    """Its own files lie in the store under names without suffix, as the user's do."""
    frames = list(video_frames(need(FOOTAGE / "truth-a" / "clip.mp4")))
    _, _, ports = run_keypoints(iter([frames[3], frames[30]]), tmp_path, store)
    for name, file in (("mine", flame_file), ("flame-points", flame_points_file)):
        (tmp_path / name).write_bytes(file.read_bytes())
    models = {name: model_path(name, store) for name in STAGE.models(FaceConfig())}
    models |= {name: tmp_path / name for name in ("mine", "flame-points")}
    (tmp_path / "out").mkdir()
    run(Job(ports, tmp_path / "out", FaceConfig(flame="mine"), models=models))
    STAGE.outputs[0].check(tmp_path / "out" / "face.npz")
    face = read_arrays(tmp_path / "out" / "face.npz")
    assert face["head_vertices"].shape == face["head_template"].shape == (5023, 3) and face["head_faces"].shape == (9976, 3)
    away = np.linalg.norm(face["head_vertices"] - face["head_template"], axis=1)
    assert 1e-5 < away.mean() < 0.02
    assert face["flame_expression"].shape == (2, 50) and face["flame_expression"][0].any()

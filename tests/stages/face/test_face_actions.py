import numpy as np
import pytest
from gsac.avatar.body import Body
from gsac.avatar.facemesh import IBUG68
from gsac.stages.contract import BadInput
from gsac.stages.face.actions import Actions, fill, smooth, solve, view_terms
from gsac.stages.face.config import FaceConfig
from gsac.stages.face.landmarks import align

CONFIG = FaceConfig()


@pytest.fixture(scope="module")
def actions() -> Actions:
    return Actions.load()


def looking(yaw: np.ndarray, pitch: float = -0.1) -> np.ndarray:
    return np.stack([np.sin(yaw) * np.cos(pitch), np.full_like(yaw, np.sin(pitch)), np.cos(yaw) * np.cos(pitch)], axis=-1)


def fit(points, weight, direction, actions, eyes_px=70.0):
    c = CONFIG
    size = np.full(len(points), eyes_px)
    return solve(points, weight, direction, size, actions, c.ridge, c.sparsity, c.symmetry, c.noise, c.identity)


def clip_of(actions: Actions, c: np.ndarray, offset: np.ndarray, seed: int = 0) -> tuple[np.ndarray, ...]:
    """Aligned points, weights and directions of a turning head with these actions, the network's wavering and noise."""
    random = np.random.default_rng(seed)
    direction = looking(np.linspace(-0.8, 0.8, len(c)))
    view = np.tensordot(view_terms(direction), actions.view, axes=1)
    waver = np.tensordot(random.normal(0, 1, (len(c), len(actions.modes))), actions.modes, axes=1)
    points = actions.neutral + offset + (np.tensordot(c, actions.response, axes=1) + view + waver) / 1e3
    return points + random.normal(0, 2e-4, points.shape), np.ones(points.shape[:2]), direction


def test_the_table_speaks_of_the_open_bodys_actions_and_is_symmetric(actions):
    assert actions.names == Body.load().expression_names
    assert (actions.mirror[actions.mirror] == np.arange(468)).all()
    left, right = (actions.names.index(f"mouthSmile{side}") for side in ("Left", "Right"))
    np.testing.assert_allclose(actions.response[left][actions.mirror] * [-1, 1, 1], actions.response[right], atol=0.02)


def test_the_68_points_mirror_as_ibugs_do(actions):
    contour, brows, nose = range(16, -1, -1), range(26, 16, -1), [27, 28, 29, 30, 35, 34, 33, 32, 31]
    eyes = [45, 44, 43, 42, 47, 46, 39, 38, 37, 36, 41, 40]
    mouth = [54, 53, 52, 51, 50, 49, 48, 59, 58, 57, 56, 55, 64, 63, 62, 61, 60, 67, 66, 65]
    np.testing.assert_array_equal(actions.mirror[IBUG68], IBUG68[[*contour, *brows, *nose, *eyes, *mouth]])


def test_known_actions_are_found_again_and_no_other(actions):
    t = np.arange(40)
    c = np.zeros((40, len(actions.names)))
    for name, rate in (("jawOpen", 0.5), ("mouthSmileLeft", 0.3), ("mouthSmileRight", 0.3), ("eyeBlinkLeft", 0.9),
                       ("eyeBlinkRight", 0.9), ("browInnerUp", 0.2)):
        c[:, actions.names.index(name)] = np.clip(np.sin(rate * t + len(name)), 0, 1)
    got, _ = fit(*clip_of(actions, c, np.zeros((468, 3))), actions)
    moved = np.flatnonzero(c.any(axis=0))
    for k in moved:
        assert np.corrcoef(got[:, k], c[:, k])[0, 1] > 0.75, actions.names[k]
    for name in ("jawOpen", "mouthSmileLeft", "browInnerUp"):
        k = actions.names.index(name)
        assert np.corrcoef(got[:, k], c[:, k])[0, 1] > 0.88, name
    assert np.delete(got, moved, axis=1).mean() < 0.1 * got[:, moved].mean()
    assert got.min() >= 0 and got.max() <= 1


def test_a_persons_own_resting_face_is_not_read_as_expression(actions):
    shape = np.random.default_rng(3).normal(0, 1, len(actions.modes))
    offset = np.tensordot(shape, actions.modes, axes=1) / 1e3 + 0.7 * actions.response[
        actions.names.index("mouthFrownLeft")] / 1e3
    got, found = fit(*clip_of(actions, np.zeros((30, len(actions.names))), offset), actions)
    assert got.mean() < 0.01
    assert np.sqrt(((found - offset)[..., :2] ** 2).mean()) < 0.5 * np.sqrt((offset[..., :2] ** 2).mean())


def test_brows_that_are_painted_high_are_the_persons_own_and_not_raised(actions):
    """The same raise in all frames, whatever the view, is how the person looks."""
    up = actions.names.index("browInnerUp")
    painted = 0.8 * actions.response[up] / 1e3
    c = np.zeros((30, len(actions.names)))
    c[::3, up] = 0.6
    got, _ = fit(*clip_of(actions, c, painted), actions)
    assert got[c[:, up] == 0, up].mean() < 0.25 and np.corrcoef(got[:, up], c[:, up])[0, 1] > 0.85


def test_brows_of_a_small_face_are_believed_less_and_all_else_as_much(actions):
    c = np.zeros((30, len(actions.names)))
    up, jaw = (actions.names.index(name) for name in ("browInnerUp", "jawOpen"))
    c[::3, up], c[::2, jaw] = 0.5, 0.7
    large, small = (fit(*clip_of(actions, c, np.zeros((468, 3))), actions, eyes_px)[0] for eyes_px in (60.0, 30.0))
    assert small[:, up].mean() < 0.9 * large[:, up].mean()
    np.testing.assert_allclose(small[:, jaw], large[:, jaw], atol=0.05)


def test_hidden_points_do_not_count(actions):
    c = np.zeros((20, len(actions.names)))
    c[::2, actions.names.index("jawOpen")] = 0.8
    points, weight, direction = clip_of(actions, c, np.zeros((468, 3)))
    hidden = np.random.default_rng(0).permutation(468)[:150]
    points[:, hidden] += 0.05
    weight[:, hidden] = 0
    got, _ = fit(points, weight, direction, actions)
    assert np.corrcoef(got[:, actions.names.index("jawOpen")], c[:, actions.names.index("jawOpen")])[0, 1] > 0.95


def test_align_undoes_a_heads_turn_size_and_place(actions):
    yaw, pitch = 0.5, -0.2
    turn = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]]) @ np.array(
        [[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    pixels = actions.neutral @ turn.T * 700 * [1, -1, -1] + [300, 200, 0]
    points, looks = align(pixels, actions.neutral, np.ones(468))
    np.testing.assert_allclose(points, actions.neutral, atol=1e-9)
    np.testing.assert_allclose(looks, turn @ [0, 0, 1], atol=1e-9)


def test_unseen_frames_fall_back_to_rest():
    valid = np.array([True, True, False, False, False])
    out = fill(np.array([[0.2], [0.8]]), valid, np.arange(5) / 5, 0.2)
    np.testing.assert_allclose(out[:, 0], [0.2, 0.8, 0.8 / np.e, 0.8 / np.e**2, 0.8 / np.e**3])
    assert fill(np.array([[0.2], [0.8]]), valid, None, 0.2)[2:].max() == 0


def test_smoothing_keeps_a_constant_and_calms_a_flicker():
    times = np.arange(10) / 30
    assert smooth(np.full((10, 2), 0.3), times, 0.04) == pytest.approx(np.full((10, 2), 0.3))
    flicker = (np.arange(10) % 2)[:, None].astype(float)
    assert np.ptp(smooth(flicker, times, 0.04)[2:8]) < 0.2


@pytest.mark.parametrize(("name", "value"), [("angle", 60.0), ("threshold", 0.0), ("ridge", 0.0), ("smooth", -1.0)])
def test_a_wrong_parameter_is_named(name, value):
    with pytest.raises(BadInput, match=f"face.{name} is"):
        FaceConfig(**{name: value}).check()

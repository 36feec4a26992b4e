import numpy as np
import pytest

from gsac.avatar.body import Body
from gsac.avatar.facemesh import IBUG68
from gsac.stages.contract import BadInput
from gsac.stages.face.actions import Actions, fill_unseen, smooth, smoothing_sigma, solve, view_terms, yaw_terms
from gsac.stages.face.config import FaceConfig
from gsac.stages.face.landmarks import align

CONFIG = FaceConfig()


@pytest.fixture(scope="module")
def actions() -> Actions:
    return Actions.load()


def looking(yaw: np.ndarray, pitch: float = -0.1) -> np.ndarray:
    return np.stack([np.sin(yaw) * np.cos(pitch), np.full_like(yaw, np.sin(pitch)), np.cos(yaw) * np.cos(pitch)], axis=-1)


def fit(points, direction, actions, doubt=CONFIG.doubt):
    return solve(points, direction, actions, CONFIG.sparsity, doubt)


def clip_of(actions: Actions, c: np.ndarray, own: np.ndarray, noise: float = 2e-4) -> tuple[np.ndarray, np.ndarray]:
    """Aligned points and directions of a turning head with these actions, own rest (468, 3) m and noise, m."""
    direction = looking(np.linspace(-0.8, 0.8, len(c)))
    view = np.tensordot(view_terms(direction), actions.view, axes=1)
    shown = np.einsum("tk,te,kelc->tlc", yaw_terms(direction), c, actions.response)
    points = actions.neutral + own + (shown + view) / 1e3
    return points + np.random.default_rng(0).normal(0, noise, points.shape), direction


def test_the_table_speaks_of_the_open_bodys_actions_and_is_symmetric(actions):
    assert actions.names == Body.load().expression_names
    assert (actions.mirror[actions.mirror] == np.arange(468)).all()
    left, right = (actions.names.index(f"mouthSmile{side}") for side in ("Left", "Right"))
    front = actions.response[0]
    np.testing.assert_allclose(front[left][actions.mirror] * [-1, 1, 1], front[right], atol=0.02)


def test_the_68_points_mirror_as_ibugs_do(actions):
    contour, brows, nose = range(16, -1, -1), range(26, 16, -1), [27, 28, 29, 30, 35, 34, 33, 32, 31]
    eyes = [45, 44, 43, 42, 47, 46, 39, 38, 37, 36, 41, 40]
    mouth = [54, 53, 52, 51, 50, 49, 48, 59, 58, 57, 56, 55, 64, 63, 62, 61, 60, 67, 66, 65]
    np.testing.assert_array_equal(actions.mirror[IBUG68], IBUG68[[*contour, *brows, *nose, *eyes, *mouth]])


def test_in_the_channels_the_points_own_noise_is_no_louder_than_the_networks(actions):
    """White noise of the wavering's size is at least as loud there: the channels avoid what wavers together."""
    random = np.random.default_rng(0).normal(0, 1, (50, 468, 3)) * actions.wavering
    heard = np.tensordot(random, actions.channels, ([1, 2], [1, 2]))
    assert heard.std() > 0.8


def test_known_actions_are_found_again_and_no_other(actions):
    t = np.arange(40)
    c = np.zeros((40, len(actions.names)))
    for name, rate in (("jawOpen", 0.5), ("mouthSmileLeft", 0.3), ("mouthSmileRight", 0.3), ("eyeBlinkLeft", 0.9),
                       ("eyeBlinkRight", 0.9), ("browInnerUp", 0.2), ("browOuterUpLeft", 0.2), ("browOuterUpRight", 0.2)):
        c[:, actions.names.index(name)] = np.clip(np.sin(rate * t + len(name[:6])), 0, 1)
    got, _ = fit(*clip_of(actions, c, np.zeros((468, 3))), actions)
    moved = np.flatnonzero(c.any(axis=0))
    for k in moved:
        assert np.corrcoef(got[:, k], c[:, k])[0, 1] > (0.85 if "brow" in actions.names[k] else 0.95), actions.names[k]
    assert np.delete(got, moved, axis=1).mean() < 0.1 * got[:, moved].mean()
    assert got.min() >= 0 and got.max() <= 1


def test_a_persons_own_resting_face_is_not_read_as_expression(actions):
    """A face that differs from everybody's as people do, all through the clip."""
    own = np.random.default_rng(3).normal(0, 1, (468, 3)) * actions.own / 1e3
    got, found = fit(*clip_of(actions, np.zeros((30, len(actions.names))), own), actions)
    assert got.mean() < 0.02
    assert np.sqrt(((found - own)[..., :2] ** 2).mean()) < 0.5 * np.sqrt((own[..., :2] ** 2).mean())


def test_brows_that_are_painted_high_are_the_persons_own_and_not_raised(actions):
    """The same raise in all frames, whatever the view, is how the person looks."""
    brows = [actions.names.index(name) for name in ("browInnerUp", "browOuterUpLeft", "browOuterUpRight")]
    painted = 0.8 * actions.response[0, brows].sum(0) / 1e3
    c = np.zeros((30, len(actions.names)))
    c[::3, brows] = 0.6
    got, _ = fit(*clip_of(actions, c, painted), actions)
    up, rest = got[:, brows[0]], c[:, brows[0]] == 0
    assert up[rest].mean() < 0.35 and np.corrcoef(up, c[:, brows[0]])[0, 1] > 0.85


def test_a_frown_that_a_person_has_from_every_side_is_the_persons_own(actions):
    """All else is read as without it; in photos, too, that know no time."""
    down = [actions.names.index(name) for name in ("browDownLeft", "browDownRight")]
    up = [actions.names.index(name) for name in ("browInnerUp", "browOuterUpLeft", "browOuterUpRight")]
    c = np.zeros((30, len(actions.names)))
    c[5:12, up] = 0.6
    frowning = c.copy()
    frowning[:, down] = 0.7
    for times in (None, np.arange(30) / 10):
        without, own = (solve(*clip_of(actions, one, np.zeros((468, 3))), actions, CONFIG.sparsity, CONFIG.doubt, times,
                              CONFIG.smooth_brow)[0] for one in (c, frowning))
        np.testing.assert_allclose(own, without, atol=0.08)
        assert own[:, down].mean() < 0.12 and own[5:12, up[0]].mean() > 3 * own[20:, up[0]].mean()


def test_brows_are_found_from_all_looks_near_in_time(actions):
    """The network wavers as it does, white in the channels: what one look says of small raises is mostly wrong."""
    up = [actions.names.index(name) for name in ("browInnerUp", "browOuterUpLeft", "browOuterUpRight")]
    jaw = actions.names.index("jawOpen")
    c = np.zeros((60, len(actions.names)))
    c[:, up] = 0.25 * np.clip(np.sin(np.arange(60) / 6), 0, 1)[:, None]
    c[::2, jaw] = 0.5
    points, direction = clip_of(actions, c, np.zeros((468, 3)), 0)
    across = np.linalg.pinv(actions.channels.reshape(len(actions.channels), -1))
    white = np.random.default_rng(1).normal(0, 1, (60, len(actions.channels)))
    points = points + (white @ across.T).reshape(60, 468, 3) / 1e3
    alone, together = (solve(points, direction, actions, CONFIG.sparsity, CONFIG.doubt, np.arange(60) / 10, pause)[0]
                       for pause in (0.0, 0.3))
    right = [np.corrcoef(got[:, up[0]], c[:, up[0]])[0, 1] for got in (alone, together)]
    assert right[1] > 0.8 and right[1] > right[0] + 0.2, right
    np.testing.assert_array_equal(alone[:, jaw], together[:, jaw])  # nobody else waits for the brows


def test_more_doubt_moves_less(actions):
    c = np.zeros((20, len(actions.names)))
    c[::2, actions.names.index("mouthSmileLeft")] = 0.5
    clip = clip_of(actions, c, np.zeros((468, 3)), 2e-3)
    calm, trusting = (fit(*clip, actions, doubt)[0] for doubt in (4.0, 1.0))
    assert calm.sum() < 0.8 * trusting.sum()


def test_each_action_is_smoothed_at_its_own_pace(actions):
    brow, smile, blink, jaw = (actions.names.index(name) for name in ("browInnerUp", "mouthSmileLeft", "eyeBlinkLeft", "jawOpen"))
    sigma = smoothing_sigma(actions.names, 0.02, 0.04, 0.15)
    assert sigma[[brow, smile, blink, jaw]].tolist() == [0, 0.15, 0.02, 0.04]
    spike = np.zeros((21, len(sigma)))
    spike[10] = 1
    left = smooth(spike, np.arange(21) / 30, sigma).max(axis=0)
    assert left[smile] < 0.4 * left[jaw] and left[jaw] < 0.8 * left[blink] and left[brow] == 1


def test_smoothing_reaches_the_next_frame_but_spares_lids_and_what_is_not_smoothed(actions):
    smile, blink, jaw = (actions.names.index(name) for name in ("mouthSmileLeft", "eyeBlinkLeft", "jawOpen"))
    assert smoothing_sigma(actions.names, 0.02, 0.04, 0.15, apart=0.1)[[smile, blink, jaw]].tolist() == [0.15, 0.02, 0.1]
    assert smoothing_sigma(actions.names, 0.02, 0.0, 0.15, apart=0.2)[[smile, blink, jaw]].tolist() == [0.2, 0.02, 0.0]


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
    out = fill_unseen(np.array([[0.2], [0.8]]), valid, np.arange(5) / 5, 0.2)
    np.testing.assert_allclose(out[:, 0], [0.2, 0.8, 0.8 / np.e, 0.8 / np.e**2, 0.8 / np.e**3])
    assert fill_unseen(np.array([[0.2], [0.8]]), valid, None, 0.2)[2:].max() == 0


def test_smoothing_keeps_a_constant_and_calms_a_flicker():
    times = np.arange(10) / 30
    sigma = np.array([0.04, 0.04])
    assert smooth(np.full((10, 2), 0.3), times, sigma) == pytest.approx(np.full((10, 2), 0.3))
    flicker = (np.arange(10) % 2)[:, None].astype(float)
    assert np.ptp(smooth(flicker, times, sigma[:1])[2:8]) < 0.2


@pytest.mark.parametrize(("name", "value"), [("angle", 60.0), ("threshold", 0.0), ("doubt", 0.0), ("smooth", -1.0)])
def test_a_wrong_parameter_is_named(name, value):
    with pytest.raises(BadInput, match=f"face.{name} is"):
        FaceConfig(**{name: value}).check()

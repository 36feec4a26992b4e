"""A synthetic person who turns in place with swinging arms, as a detector would give it, and the truth."""

from dataclasses import dataclass

import numpy as np
import pytest

from gsac.avatar.artifacts import KEYPOINT_SHAPES, Clip, check_filled_keypoints, read_arrays, write_arrays
from gsac.avatar.wholebody import ARM, HANDS, INDEX
from gsac.stages.contract import Job
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.stage import run
from support.artifacts import blank

FOCAL, CENTRE, DISTANCE = 1200.0, (360.0, 640.0), 3.2
HAND = np.random.default_rng(7).normal(0, 0.03, (21, 3)) + np.linspace(0, 0.1, 21)[:, None] * [0, 1, 0]


@dataclass
class Person:
    xy: np.ndarray
    """(T, 133, 2) px, as detected."""
    score: np.ndarray
    truth: np.ndarray
    """(T, 133, 2) px."""
    times: np.ndarray
    world: np.ndarray
    """(T, 133, 3) m, as detected."""


def turning(frames=100, fps=10.0, noise=1.5, seed=0, arm_angle=0.35, swing=0.12, turns=1.0, start=0.0) -> Person:
    """arm_angle: rad from straight down in the body's plane; swing: rad, to and fro at 0.5 Hz."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames) / fps
    yaw = start + 2 * np.pi * turns * np.arange(frames) / 100
    points = np.zeros((frames, 133, 3))
    points[:, :] = [0, -0.7, 0.1]  # what no test looks at sits at the head
    for name, place in (("hip", (0.1, 0.0, 0)), ("knee", (0.12, 0.42, 0)), ("ankle", (0.12, 0.85, 0))):
        for side, sign in (("left", 1), ("right", -1)):
            points[:, INDEX[f"{side}_{name}"]] = [sign * place[0], place[1], place[2]]
    for side, sign in (("left", 1), ("right", -1)):
        _, elbow, wrist, palm = ARM[side]
        shoulder = np.array([sign * 0.18, -0.5, 0.0])
        wave = swing * np.sin(2 * np.pi * 0.5 * times + (0 if sign > 0 else 1.3))
        upper = np.stack([sign * np.sin(arm_angle + wave), np.cos(arm_angle + wave), 0.3 * wave], axis=1)
        lower = np.stack([sign * np.sin(arm_angle * 0.8 + 1.3 * wave), np.cos(arm_angle * 0.8 + 1.3 * wave),
                          0.25 + 0.5 * wave], axis=1)
        upper /= np.linalg.norm(upper, axis=1, keepdims=True)
        lower /= np.linalg.norm(lower, axis=1, keepdims=True)
        points[:, ARM[side][0]] = shoulder
        points[:, elbow] = shoulder + 0.28 * upper
        points[:, wrist] = points[:, elbow] + 0.25 * lower
        # The hand's frame turns with the forearm: its points run along it.
        along, other = lower, np.cross(lower, [0, 0, 1.0])
        third = np.cross(along, other)
        shape = HAND * [sign, 1, 1]
        hand = (shape[:, 0, None, None] * other + shape[:, 1, None, None] * along + shape[:, 2, None, None] * third)
        points[:, HANDS[side]] = points[:, wrist, None] + hand.transpose(1, 0, 2)
        points[:, INDEX[f"{side}_hand_wrist"]] = points[:, wrist]
        points[:, palm] = points[:, wrist] + 0.09 * along
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y, z = points[..., 0] * c + points[..., 2] * s, points[..., 1], -points[..., 0] * s + points[..., 2] * c
    # Facing the camera at yaw 0: left is on the image's right; the nearer side has the smaller depth.
    depth = DISTANCE - z
    truth = np.stack([FOCAL * x / depth + CENTRE[0], FOCAL * y / depth + CENTRE[1]], axis=2)
    xy = truth + rng.normal(0, noise, truth.shape)
    world = np.stack([x, y, -z], axis=2) + rng.normal(0, 0.02, points.shape)
    return Person(xy, np.full((frames, 133), 0.95), truth, times, world)


def lose(person: Person, side: str, first: int, last: int, wrist=True, elbow=False) -> Person:
    """The detector says itself that it lost the hand (and the wrist, the elbow) in frames first..last-1."""
    points = list(range(133))[HANDS[side]]
    points += [ARM[side][2]] * wrist + [ARM[side][1]] * elbow
    person.score[first:last, points] = 0.0
    person.xy[first:last, points] = 0.0
    return person


def put_on_other(person: Person, side: str, first: int, last: int, wrist=True, seed=1) -> Person:
    """The detector puts the hand's points on the other hand, with a good score, in frames first..last-1."""
    other = "right" if side == "left" else "left"
    rng = np.random.default_rng(seed)
    pairs = [(HANDS[side], HANDS[other])]
    if wrist:
        pairs.append((slice(ARM[side][2], ARM[side][2] + 1), slice(ARM[other][2], ARM[other][2] + 1)))
    for to, source in pairs:
        shape = person.xy[first:last, to].shape
        person.xy[first:last, to] = person.truth[first:last, source] + rng.normal(0, 1.5, shape)
    return person


def through_stage(person: Person, folder, photos=False, repeated=(), said=None, **config):
    """Returns the stage's arrays and warnings. said: frames of the keypoints; None: all."""
    folder.mkdir(exist_ok=True)
    source, out = folder / "keypoints.npz", folder / "out"
    out.mkdir()
    write_arrays(source, **blank(KEYPOINT_SHAPES, T=len(person.xy[:said])) | {
        "xy": person.xy[:said].astype(np.float32), "score": person.score[:said].astype(np.float32),
        "world": person.world[:said].astype(np.float32),
        "detector": np.array("synthetic")})
    times = None if photos else person.times.tolist()
    Clip(None if photos else 10.0, times, 720, 1280, None, "0", repeated=list(repeated)).write(folder / "clip.json")
    warnings = []
    run(Job({"keypoints/keypoints.npz": source, "split/clip.json": folder / "clip.json"}, out,
            HandgapConfig(**config), warn=lambda finding: warnings.append(finding.message)))
    check_filled_keypoints(out / "keypoints.npz")
    return read_arrays(out / "keypoints.npz"), warnings


@pytest.fixture
def synthetic():
    """The maker of people and their mishaps, for test files cannot import one another."""
    class Maker:
        pass

    Maker.turning, Maker.lose, Maker.put_on_other, Maker.through_stage = map(
        staticmethod, (turning, lose, put_on_other, through_stage))
    return Maker

"""Faults of lens, sensor, light and coding, and of the hand that holds the camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from gsac.benchmarks.stability.fault import Fault, pick_some
from gsac.benchmarks.stability.take import Take

Touched = tuple[Take, np.ndarray]
"""A take, and the frames (T,) bool that were touched."""


def add_noise(take: Take, sigma: float, rng: np.random.Generator) -> Touched:
    """sigma: of 8-bit steps."""
    return _each(take, lambda f, t: f + rng.normal(0, sigma, f.shape))


def darken(take: Take, gain: float, rng: np.random.Generator) -> Touched:
    """gain: factor on the light; a little noise of the sensor stays."""
    return _each(take, lambda f, t: f * gain + rng.normal(0, 2, f.shape))


def compress(take: Take, quality: float, rng: np.random.Generator) -> Touched:
    """quality: of JPEG."""
    def through_jpeg(frame: np.ndarray, t: int) -> np.ndarray:
        return np.asarray(cv2.imdecode(cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, int(quality)])[1], cv2.IMREAD_COLOR))

    return _each(take, through_jpeg)


def blur(take: Take, length: float, rng: np.random.Generator) -> Touched:
    """length: px of the streak, of a clip 1280 px high, along a direction for each frame."""
    size = max(3, 2 * int(length * take.scale / 2) + 1)

    def streak(frame: np.ndarray, t: int) -> np.ndarray:
        kernel = np.zeros((size, size), np.float32)
        kernel[size // 2] = 1
        turn = cv2.getRotationMatrix2D((size // 2, size // 2), rng.uniform(-30, 30), 1)
        kernel = cv2.warpAffine(kernel, turn, (size, size))
        return cv2.filter2D(frame, -1, kernel / kernel.sum())

    return _each(take, streak)


def drift_exposure(take: Take, amount: float, rng: np.random.Generator) -> Touched:
    """amount: the gain goes from 1 - amount to 1 + amount in the clip."""
    gain = np.linspace(1 - amount, 1 + amount, len(take.frames))
    return _each(take, lambda f, t: f * gain[t])


def drift_white_balance(take: Take, amount: float, rng: np.random.Generator) -> Touched:
    """amount: red gains that much by the clip's end, and blue loses it."""
    share = np.linspace(0, amount, len(take.frames))
    return _each(take, lambda f, t: f * (1 + share[t] * np.array([1, 0, -1])))


def flicker_light(take: Take, white: float, rng: np.random.Generator) -> Touched:
    """white: its share in every third picture."""
    lit = pick_some(len(take.frames), 1 / 3, rng)
    return _each(take, lambda f, t: f * (1 - white) + 255 * white, lit)


def roll_shutter(take: Take, delay: float, rng: np.random.Generator) -> Touched:
    """delay: frames from the first row to the last; rows between two frames are mixed of both."""
    count = len(take.frames)
    late = np.linspace(0, delay, take.size[0])[:, None, None]
    return _each(take, lambda f, t: f * (1 - late) + take.frames[min(t + 1, count - 1)] * late)


def roll_camera(take: Take, degrees: float, rng: np.random.Generator) -> Touched:
    """degrees: about the line of sight; the truth turns with the picture. By a quarter the frame turns, too: a clip whose file does
    not say that the phone was held across."""
    if degrees == 90:
        return take.turned(1), _all(take)
    height, width = take.size
    turn = cv2.getRotationMatrix2D((width / 2 - 0.5, height / 2 - 0.5), degrees, 1)
    frames = [cv2.warpAffine(f, turn, (width, height), borderMode=cv2.BORDER_REPLICATE) for f in take.frames]
    masks = [cv2.warpAffine(m.astype(np.uint8), turn, (width, height)) > 0 for m in take.masks]
    own = Rotation.from_euler("z", -degrees, degrees=True).as_matrix()  # y points down
    return replace(take, frames=np.stack(frames), masks=np.stack(masks), rotation=own @ take.rotation), _all(take)


def shake(take: Take, px: float, rng: np.random.Generator) -> Touched:
    """px: standard deviation of each picture's place, of a clip 1280 px high."""
    moves = rng.normal(0, px * take.scale, (len(take.frames), 2))
    return _each(take, lambda f, t: cv2.warpAffine(f, np.array([[1, 0, moves[t, 0]], [0, 1, moves[t, 1]]]), f.shape[1::-1],
                                                   borderMode=cv2.BORDER_REPLICATE))


def black_out(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the pictures."""
    black = pick_some(len(take.frames), share, rng)
    out, _ = _each(take, lambda f, t: f * 0, black)
    return replace(out, asked=take.asked & ~black), black


def _each(take: Take, change: Callable[[np.ndarray, int], np.ndarray], some: np.ndarray | None = None) -> Touched:
    """The take with change(frame, t) applied to its pictures, or to those of some, (T,) bool."""
    some = _all(take) if some is None else some
    frames = [np.clip(change(f, t), 0, 255).round().astype(np.uint8) if some[t] else f for t, f in enumerate(take.frames)]
    return replace(take, frames=np.stack(frames)), some


def _all(take: Take) -> np.ndarray:
    return np.ones(len(take.frames), bool)


FAULTS = (
    Fault("blur", "camera or person moves while the shutter is open; px of a clip 1280 px high", (9, 17, 25, 37, 51), blur),
    Fault("shake", "hand-held camera; px a frame", (2, 5, 10, 20, 40), shake),
    Fault("darkness", "share of the light", (0.6, 0.4, 0.25, 0.15, 0.08), darken),
    Fault("exposure", "the exposure drifts by this share to both sides", (0.1, 0.2, 0.3, 0.45, 0.6), drift_exposure),
    Fault("white-balance", "red and blue drift by this share", (0.05, 0.1, 0.2, 0.3, 0.4), drift_white_balance),
    Fault("light-flicker", "white in every third picture", (0.15, 0.3, 0.45, 0.65, 0.85), flicker_light),
    Fault("compression", "JPEG quality", (50, 30, 15, 8, 3), compress),
    Fault("noise", "standard deviation, 8-bit steps", (4, 8, 15, 25, 40), add_noise),
    Fault("roll", "the camera is turned about its line of sight, degrees", (5, 15, 25, 90, 180), roll_camera),
    Fault("rolling-shutter", "frames between the first row and the last", (0.1, 0.2, 0.33, 0.6, 1.0), roll_shutter),
    Fault("black-frames", "share of black pictures", (0.03, 0.1, 0.2, 0.33, 0.5), black_out),
)

"""Faults of time: pictures that stand still, are mirrored, missing, out of order or mixed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gsac.benchmarks.stability.fault import Fault, pick_run, pick_some
from gsac.benchmarks.stability.take import Take

Touched = tuple[Take, np.ndarray]
"""A take, and the frames (T,) bool that were touched."""


def freeze(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the pictures that repeat the one before them while time goes on; nothing is asked of those."""
    still = pick_run(len(take.frames), share, rng)
    source = np.where(still, np.flatnonzero(still)[0] - 1, np.arange(len(still)))
    return replace(take, frames=take.frames[source], masks=take.masks[source], asked=take.asked & ~still), still


def mirror(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the pictures, in one run, that are mirrored; nothing is asked of those."""
    some = pick_run(len(take.frames), share, rng)
    frames, masks = take.frames.copy(), take.masks.copy()
    frames[some], masks[some] = take.frames[some][:, :, ::-1], take.masks[some][:, :, ::-1]
    return replace(take, frames=frames, masks=masks, asked=take.asked & ~some), some


def shuffle(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the pictures that stand at each other's times."""
    some = np.flatnonzero(pick_some(len(take.frames), share, rng))
    order = np.arange(len(take.frames))
    order[some] = np.roll(rng.permutation(some), 1) if len(some) > 1 else (some + 1) % len(order)
    return replace(take.at(order), times=take.times), order != np.arange(len(order))


def thin_out(take: Take, count: float, rng: np.random.Generator) -> Touched:
    """count: frames that are left, spread over the clip."""
    kept = take.at(np.linspace(0, len(take.frames), min(int(count), len(take.frames)), endpoint=False).astype(int))
    return kept, np.ones(len(kept.frames), bool)


def shorten(take: Take, count: float, rng: np.random.Generator) -> Touched:
    """count: frames that are left, one after the other."""
    count = min(int(count), len(take.frames))
    first = rng.integers(0, len(take.frames) - count + 1)
    return take.at(np.arange(first, first + count)), np.ones(count, bool)


def drop_frames(take: Take, share: float, rng: np.random.Generator) -> Touched:
    """share: of the frames that the camera left out, at uneven times."""
    kept = np.flatnonzero(~pick_some(len(take.frames), share, rng))
    after = np.append(np.diff(kept) > 1, False)
    return take.at(kept), after | np.roll(after, 1)


def turn_fast(take: Take, count: float, rng: np.random.Generator) -> Touched:
    """count: neighbours, the frame among them, that one picture is the mean of."""
    reach = np.arange(int(count)) - int(count) // 2
    at = np.clip(np.arange(len(take.frames))[:, None] + reach, 0, len(take.frames) - 1)
    frames = np.stack([take.frames[some].mean(0).round().astype(np.uint8) for some in at])
    return replace(take, frames=frames), np.ones(len(frames), bool)


FAULTS = (
    Fault("frozen", "share of the clip in which the picture stands still", (0.05, 0.1, 0.2, 0.35, 0.5), freeze),
    Fault("mirrored", "share of the clip that is mirrored", (0.05, 0.17, 0.25, 0.35, 0.5), mirror),
    Fault("out-of-order", "share of pictures at each other's times", (0.1, 0.25, 0.5, 0.75, 1.0), shuffle),
    Fault("dropped-frames", "share of frames that are missing, at uneven times", (0.1, 0.2, 0.3, 0.45, 0.6), drop_frames),
    Fault("few-spread", "frames, all round", (16, 12, 8, 6, 4), thin_out),
    Fault("few-in-a-row", "frames, one after the other", (12, 8, 4, 2, 1), shorten),
    Fault("fast-turn", "frames that one picture mixes", (2, 3, 4, 5, 7), turn_fast),
)

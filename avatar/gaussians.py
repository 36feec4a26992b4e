"""The avatar's gaussians: bound to faces of the body mesh, as stored in avatar.npz."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gsac.avatar import artifacts
from gsac.avatar.draw_rule import ADDED, PIXEL, LowPass

FLATNESS = 0.15
"""Thickness of a fresh gaussian along the face's normal, as a share of its width."""
SPREAD = 0.55
"""Standard deviation of a fresh gaussian over the square root of the area that it stands for."""

GOLDEN = (0.7548776662466927, 0.5698402909980532)
"""Steps of the plane's R2 sequence: powers of 1/1.3247..., the plastic number."""
FIELDS = tuple(artifacts.AVATAR_SHAPES)
"""The arrays that have a row for every gaussian."""


@dataclass
class Gaussians:
    """N gaussians in the frames of the faces that carry them (avatar/binding.py)."""

    face: np.ndarray
    """(N,) int32, index of the face that carries it."""
    mu: np.ndarray
    """(N, 3) centre in the face frame, before the face's scale k."""
    quat: np.ndarray
    """(N, 4) wxyz rotation in the face frame, any length."""
    log_scale: np.ndarray
    """(N, 3) log of the standard deviations, before the face's scale k."""
    rgb: np.ndarray
    """(N, 3) colour in 0..1."""
    opacity: np.ndarray
    """(N,) in 0..1."""
    light: np.ndarray | None = None
    """(4, 3) of `avatar.light`: the room's light, a factor on rgb by the face's normal; None: factor 1."""
    low_pass: LowPass = PIXEL
    """The filter that they were trained with, and are to be drawn with."""
    max_height_px: float | None = None
    """Of a coarser level of detail: projected height of the person up to which it is drawn; None: not said."""

    def __len__(self) -> int:
        return len(self.face)

    def __getitem__(self, which: np.ndarray | slice) -> Gaussians:
        """Those that an index array (M,), mask (N,) or slice picks."""
        return replace(self, **{name: np.ascontiguousarray(getattr(self, name)[which]) for name in FIELDS})

    def write(self, path: Path, coarser: Iterable[Gaussians] = ()) -> None:
        """To avatar.npz, float32 and face int32, `low_pass`, and where given `light` and coarser levels of detail, finest first.

        coarser: may still be in the making, its own arrays are compressed meanwhile.
        """
        artifacts.pack_arrays(path, self._members(coarser))

    def _members(self, coarser: Iterable[Gaussians]) -> Iterator[tuple[str, np.ndarray]]:
        """Names and arrays (...) of avatar.npz."""
        yield from self._arrays().items()
        yield "low_pass", np.array(self.low_pass, np.float64)
        if self.light is not None:
            yield "light", np.asarray(self.light, np.float32)
        levels = list(coarser)
        if levels:
            yield "levels", np.array([len(level) for level in levels], np.int32)
            parts = [level._arrays() for level in levels]
            for name in FIELDS:
                yield f"coarser_{name}", np.concatenate([part[name] for part in parts])
            if all(level.max_height_px for level in levels):
                yield "level_heights", np.array([level.max_height_px for level in levels], np.float32)

    @classmethod
    def read(cls, path: Path) -> Gaussians:
        """From avatar.npz; raises `ArtifactError` where an array is missing or has another shape."""
        return cls.read_levels(path)[0]

    @classmethod
    def read_levels(cls, path: Path) -> list[Gaussians]:
        """The avatar and its coarser levels of detail, finest first; as `read`."""
        arrays = artifacts.check_avatar(path)
        light, given = arrays.get("light"), arrays.get("low_pass")
        low_pass = ADDED if given is None else LowPass(float(given[0]), bool(given[1]))
        ends = np.cumsum(arrays.get("levels", np.zeros(0, np.int32)))
        parts = [{name: arrays[f"coarser_{name}"][a:b] for name in FIELDS} for a, b in zip([0, *ends], ends, strict=False)]
        heights = [None, *arrays.get("level_heights", np.full(len(ends), None)).tolist()]
        return [cls(**part, light=light, low_pass=low_pass, max_height_px=height)
                for part, height in zip([{name: arrays[name] for name in FIELDS}, *parts], heights, strict=True)]

    def _arrays(self) -> dict[str, np.ndarray]:
        return {name: np.asarray(getattr(self, name), np.int32 if name == "face" else np.float32) for name in FIELDS}

    @classmethod
    def area(cls, vertices: np.ndarray, faces: np.ndarray, count: int, seed: int = 0,
             rgb: tuple[float, float, float] = (0.5, 0.5, 0.5), opacity: float = 0.9, power: float = 0.85,
             density: np.ndarray | None = None) -> Gaussians:
        """`count` gaussians spread over the faces of a mesh, a face drawn with probability area ** power * density.

        vertices: (V, 3) m; faces: (F, 3) int; density: (F,), 1 where not given. A gaussian is as large as the area
        that the density leaves it, so small faces (eyes, mouth) do not collect sub-pixel gaussians. Systematic draws in the mesh's
        own order and low-discrepancy points inside a face leave few gaps and few clumps.
        """
        random = np.random.default_rng(seed)
        areas = _areas(vertices, faces)
        chance = areas ** power if density is None else areas ** power * density
        up_to = np.cumsum(chance)
        expected = count * chance / up_to[-1]
        whole = np.diff(np.floor(count * (up_to / up_to[-1]) + random.random()).astype(np.int64), prepend=0)
        face = np.repeat(np.arange(len(faces), dtype=np.int32), whole)
        turn = np.arange(count) - np.repeat(np.cumsum(whole) - whole, whole)
        u, v = ((random.random(len(faces))[face] + turn * step) % 1 for step in GOLDEN)
        flip = u + v > 1
        u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
        corners = vertices[faces[face]].astype(np.float64)
        points = corners[:, 0] + u[:, None] * (corners[:, 1] - corners[:, 0]) + v[:, None] * (corners[:, 2] - corners[:, 0])
        from gsac.avatar.binding import face_frames

        frames = face_frames(vertices, faces)
        scale = np.where(frames.k[face] > 0, frames.k[face], 1)
        local = np.einsum("nji,nj->ni", frames.R[face], points - frames.T[face]) / scale[:, None]
        return cls._flat(vertices, faces, face, local.astype(np.float32), areas[face] / expected[face], rgb, opacity)

    @classmethod
    def _flat(cls, vertices, faces, face, mu, area, rgb, opacity) -> Gaussians:
        """Discs in the face's plane (the frame's middle axis is the normal), sized by `area` (N,), m2 a gaussian."""
        from gsac.avatar.binding import face_frames

        k = face_frames(vertices, faces).k[face]
        width = np.log(SPREAD * np.sqrt(np.maximum(area, 1e-16)) / np.where(k > 0, k, 1))
        log_scale = np.stack([width, width + np.log(FLATNESS), width], 1).astype(np.float32)
        quat = np.zeros((len(face), 4), np.float32)
        quat[:, 0] = 1
        colour = np.broadcast_to(np.asarray(rgb, np.float32), (len(face), 3)).copy()
        return cls(face, mu, quat, log_scale, colour, np.full(len(face), opacity, np.float32))


def _areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) m2, 0 for faces without a frame."""
    from gsac.avatar.binding import face_frames

    v = np.asarray(vertices, np.float64)[faces]
    area = 0.5 * np.linalg.norm(np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]), axis=1)
    return np.where(face_frames(vertices, faces).valid, area, 0)

"""What a training is given (`BodyArrays`, `Shot`), and its memory on the device (`Arrays`), by the names of `structs.POINTERS`."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from gsac.avatar.camera import Camera
from gsac.avatar.cuda.device import Buffer, Shape
from gsac.avatar.cuda.structs import POINTERS, Scene
from gsac.avatar.draw_rule import LowPass
from gsac.avatar.joints import J

TILE, SEGMENT, JOINTS = 16, 128, J
"""px, side of an image tile; gaussians of one segment of a tile's list; joints of a body."""


class BodyArrays(NamedTuple):
    rest: np.ndarray
    """(R, V, 3) m, vertices at rest."""
    rest_of: np.ndarray
    """(T,) index of the rest vertices that each frame has."""
    joints: np.ndarray
    """(55, 3) m at rest."""
    parents: np.ndarray
    """(55,) index of each joint's parent, -1 for the root."""
    skin_index: np.ndarray
    """(V, 4) joints."""
    skin_weight: np.ndarray
    """(V, 4), rows sum to one."""
    faces: np.ndarray
    """(F, 3)."""
    shape: np.ndarray | None = None
    """(V, 3, B) m by beta, where betas are learned."""
    joint_shape: np.ndarray | None = None
    """(55, 3, B) m by beta, of the joints, likewise."""
    expression: np.ndarray | None = None
    """(V, 3, E) m by coefficient, where expressions are learned."""


class Shot(NamedTuple):
    pixels: np.ndarray
    """(h, w, 4) uint8, premultiplied RGB and mask."""
    camera: Camera
    corner: tuple[int, int] = (0, 0)
    """x, y in the whole frame, px."""


class SideShot(NamedTuple):
    """The body of a frame, turned: a side that no frame shows, which teaches the gaussians' outline alone."""

    frame: int
    """Its index among the shots."""
    turn: np.ndarray
    """(3, 3), about the pelvis."""
    shot: Shot
    """Without a picture."""


class OnFaces(Protocol):
    """Gaussians of any recipe, as far as all trainers know them."""

    face: np.ndarray
    """(N,) index of the face that carries it."""
    light: np.ndarray | None
    """(4, 3) of the clip."""
    low_pass: LowPass

    def __len__(self) -> int:
        """N."""
        ...


class Arrays:
    """Buffers by name, and the `Scene` that tells the kernels their addresses and sizes."""

    def __init__(self, stream: Any):
        """stream: of the device that works with them."""
        self.stream = stream
        self.buffers: dict[str, Buffer] = {}
        self.scene = Scene()
        self.scratch: list[str] = []
        """Names of the buffers that every step writes before it reads them."""

    def upload(self, name: str, array: ArrayLike, dtype: DTypeLike) -> None:
        """A new buffer with this content, in the place of an older one."""
        self.allocate(name, np.shape(array), dtype).write(np.asarray(array))

    def allocate(self, name: str, shape: Shape, dtype: DTypeLike) -> Buffer:
        """A new buffer, not yet written, in the place of an older one."""
        assert name in POINTERS
        if name in self.buffers:
            self.buffers[name].free()
        self.buffers[name] = buffer = Buffer(shape, dtype, self.stream)
        setattr(self.scene, name, buffer.pointer)
        return buffer

    def memory(self) -> int:
        """Bytes on the device."""
        return sum(b.bytes for b in self.buffers.values())

    def poison(self) -> None:
        """Fills the scratch with NaN."""
        for name in self.scratch:
            self.buffers[name].fill(255)

    def free(self) -> None:
        """Frees all buffers."""
        for buffer in self.buffers.values():
            buffer.free()
        self.buffers.clear()

"""What a training keeps on the device, by the names of `scene.POINTERS`: plan, shots, body, gaussians, and a step's scratch."""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import numpy as np

from gsac.avatar.binding import face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.cuda.adjacency import children, joint_levels, joints_of, neighbours, vertices_of
from gsac.avatar.cuda.device import Buffer
from gsac.avatar.cuda.recipe import Drawn, Recipe
from gsac.avatar.cuda.smoothing import series
from gsac.avatar.cuda.structs import FRAME, POINTERS, Scene, State
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY, FINGERS, JAW_EYES, J
from gsac.avatar.logistic import logit, sigmoid

TILE, SEGMENT, JOINTS = 16, 128, J
NOW = 256
"""Bytes kept for each frame of the batch's `Now`; at least the struct's."""


class BodyArrays(NamedTuple):
    rest: np.ndarray
    """(R, V, 3) m, vertices at rest."""
    rest_of: np.ndarray
    """(T,) which of them each frame wears."""
    joints: np.ndarray
    """(55, 3) m at rest."""
    parents: np.ndarray
    skin_index: np.ndarray
    """(V, 4)."""
    skin_weight: np.ndarray
    """(V, 4), rows sum to one."""
    faces: np.ndarray
    """(F, 3)."""
    shape: np.ndarray | None = None
    """(V, 3, B) m by beta, where betas are learned."""
    joint_shape: np.ndarray | None = None
    """(55, 3, B), likewise of the joints."""
    expression: np.ndarray | None = None
    """(V, 3, E) m by coefficient, where expressions are learned."""


class Shot(NamedTuple):
    pixels: np.ndarray
    """(h, w, 4) uint8, premultiplied RGB and mask."""
    camera: Camera
    corner: tuple[int, int] = (0, 0)
    """x, y in the whole frame, px."""


class Arrays:
    """Buffers by name, and the `Scene` that tells the kernels where they lie and how large all is."""

    def __init__(self, body: BodyArrays, gaussians: Gaussians, recipe: Recipe, frames: int):
        self.recipe, self.body, self.face = recipe, body, np.asarray(gaussians.face, np.int32)
        self.frames, self.count, self.light = frames, len(gaussians), gaussians.light
        self.buffers: dict[str, Buffer] = {}
        self.scene = Scene()

    def gaussians(self) -> Gaussians:
        b = self.buffers
        opacity = sigmoid(b["logit"].read().astype(np.float64))
        return Gaussians(self.face.copy(), b["mu"].read(), b["quat"].read(), b["log_scale"].read(), b["rgb"].read(),
                         opacity.astype(np.float32), self.light)

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Pose (T, 55, 3) and translation (T, 3), float64."""
        both = self.buffers["pose"].read()
        return both[:, :JOINTS].copy(), both[:, JOINTS].copy()

    def betas(self) -> np.ndarray:
        """(B,) float64, what has been learned on top of the body's betas; empty where none are learned."""
        return self.buffers["betas"].read() if self.recipe.beta_rate else np.zeros(0)

    def expressions(self) -> np.ndarray:
        """(T, E) float64, what has been learned on top of what the frames wear."""
        return self.buffers["expression"].read()

    def joint_offset(self) -> np.ndarray:
        """(55, 3) float64 m, what has been learned on top of the joints at rest."""
        return self.buffers["joint_offset"].read()

    def gains(self) -> np.ndarray:
        """(T, 3) of the frames' colour channels; 1 where none are learned."""
        return self.buffers["gain"].read()

    def offset(self) -> np.ndarray:
        """(V, 3) m, the displacement of the vertices at rest that the gaussians now ride on, the betas' left out."""
        return self.buffers["offset"].read() - self._shaped()

    def _shaped(self) -> np.ndarray | float:
        """(V, 3) m, what the learned betas do to the vertices at rest."""
        return (self.body.shape @ self.betas()).astype(np.float32) if self.recipe.beta_rate else 0.0

    def memory(self) -> int:
        """Bytes of the device's memory that this training holds."""
        return sum(b.bytes for b in self.buffers.values())

    def poison(self) -> None:
        """NaN into all that a step must write before it reads."""
        for name in self.scratch:
            self.buffers[name].fill(255)

    def _upload_all(self, levels, drawn: Drawn, pose, transl, gaussians: Gaussians) -> None:
        self._upload_shots(levels)
        self._upload("plan", drawn.rates.view(np.uint8), np.uint8)
        self._upload("order", drawn.order, np.int32)
        self._upload("background", drawn.background, np.float32)
        self._upload_body(pose, transl)
        self._upload_gaussians(gaussians)
        self._empty("losses", (self.recipe.steps, self.batch), np.float32).fill(0)
        self._empty("state", ctypes.sizeof(State), np.uint8).fill(0)
        self._scratch()

    def _upload_shots(self, levels) -> None:
        frames = np.zeros(len(levels) * self.frames, [(name, np.dtype(kind)) for name, kind in FRAME.items()])
        pixels, flags = [], []
        at = tiles = 0
        for i, (t, shot) in enumerate((t, shot) for level in levels for t, shot in enumerate(level)):
            h, w = shot.pixels.shape[:2]
            rows, columns = -(-h // TILE), -(-w // TILE)
            shown = np.zeros((rows * TILE, columns * TILE), bool)
            shown[:h, :w] = np.ascontiguousarray(shot.pixels).view(np.uint32)[..., 0] != 0
            frames[i] = (at, tiles, w, h, *shot.camera.focal, *shot.camera.center, self.body.rest_of[t], t, *shot.corner, 0)
            pixels.append(shot.pixels.reshape(-1))
            flags.append(shown.reshape(rows, TILE, columns, TILE).any((1, 3)).reshape(-1))
            at, tiles = at + h * w, tiles + rows * columns
        self._upload("frames", frames.view(np.uint8), np.uint8)
        self._upload("pixels", np.concatenate(pixels), np.uint8)
        self._upload("occupied", np.concatenate(flags), np.uint8)

    def _upload_body(self, pose, transl) -> None:
        body = self.body
        level = joint_levels(body.parents)
        self.scene.levels = int(level.max()) + 1
        child_start, child = children(body.parents)
        joint_start, joint_vertex, joint_weight = joints_of(body.skin_index, body.skin_weight, JOINTS)
        both = np.concatenate([np.asarray(pose, np.float64), np.asarray(transl, np.float64)[:, None]], 1)
        share = np.full(JOINTS + 1, self.recipe.hand_share)
        share[BODY], share[JAW_EYES], share[JOINTS] = 1, 0, 1
        for name, array, kind in (
                ("rest", body.rest, np.float32), ("joints", body.joints, np.float32), ("parents", body.parents, np.int32),
                ("joint_level", level, np.int32), ("child_start", child_start, np.int32), ("child", child, np.int32),
                ("skin_index", body.skin_index, np.int32), ("skin_weight", body.skin_weight, np.float32),
                ("joint_start", joint_start, np.int32),
                ("joint_vertex", joint_vertex, np.int32), ("joint_weight", joint_weight, np.float32), ("pose", both, np.float64),
                ("fit", both, np.float64), ("pose_share", share, np.float64)):
            self._upload(name, array, kind)
        near_start, near_vertex = neighbours(np.asarray(body.faces), body.rest.shape[1])
        if self.recipe.offset_rate:
            found = series(body.faces, body.rest.shape[1], self.recipe.smoothness)
            self.scene.smoothness, self.scene.series_terms = self.recipe.smoothness, len(found.factors)
            self.scene.series_middle, self.scene.series_half = found.middle, found.half
            self._upload("series", found.factors, np.float32)
        on_fingers = np.where(np.asarray(body.skin_index) >= FINGERS.start, body.skin_weight, 0).sum(1)
        for name, array, kind in (("near_start", near_start, np.int32), ("near_vertex", near_vertex, np.int32),
                                  ("offset_share", 1 - on_fingers, np.float32)):
            self._upload(name, array, kind)
        for name, shape in (("offset", (body.rest.shape[1], 3)), ("offset_first", (body.rest.shape[1], 3)),
                            ("gathered", (body.rest.shape[1], 3)), ("offset_second", 1)):
            self._empty(name, shape, np.float32).fill(0)
        for name in ("pose_first", "pose_second"):
            self._empty(name, both.shape, np.float64).fill(0)
        self._empty("pose_steps", self.frames, np.int32).fill(0)
        self._upload("gain", np.ones((self.frames, 3)), np.float32)
        if self.recipe.beta_rate:
            self._upload_shape()
        if self.recipe.expression_rate:
            directions = np.moveaxis(self.body.expression, 2, 0)
            self.scene.expression_count = len(directions)
            self._upload("expression_dirs", directions, np.float32)
            for name in ("expression", "expression_first", "expression_second"):
                self._empty(name, (self.frames, len(directions)), np.float64).fill(0)
        if self.recipe.joint_rate:
            share[0] = 0  # the pelvis is where the translation puts it
            self._upload("joint_share", share, np.float64)
            for name in ("joint_offset", "joint_first", "joint_second"):
                self._empty(name, (JOINTS, 3), np.float64).fill(0)

    def _upload_shape(self) -> None:
        """Directions of the betas, one after the other."""
        shape, joint_shape = (np.moveaxis(a, 2, 0) for a in (self.body.shape, self.body.joint_shape))
        self.scene.beta_count = len(shape)
        self._upload("shape", shape, np.float32)
        self._upload("joint_shape", joint_shape, np.float32)
        for name in ("betas", "beta_first", "beta_second"):
            self._empty(name, len(shape), np.float64).fill(0)

    def _upload_gaussians(self, gaussians: Gaussians) -> None:
        scale = face_frames(self.body.rest[0], self.body.faces).k[self.face]
        for name, array in (*self._values(gaussians).items(), ("face_scale", scale)):
            self._upload(name, array, np.float32)
        if self.light is not None:
            self._upload("clip_light", self.light, np.float32)
        start, item = vertices_of(self.body.faces, self.face, self.scene.vertex_count)
        for name, array in (("corner", np.asarray(self.body.faces)[self.face]), ("vertex_start", start), ("vertex_item", item)):
            self._upload(name, array, np.int32)
        for name in ("first", "second"):
            self._empty(name, (14, self.count), np.float32).fill(0)
        self._empty("seen", self.count, np.int32).fill(0)
        self._empty("resting", self.count, np.uint8).fill(0)

    def _values(self, gaussians: Gaussians) -> dict[str, np.ndarray]:
        """Buffers' names and what they are to hold."""
        opacity = np.clip(gaussians.opacity.astype(np.float64), 1e-4, 1 - 1e-4)
        return {"mu": gaussians.mu, "quat": gaussians.quat, "log_scale": gaussians.log_scale, "rgb": gaussians.rgb,
                "logit": logit(opacity), "start": gaussians.mu}

    def _scratch(self) -> None:
        batch, n, v = self.batch, self.count, self.scene.vertex_count
        tiles, pixels = batch * self.scene.max_tiles, batch * self.scene.max_pixels
        shapes = {
            "local": (batch, JOINTS, 9), "transform": (batch, JOINTS, 12), "vertices": (batch, v, 3),
            "grad_vertices": (batch, v, 3),
            "corner_grad": (batch, n, 9), "joint_grad": (batch, JOINTS, 12), "splat": (batch, n, 12), "depth": (batch, n),
            "grad_rest": (batch, v, 3), "solve_step": (2, v, 4), "image": (pixels, 4), "grad_image": (pixels, 4),
            "tile_loss": tiles}
        if self.recipe.ssim:
            shapes["slopes"] = (9, pixels)
        for name, shape in shapes.items():
            self._empty(name, shape, np.float32)
        integers = {"slot_start": (batch, n), "tile_count": tiles, "tile_start": tiles, "tile_check": tiles, "tile_done": tiles,
                    "heavy": tiles, "light": tiles, "near": tiles}
        for name, shape in integers.items():
            self._empty(name, shape, np.int32)
        self._empty("box", (batch, n, 4), np.uint16)
        self._empty("near_flag", tiles, np.uint8)
        self._empty("now", batch * NOW, np.uint8)
        self.scratch = [*shapes, *integers, "box", "near_flag", "now"]
        more = {}
        if self.recipe.beta_rate:
            betas = self.scene.beta_count
            more |= {"grad_joints": (batch, JOINTS, 3), "beta_part": (-(-v // 256), betas), "beta_move": betas}
        if self.recipe.joint_rate:
            more["grad_joints"] = (batch, JOINTS, 3)
        if self.recipe.expression_rate:
            more["worn"] = (batch, v, 3)
        for name, shape in more.items():
            self._empty(name, shape, np.float32)
            self.scratch.append(name)
        if self.recipe.gain_rate:
            self._empty("gain_part", (tiles, 3), np.float32)
            self.scratch.append("gain_part")

    def _pairs(self, room: int) -> None:
        """Room for so many (tile, gaussian) pairs of a batch, and for what hangs on them."""
        tiles = self.batch * self.scene.max_tiles
        for name, shape, kind in (("rank", room, np.int32), ("list", room, np.uint64), ("moments", (room, 9), np.float32),
                                  ("segment", (room // SEGMENT + tiles, 2), np.int32),
                                  ("checkpoint", (room // SEGMENT + 1, TILE * TILE, 4), np.float32)):
            self._empty(name, shape, kind)
        self.scratch = list(dict.fromkeys([*self.scratch, "rank", "list", "moments", "segment", "checkpoint"]))
        self.scene.pair_room = room

    def _upload(self, name: str, array: np.ndarray, kind) -> None:
        self._empty(name, np.shape(array), kind).write(np.asarray(array))

    def _empty(self, name: str, shape, kind) -> Buffer:
        assert name in POINTERS
        if name in self.buffers:
            self.buffers[name].free()
        self.buffers[name] = buffer = Buffer(shape, kind)
        setattr(self.scene, name, buffer.pointer)
        return buffer

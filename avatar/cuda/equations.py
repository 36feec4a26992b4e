"""Normal equations of poses: half the squared error of frames around their poses, gaussians and body held still."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gsac.avatar.cuda.arrays import JOINTS
from gsac.avatar.cuda.recipe import DrawnPlan, Recipe, zero_rates
from gsac.avatar.cuda.structs import Scene
from gsac.avatar.cuda.trainer import CudaTrainer
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import BODY

UNKNOWNS = 3 * BODY.stop + 3
"""Turns of pelvis and body joints, each about its own axes after its rotation, and the translation."""
GROUP = 256
"""Gaussians that a block of `pose_hessian` takes at a time."""


class Measured(NamedTuple):
    """Of T frames."""

    gradient: np.ndarray
    """(T, 56, 3) float64, by each joint's axis-angle, and by the translation."""
    hessian: np.ndarray
    """(T, U, U) float32, of Lucas and Kanade."""
    error: np.ndarray
    """(T,) squared error on the person."""
    pixels: np.ndarray
    """(T,) pixels that show the person in render or mask."""


@dataclass(kw_only=True)
class EquationsRecipe(Recipe):
    """`steps` are the frames."""

    turn_share: np.ndarray
    """(N, 22) share of each joint's turn that moves a gaussian's face."""


class PoseEquations(CudaTrainer):
    """As CudaTrainer, with one level of shots; a step is a frame, in their order, and nothing is learned."""

    recipe: EquationsRecipe

    def plan(self, levels: int) -> DrawnPlan:
        """As `CudaTrainer.plan`: every frame once, on black."""
        order = np.arange(self.frames, dtype=np.int32)[:, None]
        return DrawnPlan(order, np.zeros((self.frames, 1, 3), np.float32), zero_rates(self.frames))

    def measure(self, gaussians: Gaussians, pose: np.ndarray, transl: np.ndarray, offset: np.ndarray,
                joints: np.ndarray) -> Measured:
        """Of all frames. gaussians: those that the trainer was opened with, as they stand now; pose: (T, 55, 3) rad; transl: (T, 3)
        m; offset: (V, 3) m, added to the body's vertices at rest; joints: (55, 3) m at rest.
        """
        self.replace(gaussians)
        self.buffers["offset"].write(offset)
        self.buffers["joints"].write(joints)
        self.place(pose, transl)
        self._set_state(step=0)
        self.train(self.frames)
        b = self.buffers
        return Measured(b["pose_gradient"].read(), b["hessian"].read(), b["losses"].read()[:, 0], b["shown"].read())

    def step(self) -> None:
        """As `CudaTrainer.step`: the compositing goes back twice, from the slopes and from the residuals."""
        by_slopes = Scene.from_buffer_copy(self.scene)
        by_slopes.grad_image = self.scene.slopes
        for name in self.grids:
            if name == "pose_hessian":
                self.device.launch("blend_backward", *self.grids["blend_backward"], by_slopes)
            self.launch(name)

    def _make_scratch(self) -> None:
        super()._make_scratch()
        arrays, scene, frames = self.arrays, self.scene, self.frames
        scene.hessian_parts = min(2 * self.device.processors, -(-self.count // GROUP))
        arrays.upload("turn_share", self.recipe.turn_share, np.float32)
        for name, shape, kind in (
                ("slopes", (scene.max_pixels, 4), np.float32), ("tile_shown", scene.max_tiles, np.float32),
                ("hessian_part", (scene.hessian_parts, UNKNOWNS, UNKNOWNS), np.float32),
                ("hessian", (frames, UNKNOWNS, UNKNOWNS), np.float32), ("pose_grad_out", (1, JOINTS + 1, 3), np.float64),
                ("pose_gradient", (frames, JOINTS + 1, 3), np.float64), ("shown", frames, np.float32)):
            arrays.allocate(name, shape, kind)

    def _grids(self) -> dict[str, tuple[tuple[int, int], int]]:
        grids = super()._grids()
        residuals = grids.pop("compare")
        del grids["image_gradient"]
        first = ("skin", "project", "allocate", "fill", "blend")
        return {name: grids.pop(name) for name in first} | {
            "residuals": residuals, "pose_hessian": ((self.scene.hessian_parts, 1), 256)} | grids | {
            "keep_equations": ((-(-UNKNOWNS**2 // 256), 1), 256)}

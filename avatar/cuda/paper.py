"""The trainer of recipe `paper`: square frames, no limits, a neighbour term, and gaussians that grow in number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.cuda.arrays import Shot
from gsac.avatar.cuda.recipe import DrawnPlan, Recipe, rates_of
from gsac.avatar.cuda.trainer import CudaTrainer
from gsac.avatar.draw_rule import ADDED, LowPass
from gsac.avatar.feature_distance import FeatureDistance
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.logistic import opacity_logit, sigmoid

NEAREST = 3
"""Gaussians of a neighbourhood, the gaussian itself included."""
POSED, PULL = 10, 13
"""Numbers of a posed gaussian, and of its gradient by the neighbour term."""


@dataclass
class PaperGaussians:
    """Gaussians as recipe `paper` learns them: the scale, in units of the face, is `PaperRecipe.scale_limit` * sigmoid(logit)."""

    face: np.ndarray
    """(N,) int32, index of the face that carries it."""
    mu: np.ndarray
    """(N, 3) centre in the face frame."""
    quat: np.ndarray
    """(N, 4) wxyz, any length."""
    scale_logit: np.ndarray
    """(N, 3)."""
    rgb: np.ndarray
    """(N, 3), not limited to 0..1."""
    opacity: np.ndarray
    """(N,) in 0..1, not learned."""
    light: np.ndarray | None = None
    """(4, 3) as `Gaussians.light`; the recipe has none."""
    low_pass: LowPass = ADDED

    def __len__(self) -> int:
        return len(self.face)


@dataclass(kw_only=True)
class PaperRecipe(Recipe):
    """All rates but those of `mu` are constant; losses are means over the square frame, whose size `frame_size` is."""

    order: np.ndarray
    """(steps, batch) int32, indices of frames."""
    background: np.ndarray
    """(steps, batch, 3) float32 in 0..1."""
    centre: np.ndarray
    """(steps, batch) int32, vertices in the middle of the windows that LPIPS sees."""
    mu_rates: np.ndarray
    """(steps,) Adam rates of the places."""
    counts: np.ndarray
    """(steps,) bool, whether the gradients of the places in the image are summed."""
    masked: bool = True
    """Whether L2 and SSIM see the images times alpha times mask."""
    edges: float = 0.0
    """Weight of the edge strength in grey."""
    dice: float = 0.0
    """Weight of Dice of the background."""
    knn: float = 0.0
    """Weight of the neighbour term."""
    scale_limit: float = 0.0
    """Scales are scale_limit * sigmoid(logit), in units of the face."""


class PaperTrainer(CudaTrainer):
    """As CudaTrainer, with one level of shots, cut from square frames; starts from PaperGaussians, and the buffer `log_scale` holds
    their logits. LPIPS of a network is in the loss of every frame of every step."""

    recipe: PaperRecipe

    def plan(self, levels: int) -> DrawnPlan:
        """As `CudaTrainer.plan`, with the recipe's own frames, backgrounds and decay of the rates."""
        recipe = self.recipe
        rates = rates_of(recipe, np.arange(recipe.steps) / max(recipe.steps, 1), levels)
        for name, values in (("mu", recipe.mu_rates), ("quat", recipe.quat_rate), ("rgb", recipe.rgb_rate),
                             ("log_scale", recipe.scale_rate), ("pose", recipe.pose_rate), ("expression", recipe.expression_rate),
                             ("counts", recipe.counts)):
            rates[name] = values
        return DrawnPlan(recipe.order, recipe.background, rates)

    def gaussians(self) -> Gaussians:
        """A copy as they stand: rotations of length one, colours in 0..1."""
        v, limit = self.values(), self.recipe.scale_limit
        opacity = sigmoid(self.buffers["logit"].read())
        return Gaussians(self.face.copy(), v["mu"], v["quat"] / np.linalg.norm(v["quat"], axis=1, keepdims=True),
                         np.log(limit) - np.log1p(np.exp(-v["scale_logit"])), np.clip(v["rgb"], 0, 1), opacity,
                         low_pass=self.low_pass)

    def values(self) -> dict[str, np.ndarray]:
        """mu (N, 3), quat (N, 4), scale_logit (N, 3) and rgb (N, 3), as they are learned."""
        b = self.buffers
        return {"mu": b["mu"].read(), "quat": b["quat"].read(), "scale_logit": b["log_scale"].read(), "rgb": b["rgb"].read()}

    def pulls(self) -> tuple[np.ndarray, np.ndarray]:
        """Since the first step that counts, or since the last `grow`: (N,) sums of the lengths of the gradients by the place in the
        image, -1..1 across the frame, and (N,) numbers of images that each gaussian was in."""
        return self.buffers["pulled"].read(), self.buffers["hits"].read()

    def grow(self, face: np.ndarray, values: dict[str, np.ndarray]) -> None:
        """Sets the gaussians to go on from: face (M,), values as `values` gives them (M, ...); the first N keep their moments."""
        moments = {name: self.buffers[name].read() for name in ("first", "second")}
        fresh = len(face) - self.count
        self.face, self.count, self.scene.count = np.asarray(face, np.int32), len(face), len(face)
        opacity = sigmoid(self.buffers["logit"].read()[0])
        self._upload_gaussians(self._values(PaperGaussians(self.face, values["mu"], values["quat"], values["scale_logit"],
                                                           values["rgb"], np.full(len(face), opacity, np.float32))))
        for name, kept in moments.items():
            self.buffers[name].write(np.pad(kept, ((0, 0), (0, fresh))))
        self._make_scratch()
        self.grids = self._grids()
        self._resize_lists(max(self.scene.pair_room, 6 * self.count * self.batch))

    def _numbers(self, levels: list[list[Shot]]) -> None:
        super()._numbers(levels)
        recipe, (side, _) = self.recipe, self.recipe.frame_size
        for name, value in (("area", side * side), ("half_side", side / 2), ("whole_width", side), ("whole_height", side),
                            ("edges", recipe.edges), ("dice_weight", recipe.dice), ("knn", recipe.knn),
                            ("scale_limit", recipe.scale_limit), ("masked", recipe.masked)):
            setattr(self.scene, name, value)

    def _open_window(self, network: FeatureDistance) -> None:
        super()._open_window(network, self.batch, "float32")
        self.arrays.upload("centres", self.recipe.centre, np.int32)
        self.scene.perceptual = self.recipe.perceptual

    def _values(self, gaussians: PaperGaussians) -> dict[str, np.ndarray]:
        return {"mu": gaussians.mu, "quat": gaussians.quat, "log_scale": gaussians.scale_logit, "rgb": gaussians.rgb,
                "logit": opacity_logit(gaussians.opacity.astype(np.float64)), "start": gaussians.mu}

    def _upload_gaussians(self, values: dict[str, np.ndarray]) -> None:
        super()._upload_gaussians(values)
        self.arrays.allocate("pulled", self.count, np.float32).fill(0)
        self.arrays.allocate("hits", self.count, np.int32).fill(0)
        self.arrays.allocate("nearest_gaussian", (self.batch, self.count, NEAREST), np.int32).fill(255)

    def _make_scratch(self) -> None:
        super()._make_scratch()
        tiles, n = self.batch * self.scene.max_tiles, self.count
        for name, shape, kind in (("overlap", (tiles, 4), np.float32), ("dice", 2, np.float32),
                                  ("posed", (self.batch, n, POSED), np.float32),
                                  ("hull", (self.batch, -(-n // 128), 6), np.float32),
                                  ("pull", (self.batch, n, PULL), np.int64), ("pull_value", self.batch, np.int64)):
            self.arrays.allocate(name, shape, kind)
            self.arrays.scratch.append(name)

    def _grids(self) -> dict[str, tuple[tuple[int, int], int]]:
        blocks, grids = -(-self.count // 128), {}
        for name, grid in super()._grids().items():
            if name == "image_gradient" and self.recipe.dice:
                grids["dice"] = ((1, 1), 256)
            if name == "gaussian_step":
                grids |= dict.fromkeys(("pose_gaussians", "nearest", "neighbourhood"), ((blocks, self.batch), 128))
                grids["paper_step"] = ((blocks, 1), 128)
            else:
                grids[name] = grid
        return grids

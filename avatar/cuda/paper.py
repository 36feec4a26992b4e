"""The trainer of recipe `paper`: one image size, no limits, a neighbour term, and gaussians that grow in number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from gsac.avatar.binding import face_frames
from gsac.avatar.cuda.arrays import Shot
from gsac.avatar.cuda.recipe import DrawnPlan, Recipe, draw_plan
from gsac.avatar.cuda.trainer import CudaTrainer, opacity_logit
from gsac.avatar.draw_rule import ADDED, LowPass
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.logistic import sigmoid

NEAREST = 3
"""Gaussians of a neighbourhood, the gaussian itself included."""
COLUMNS = 10
"""Values of a gaussian that its neighbours are compared with."""
ROWS = {"mu": slice(0, 3), "quat": slice(3, 7), "scale_logit": slice(7, 10), "rgb": slice(10, 13)}
"""Rows of Adam's moments on the device."""


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
    """All rates but that of `mu`, which falls to `mu_decay` of it, are constant; losses are a mean over the whole frame."""

    mu_decay: float = 1.0
    edges: float = 0.0
    """Weight of the edge strength in grey."""
    dice: float = 0.0
    """Weight of Dice of the background."""
    knn: float = 0.0
    """Weight of the neighbour term."""
    scale_limit: float = 0.0
    """Scales are scale_limit * sigmoid(logit), in units of the face."""
    renew: int = 50
    """Steps between two searches for the neighbours."""


class PaperTrainer(CudaTrainer):
    """As CudaTrainer, with one level of shots; starts from PaperGaussians. The buffer `log_scale` holds their logits."""

    recipe: PaperRecipe

    def plan(self, levels: int) -> DrawnPlan:
        """As `CudaTrainer.plan`, with the recipe's own decay of the rates."""
        recipe = self.recipe
        drawn = draw_plan(recipe, self.frames, levels)
        done = np.arange(recipe.steps) / max(recipe.steps, 1)
        for name, rate in (("mu", recipe.mu_rate * recipe.mu_decay**done), ("quat", recipe.quat_rate), ("rgb", recipe.rgb_rate),
                           ("log_scale", recipe.scale_rate), ("pose", recipe.pose_rate)):
            drawn.rates[name] = rate
        return drawn

    def _advance(self, stop: int) -> None:
        while (at := self.state().step) < stop:
            if not self.linked or at % self.recipe.renew == 0:
                self._find_neighbours()
            super()._advance(min(stop, at - at % self.recipe.renew + self.recipe.renew))

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
        """Since the start, or since the last `grow`: (N,) sums of the lengths of the gradients by the place in the image, -1..1
        across the frame, and (N,) numbers of images that each gaussian was in."""
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
        recipe, (width, height) = self.recipe, self.recipe.frame_size
        for name, value in (("area", width * height), ("half_width", width / 2), ("half_height", height / 2),
                            ("edges", recipe.edges), ("dice_weight", recipe.dice), ("knn", recipe.knn),
                            ("scale_limit", recipe.scale_limit)):
            setattr(self.scene, name, value)

    def _values(self, gaussians: PaperGaussians) -> dict[str, np.ndarray]:
        return {"mu": gaussians.mu, "quat": gaussians.quat, "log_scale": gaussians.scale_logit, "rgb": gaussians.rgb,
                "logit": opacity_logit(gaussians.opacity), "start": gaussians.mu}

    def _upload_gaussians(self, values: dict[str, np.ndarray]) -> None:
        super()._upload_gaussians(values)
        arrays = self.arrays
        at_rest = face_frames(self.body.rest[0], self.body.faces)
        rows = np.concatenate([at_rest.R.reshape(-1, 9), at_rest.T, at_rest.k[:, None]], 1)
        self.rest_frame = rows[self.face].astype(np.float32)
        arrays.upload("rest_frame", self.rest_frame, np.float32)
        arrays.allocate("pulled", self.count, np.float32).fill(0)
        arrays.allocate("hits", self.count, np.int32).fill(0)
        arrays.allocate("nearest_gaussian", (self.count, NEAREST), np.int32).fill(0)
        arrays.allocate("near_of_start", self.count + 1, np.int32)
        arrays.allocate("near_of", self.count * NEAREST, np.int32)
        self.linked = False

    def _make_scratch(self) -> None:
        super()._make_scratch()
        tiles, n = self.batch * self.scene.max_tiles, self.count
        for name, shape in (("overlap", (tiles, 3)), ("dice", (self.batch, 3)), ("place", (n, 3)), ("hood", (n, 2 * COLUMNS))):
            self.arrays.allocate(name, shape, np.float32)
            self.arrays.scratch.append(name)

    def _grids(self) -> dict[str, tuple[tuple[int, int], int]]:
        blocks, grids = -(-self.count // 128), {}
        for name, grid in super()._grids().items():
            if name == "image_gradient":
                grids["dice"] = ((self.batch, 1), 256)
            if name == "gaussian_step":
                grids |= {"neighbourhood": ((blocks, 1), 128), "paper_step": ((blocks, 1), 128)}
            else:
                grids[name] = grid
        return grids

    def _find_neighbours(self) -> None:
        """Searches all pairs as the gaussians stand now: about a millisecond on the device."""
        b, count = self.buffers, self.count
        f, mu = self.rest_frame, b["mu"].read()
        b["place"].write(f[:, 9:12] + f[:, 12:] * np.einsum("nij,nj->ni", f[:, :9].reshape(-1, 3, 3), mu))
        self.device.launch("nearest", (-(-count // 128), 1), 128, self.scene)
        self.device.wait()
        index = b["nearest_gaussian"].read()
        links = csr_matrix((np.ones(index.size, np.int8), index.reshape(-1), np.arange(0, index.size + 1, NEAREST)), (count, count))
        back = links.tocsc()
        b["near_of_start"].write(back.indptr)
        b["near_of"].write(back.indices)
        self.linked = True

"""The trainer of recipe `paper`: no limits and no levels, gaussians that look like their neighbours, and that grow in number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from gsac.avatar.binding import face_frames
from gsac.avatar.cuda.recipe import Drawn, Recipe, draw
from gsac.avatar.cuda.trainer import CudaTrainer
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.logistic import sigmoid

NEAREST = 3
COLUMNS = 10
ROWS = {"mu": slice(0, 3), "quat": slice(3, 7), "scale": slice(7, 10), "rgb": slice(10, 13)}
"""Of Adam's moments on the device."""


@dataclass(kw_only=True)
class PaperRecipe(Recipe):
    """Rates are constant but for that of the places, which falls to `mu_decay`; losses are a mean over the whole frame."""

    mu_decay: float = 1.0
    edges: float = 0.0
    """Weight of the grey edges' strength."""
    dice: float = 0.0
    """Weight of Dice of what is not person."""
    knn: float = 0.0
    """Weight of the neighbours' terms."""
    scale_limit: float = 0.0
    """Scales are scale_limit * sigmoid(logit), in units of the face."""
    renew: int = 50
    """Steps after which the neighbours are searched anew."""


class PaperTrainer(CudaTrainer):
    """As CudaTrainer, with one level of shots. The gaussians' `log_scale` holds logits on the way in, logarithms on the way out."""

    recipe: PaperRecipe

    def plan(self, levels) -> Drawn:
        recipe = self.recipe
        drawn = draw(recipe, self.frames, len(levels))
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
        v, limit = self.values(), self.recipe.scale_limit
        opacity = sigmoid(self.buffers["logit"].read())
        return Gaussians(self.face.copy(), v["mu"], v["quat"] / np.linalg.norm(v["quat"], axis=1, keepdims=True),
                         np.log(limit) - np.log1p(np.exp(-v["scale"])), np.clip(v["rgb"], 0, 1), opacity)

    def values(self) -> dict[str, np.ndarray]:
        """mu (N, 3), quat (N, 4), scale (N, 3) logits and rgb (N, 3), as they are learned."""
        b = self.buffers
        return {"mu": b["mu"].read(), "quat": b["quat"].read(), "scale": b["log_scale"].read(), "rgb": b["rgb"].read()}

    def pulls(self) -> tuple[np.ndarray, np.ndarray]:
        """Since the start, or since they grew: sums of the lengths of the gradients by the image places, -1 to 1 across the frame,
        and in how many images each gaussian was."""
        return self.buffers["pulled"].read(), self.buffers["hits"].read()

    def grow(self, face: np.ndarray, values: dict[str, np.ndarray]) -> None:
        """The gaussians of `face` (M,) with these values from here on; the first N keep their moments, those behind begin anew."""
        moments = {name: self.buffers[name].read() for name in ("first", "second")}
        fresh = len(face) - self.count
        self.face, self.count, self.scene.count = np.asarray(face, np.int32), len(face), len(face)
        opacity = sigmoid(self.buffers["logit"].read()[0])
        self._upload_gaussians(Gaussians(self.face, values["mu"], values["quat"], values["scale"], values["rgb"],
                                         np.full(len(face), opacity, np.float32)))
        for name, kept in moments.items():
            self.buffers[name].write(np.pad(kept, ((0, 0), (0, fresh))))
        self._scratch()
        self.grids = self._grids()
        self._lists(max(self.scene.pair_room, 6 * self.count * self.batch))

    def _numbers(self, levels) -> None:
        super()._numbers(levels)
        recipe, (width, height) = self.recipe, self.recipe.frame_size
        for name, value in (("area", width * height), ("half_width", width / 2), ("half_height", height / 2),
                            ("edges", recipe.edges), ("dice_weight", recipe.dice), ("knn", recipe.knn),
                            ("scale_limit", recipe.scale_limit)):
            setattr(self.scene, name, value)

    def _upload_gaussians(self, gaussians: Gaussians) -> None:
        super()._upload_gaussians(gaussians)
        at_rest = face_frames(self.body.rest[0], self.body.faces)
        rows = np.concatenate([at_rest.R.reshape(-1, 9), at_rest.T, at_rest.k[:, None]], 1)
        self.rest_frame = rows[self.face].astype(np.float32)
        self._upload("rest_frame", self.rest_frame, np.float32)
        self._empty("pulled", self.count, np.float32).fill(0)
        self._empty("hits", self.count, np.int32).fill(0)
        self._empty("nearest_gaussian", (self.count, NEAREST), np.int32).fill(0)
        self._empty("near_of_start", self.count + 1, np.int32)
        self._empty("near_of", self.count * NEAREST, np.int32)
        self.linked = False

    def _scratch(self) -> None:
        super()._scratch()
        tiles, n = self.batch * self.scene.max_tiles, self.count
        for name, shape in (("overlap", (tiles, 3)), ("dice", (self.batch, 3)), ("place", (n, 3)), ("hood", (n, 2 * COLUMNS))):
            self._empty(name, shape, np.float32)
            self.scratch.append(name)

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
        """By where the gaussians stand now; the search of all pairs takes about a millisecond on the device."""
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

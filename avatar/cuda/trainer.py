"""The driver: a recipe's steps as one graph of kernels. All arrays that a step needs stay on the device."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.cuda.arrays import JOINTS, TILE, Arrays, BodyArrays, OnFaces, Shot, SideShot
from gsac.avatar.cuda.device import Device
from gsac.avatar.cuda.recipe import DrawnPlan, Recipe, draw_plan
from gsac.avatar.cuda.structs import State
from gsac.avatar.cuda.uploads import make_pairs, make_scratch, upload_body, upload_gaussians, upload_shots
from gsac.avatar.feature_distance import FeatureDistance
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.logistic import opacity_logit, sigmoid

REPLAY = 10
"""Steps of one graph."""


class CudaTrainer:
    """Gaussians, poses and Adam's state on the GPU, and the steps of a recipe.

    Raises device.NoDeviceError without a GPU, device.DeviceError where it has too little memory.
    """

    def __init__(self, body: BodyArrays, levels: list[list[Shot]], pose: np.ndarray, transl: np.ndarray, gaussians: OnFaces,
                 recipe: Recipe, device: Device | None = None, pair_room: int | None = None,
                 network: FeatureDistance | None = None, sides: Sequence[SideShot] = ()):
        """levels: one or two lists of T shots, coarse first; pose: (T, 55, 3) rad; transl: (T, 3) m.

        pair_room: (tile, gaussian) pairs that there is memory for at first; network: for LPIPS in the loss of the recipe's last
        `perceptual_steps`, by torch; sides: those of the recipe's `sides`.
        """
        self.device = device or Device()
        self.sides, shown_by = sides, [side.frame for side in sides]
        self.recipe, self.face = recipe, np.asarray(gaussians.face, np.int32)
        self.body = body._replace(rest_of=np.append(body.rest_of, np.asarray(body.rest_of)[shown_by]).astype(int))
        self.frames, self.count, self.light, self.low_pass = len(levels[0]), len(gaussians), gaussians.light, gaussians.low_pass
        self.arrays = Arrays(self.device.stream)
        self.buffers, self.scene = self.arrays.buffers, self.arrays.scene
        self._graph = None
        self.seconds = 0.0
        """Spent in all calls of `train`, by the device's own clock."""
        self._clock = self.device.event(), self.device.event()
        drawn = self.plan(len(levels))
        self.batch, self.order, self.rates = drawn.order.shape[1], drawn.order, drawn.rates
        levels = [[*level, *(side.shot for side in sides)] for level in levels]
        self._numbers(levels)
        self.windows, self.late = None, recipe.steps
        if network is not None and recipe.perceptual_steps:
            self._open_window(network)
        self._upload(levels, drawn, pose, transl, gaussians)
        self.grids = self._grids()
        self._resize_lists(pair_room or max(65536, 6 * self.count * self.batch))

    def plan(self, levels: int) -> DrawnPlan:
        """The frames, backgrounds and rates of the steps. levels: sizes of the shots, 1 or 2."""
        return draw_plan(self.recipe, self.frames, levels)

    def gaussians(self) -> Gaussians:
        """A copy of the gaussians as they stand."""
        b = self.buffers
        opacity = sigmoid(b["logit"].read().astype(np.float64))
        return Gaussians(self.face.copy(), b["mu"].read(), b["quat"].read(), b["log_scale"].read(), b["rgb"].read(),
                         opacity.astype(np.float32), self.light, self.low_pass)

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Pose (T, 55, 3) rad and translation (T, 3) m, float64."""
        both = self.buffers["pose"].read()[:self.frames]
        return both[:, :JOINTS].copy(), both[:, JOINTS].copy()

    def betas(self) -> np.ndarray:
        """(B,) float64, learned on top of the body's betas; empty where none are learned."""
        return self.buffers["betas"].read() if self.recipe.beta_rate else np.zeros(0)

    def expressions(self) -> np.ndarray:
        """(T, E) float64, learned on top of the expressions that are in the rest vertices."""
        return self.buffers["expression"].read()[:self.frames]

    def joint_offset(self) -> np.ndarray:
        """(55, 3) float64 m, learned on top of the joints at rest."""
        return self.buffers["joint_offset"].read()

    def gains(self) -> np.ndarray:
        """(T, 3), one for each of a frame's colour channels; 1 where none are learned."""
        return self.buffers["gain"].read()[:self.frames]

    def offset(self) -> np.ndarray:
        """(V, 3) m, the learned displacement of the vertices at rest, without that by betas."""
        return self.buffers["offset"].read() - self._beta_offset()

    def _beta_offset(self) -> np.ndarray | float:
        """(V, 3) m, the displacement of the vertices at rest by the learned betas."""
        return (self.body.shape @ self.betas()).astype(np.float32) if self.recipe.beta_rate else 0.0

    def memory(self) -> int:
        """Bytes of the device's memory that this training holds."""
        return self.arrays.memory()

    def poison(self) -> None:
        """Fills with NaN all that a step must write before it reads."""
        self.arrays.poison()

    def train(self, steps: int) -> None:
        """Does `steps` more steps, at most to the recipe's end; lists that prove too short are made longer and nothing is lost."""
        stop = min(self.state().step + steps, self.recipe.steps)
        begin, end = self._clock
        self.device.mark(begin)
        self._advance(stop)
        self.device.mark(end)
        self.seconds += self.device.milliseconds(begin, end) / 1e3

    def _advance(self, stop: int) -> None:
        parts = [(min(stop, self.late), self._replay)]
        if stop > self.late:
            parts.append((stop, self._replay_late))
        for until, replay in parts:
            self._set_state(stop=until)
            while (left := until - self.state().step) > 0:
                replay(left)
                self.device.wait()
                state = self.state()
                if state.overflow:
                    self._resize_lists(state.needed * 3 // 2)

    def _replay(self, steps: int) -> None:
        if self._graph is None:
            self._graph = self.device.graph(lambda: [self.step() for _ in range(REPLAY)])
        for _ in range(-(-steps // REPLAY)):
            self.device.replay(self._graph)

    def _replay_late(self, steps: int) -> None:
        windows = self.windows
        assert windows is not None
        count, height, width = windows.size
        for _ in range(steps):
            for name in self.grids:
                if name == "image_gradient":
                    self.device.launch("cut_window", (-(-height * width // 256), count), 256, self.scene)
                    windows.launch()
                self.launch(name)

    def step(self) -> None:
        """Launches one step's kernels; they do nothing from step `State.stop` on."""
        for name in self.grids:
            self.launch(name)

    def launch(self, name: str) -> None:
        """Launches one kernel of the step."""
        self.device.launch(name, *self.grids[name], self.scene)

    def state(self) -> State:
        """A copy of the counters on the device."""
        return State.from_buffer_copy(self.buffers["state"].read().tobytes())

    def place(self, pose: np.ndarray, transl: np.ndarray) -> None:
        """Sets the poses to go on from, and to be pulled to, with empty moments. pose: (T, 55, 3) rad; transl: (T, 3) m."""
        turns, shifts = self._with_sides(pose, transl)
        both = np.concatenate([turns, shifts[:, None]], 1)
        for name in ("pose", "fit"):
            self.buffers[name].write(both)
        for name in ("pose_first", "pose_second", "pose_steps", "expression_first", "expression_second"):
            if name in self.buffers:
                self.buffers[name].fill(0)

    def _with_sides(self, pose: np.ndarray, transl: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The poses with those of the sides behind them. pose: (T, 55, 3) rad; transl: (T, 3) m."""
        shown_by = [side.frame for side in self.sides]
        turned = np.array(pose[shown_by], np.float64)
        if self.sides:
            turned[:, 0] = rotation.log(np.stack([side.turn for side in self.sides]) @ rotation.exp(turned[:, 0]))
        return np.concatenate([pose, turned]), np.concatenate([transl, transl[shown_by]])

    def wear(self, rest: np.ndarray) -> None:
        """Sets the frames' vertices at rest, in other expressions. rest: (R, V, 3) m, of as many shapes as the body came with."""
        self.buffers["rest"].write(np.asarray(rest, np.float32))

    def replace(self, gaussians: Gaussians, resting: np.ndarray | None = None, reach: float | None = None) -> None:
        """Sets the gaussians to go on from; the body's displacement, which the caller has folded into them, becomes zero.

        resting: (N,) bool, gaussians that no longer move; reach: m, in the place of the recipe's.
        """
        for name, array in self._values(gaussians).items():
            self.buffers[name].write(array)
        if resting is not None:
            self.buffers["resting"].write(resting)
        if reach is not None:
            self.scene.reach = reach
            self._forget_graph()
        self.buffers["offset"].write(np.zeros((self.scene.vertex_count, 3), np.float32) + self._beta_offset())

    def losses(self) -> np.ndarray:
        """(steps done, batch) of each frame of each step."""
        return self.buffers["losses"].read()[: self.state().step]

    def _forget_graph(self) -> None:
        """To be called when the scene has changed: a graph keeps the scene that it was recorded with."""
        if self._graph is not None:
            self.device.drop(self._graph)
            self._graph = None

    def close(self) -> None:
        """Frees the device's memory."""
        self._forget_graph()
        self.arrays.free()

    def shot_size(self, step: int) -> tuple[int, int]:
        """Height and width of the first frame of a step."""
        level = self.rates["level"][step]
        return self.sizes[level * self.scene.frame_count + self.order[step, 0]]

    def want_gradients(self) -> None:
        """From now on the buffers `grad_out` (N, 14) and `pose_grad_out` (batch, 56, 3) hold the last step's gradients."""
        self.arrays.allocate("grad_out", (self.count, 14), np.float32)
        self.arrays.allocate("pose_grad_out", (self.batch, JOINTS + 1, 3), np.float64)
        self._graph = None

    def _upload(self, levels: list[list[Shot]], drawn: DrawnPlan, pose: np.ndarray, transl: np.ndarray,
                gaussians: OnFaces) -> None:
        arrays = self.arrays
        sharp = np.where(np.arange(len(levels[0])) < self.frames, 0, self.recipe.sharp)
        upload_shots(arrays, levels, self.body.rest_of, sharp)
        arrays.upload("plan", drawn.rates.view(np.uint8), np.uint8)
        arrays.upload("order", drawn.order, np.int32)
        arrays.upload("background", drawn.background, np.float32)
        upload_body(arrays, self.body, self.recipe, *self._with_sides(pose, transl))
        self._upload_gaussians(self._values(gaussians))
        arrays.allocate("losses", (self.recipe.steps, self.batch), np.float32).fill(0)
        arrays.allocate("state", ctypes.sizeof(State), np.uint8).fill(0)
        self._make_scratch()

    def _upload_gaussians(self, values: dict[str, np.ndarray]) -> None:
        upload_gaussians(self.arrays, values, self.face, self.light, self.body, self.recipe)

    def _values(self, gaussians: Any) -> dict[str, np.ndarray]:
        """Buffer's name -> its content, (N, ...). gaussians: those that this kind of trainer starts from."""
        return {"mu": gaussians.mu, "quat": gaussians.quat, "log_scale": gaussians.log_scale, "rgb": gaussians.rgb,
                "logit": opacity_logit(gaussians.opacity.astype(np.float64)), "start": gaussians.mu}

    def _make_scratch(self) -> None:
        make_scratch(self.arrays, self.recipe)

    def _numbers(self, levels: list[list[Shot]]) -> None:
        """Sizes and weights in the scene."""
        recipe, scene = self.recipe, self.scene
        self.sizes = sizes = [shot.pixels.shape[:2] for level in levels for shot in level]
        scene.frame_count, scene.batch, scene.count = len(levels[0]), self.batch, self.count
        scene.vertex_count = self.body.rest.shape[1]
        scene.low_pass_px2, scene.low_pass_energy = self.low_pass.px2, self.low_pass.keeps_energy
        scene.max_pixels = max(h * w for h, w in sizes)
        scene.max_tiles = max(-(-h // TILE) * -(-w // TILE) for h, w in sizes)
        for name in ("ssim", "sobel", "mask", "pose_pull", "turn_unit", "shift_unit", "needle", "least", "reach", "tie",
                     "offset_every", "joint_unit", "fresh", "tiny"):
            setattr(scene, name, getattr(recipe, name))

    def _open_window(self, network: FeatureDistance, windows: int = 1, precision: str = "bfloat16") -> None:
        """Prepares LPIPS of windows of a step's first frames for the last steps. precision: of `perceptual.Windows`."""
        from gsac.avatar.cuda.perceptual import SIDE, Windows

        recipe, scene = self.recipe, self.scene
        self.late = max(recipe.steps - recipe.perceptual_steps, 0)
        self.rates["centre"][self.late:] = np.random.default_rng([recipe.seed, 1]).integers(scene.vertex_count,
                                                                                         size=recipe.steps - self.late)
        scene.whole_width, scene.whole_height = recipe.frame_size
        scene.window_width, scene.window_height = (min(SIDE, side) for side in recipe.frame_size)
        scene.perceptual = recipe.perceptual * self.batch  # only the first frame of a batch has it
        self.windows = Windows(self.device, network, (windows, scene.window_height, scene.window_width), precision)
        for name, tensor in (("window", self.windows.images), ("window_slope", self.windows.slopes),
                             ("window_value", self.windows.values)):
            setattr(scene, name, tensor.data_ptr())

    def _grids(self) -> dict[str, tuple[tuple[int, int], int]]:
        """The kernels of a step in their order, with blocks and threads."""
        batch, n, v, p = self.batch, self.count, self.scene.vertex_count, self.device.processors
        tiles = batch * self.scene.max_tiles
        grids = {
            "skin": ((-(-v // 256), batch), 256), "project": ((-(-n // 128), batch), 128),
            "allocate": ((-(-self.scene.max_tiles // 256), batch), 256), "fill": ((-(-n // 128), batch), 128),
            "blend": ((min(tiles, 6 * p), 1), 256), "compare": ((min(tiles, 12 * p), 1), 256),
            "image_gradient": ((min(tiles, 12 * p), 1), 256), "blend_backward": ((5 * p, 1), 256),
            "gaussian_step": ((-(-n // 128), 1), 128), "gather": ((-(-v // 128), batch), 128),
            "joint_step": ((JOINTS + 1, batch), 512)}
        if self.recipe.offset_rate:
            grids["offset_step"] = ((-(-v // 256), 1), 256)
        if self.recipe.beta_rate:
            grids |= {"shape_gradient": ((-(-v // 256), 1), 256), "shape_step": ((-(-v // 256), 1), 256)}
        if self.recipe.expression_rate:
            grids["expression_step"] = ((self.scene.expression_count, batch), 256)
        if self.recipe.joint_rate:
            grids["place_joints"] = ((1, 1), 192)
        return grids

    def _resize_lists(self, room: int) -> None:
        """Makes room for `room` (tile, gaussian) pairs of a batch."""
        make_pairs(self.arrays, room)
        self._forget_graph()
        self._set_state(overflow=0)

    def _set_state(self, **values: int) -> None:
        state = self.state()
        for name, value in values.items():
            setattr(state, name, value)
        self.buffers["state"].write(np.frombuffer(bytes(state), np.uint8))

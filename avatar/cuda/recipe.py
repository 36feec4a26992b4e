"""The numbers of a training on the GPU (`Recipe`), and its plan: frames, backgrounds and rates of all steps, drawn in advance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from gsac.avatar.cuda.structs import MOST_BATCH, PLAN

FROM_CONFIG = ("seed", "mu_rate", "rgb_rate", "quat_rate", "scale_rate", "opacity_rate", "pose_rate", "pose_pull",
               "joint_rate", "ssim", "sobel", "mask", "needle", "reach", "place_pull")
"""Fields of a recipe that a configuration has by the same name."""

OF_FRAMES = ("pose", "offset", "betas", "gain", "expression", "joints")
"""Rates of what only frames teach."""


@dataclass(kw_only=True)
class Recipe:
    """Defaults are neutral: what is not given is not learned (rates), not in the loss (weights) and not limited."""

    steps: int
    batch: int = 1
    """Frames of one step, at most as many as there are."""
    seed: int = 0
    begin: float = 0.0
    """Share of the steps at whose rates the training begins: a refit begins late."""
    coarse_share: float = 0.0
    """Share of the steps that run on the first of two levels."""
    mu_rate: float = 0.0
    rgb_rate: float = 0.0
    quat_rate: float = 0.0
    scale_rate: float = 0.0
    opacity_rate: float = 0.0
    mu_end: float = 0.01
    """Factor that the rate of the places falls to."""
    end: float = 0.1
    """Factor that all other rates of the gaussians fall to."""
    pose_rate: float = 0.0
    pose_pull: float = 0.0
    ssim: float = 0.0
    sobel: float = 0.0
    mask: float = 0.0
    needle: float = math.inf
    least: float = 0.0
    """Shortest axis of a gaussian, m at rest."""
    largest: float | np.ndarray = math.inf
    """Longest axis of a gaussian, m at rest; (F,) by the face that carries it."""
    tied: bool | np.ndarray = False
    """Whether gaussians stay flat on their face and near their start; (F,) by face."""
    tie: float = math.inf
    """m at rest that those may move away from their start."""
    reach: float = math.inf
    place_pull: float = 0.0
    turn_unit: float = 1.0
    """rad, unit of a turn away from the fit's pose."""
    shift_unit: float = 1.0
    """m, unit of a shift away from the fit's translation."""
    offset_rate: float = 0.0
    """m of a step of the body's displacement at rest, falls to a tenth over its share of the steps."""
    offset_share: float = 1.0
    """Share of the steps, the first, that displace; then `CudaTrainer.replace` takes the gaussians it was folded into."""
    offset_every: int = 1
    """Steps whose gradients are gathered for one step of the displacement."""
    beta_rate: float = 0.0
    """Adam rate of the betas, which all frames share."""
    expression_rate: float = 0.0
    """Adam rate of each frame's expression, falls to a hundredth; pulled to the fit's as poses are."""
    joint_rate: float = 0.0
    """m, Adam rate of the joints at rest, which all frames share; falls and is pulled likewise."""
    joint_unit: float = 1.0
    """m, unit of a joint's distance from the fit's."""
    gain_rate: float = 0.0
    """Step of each frame's gain per colour channel at the start, falls to a tenth."""
    smoothness: float = 0.0
    """lambda of the displacement's smoothing."""
    hand_share: float = 1.0
    """Pose rate of the fingers relative to the body's; the eyes stay."""
    jaw_share: float = 0.0
    """Pose rate of the jaw relative to the body's."""
    fresh: float = 0.01
    """Share of a new square in the second moment of Adam, of poses, betas and expressions."""
    tiny: float = 1e-12
    """Least root of that moment."""
    perceptual: float = 0.0
    """Weight of LPIPS, of a window of one of a step's frames, where the trainer is given a network; as a mean over the frames."""
    perceptual_steps: int = 0
    """Steps, the last, that have LPIPS in the loss."""
    sides: np.ndarray | None = None
    """(steps,) int, index of the side that a step is made on, -1 for a frame; None: all are made on frames."""
    sharp: float = 0.0
    """Weight of the L2 between alpha and its own outline, on a side."""
    frame_size: tuple[int, int] = (0, 0)
    """Width and height of the whole frame that the shots are cropped from, px."""

    @classmethod
    def of(cls, config: object, **more: Any) -> Self:
        """`FROM_CONFIG` as `config` has it, and `more`, which takes precedence. Raises AttributeError that names missing fields."""
        if missing := [name for name in FROM_CONFIG if not hasattr(config, name)]:
            raise AttributeError(f"{type(config).__name__} has no {', '.join(missing)}, which a recipe for the GPU takes from it")
        return cls(**({name: getattr(config, name) for name in FROM_CONFIG} | more))


class DrawnPlan(NamedTuple):
    order: np.ndarray
    """(steps, batch) int32, indices of frames, no frame twice in a step; those of sides follow those of frames."""
    background: np.ndarray
    """(steps, batch, 3) float32 in 0..1."""
    rates: np.ndarray
    """(steps,) structured as `structs.PLAN`."""


def draw_plan(recipe: Recipe, frames: int, levels: int) -> DrawnPlan:
    """The plan from the recipe's seed; with one frame a step the draws are those of the CPU's training."""
    batch = min(recipe.batch, frames, MOST_BATCH)
    random = np.random.default_rng(recipe.seed)
    order, background = np.empty((recipe.steps, batch), np.int32), np.empty((recipe.steps, batch, 3), np.float32)
    left: list[int] = []
    sides = np.full(recipe.steps, -1) if recipe.sides is None else recipe.sides
    for step in range(recipe.steps):
        if sides[step] < 0 and len(left) < batch:
            left = list(random.permutation(frames))
        for b in range(batch):
            order[step, b] = left.pop() if sides[step] < 0 else frames + sides[step]
            background[step, b] = random.random(3)
    done = recipe.begin + (1 - recipe.begin) * np.arange(recipe.steps) / max(recipe.steps, 1)
    rates = rates_of(recipe, done, levels)
    for name in OF_FRAMES:
        rates[name][sides >= 0] = 0
    return DrawnPlan(order, background, rates)


def zero_rates(steps: int) -> np.ndarray:
    """(steps,) as `DrawnPlan.rates`: nothing is learned, LPIPS is not in the loss."""
    rates = np.zeros(steps, [(name, np.dtype(kind)) for name, kind in PLAN.items()])
    rates["centre"] = -1
    return rates


def rates_of(recipe: Recipe, done: np.ndarray, levels: int = 1) -> np.ndarray:
    """(steps,) as `DrawnPlan.rates`. done: (steps,) shares of the training that each step has behind it."""
    rates = zero_rates(len(done))
    rates["level"] = np.where(done < recipe.coarse_share, 0, levels - 1)
    for name, rate, end in (("mu", recipe.mu_rate, recipe.mu_end), ("quat", recipe.quat_rate, recipe.end),
                            ("log_scale", recipe.scale_rate, recipe.end),
                            ("expression", recipe.expression_rate, 0.01),
                            ("joints", recipe.joint_rate, 0.01),
                            ("rgb", recipe.rgb_rate, recipe.end), ("opacity", recipe.opacity_rate, recipe.end),
                            ("pose", recipe.pose_rate, 0.01),
                            ("place_pull", recipe.place_pull if recipe.mu_rate else 0.0, recipe.mu_end)):
        rates[name] = rate * end**done
    rates["offset"] = np.where(done < recipe.offset_share, recipe.offset_rate * 0.1 ** (done / max(recipe.offset_share, 1e-9)), 0)
    rates["betas"], rates["gain"] = recipe.beta_rate, recipe.gain_rate * 0.1**done
    return rates

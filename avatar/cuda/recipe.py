"""What a training on the GPU is told, and its plan: every step's frames, backgrounds and rates, drawn before the first."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from gsac.avatar.cuda.structs import MOST_BATCH, PLAN


@dataclass(kw_only=True)
class Recipe:
    """No number here is a recipe's own: what is not given is not learned (rates), not counted (weights) and not limited."""

    steps: int
    batch: int = 1
    """Frames of one step, at most as many as there are."""
    seed: int = 0
    begin: float = 0.0
    """Share of its way at which the training begins, for the rates: a refit begins late."""
    coarse_share: float = 0.0
    """Part of the steps that run on the first of two levels."""
    mu_rate: float = 0.0
    rgb_rate: float = 0.0
    quat_rate: float = 0.0
    scale_rate: float = 0.0
    opacity_rate: float = 0.0
    pose_rate: float = 0.0
    pose_pull: float = 0.0
    ssim: float = 0.0
    sobel: float = 0.0
    mask: float = 0.0
    needle: float = math.inf
    largest: float = math.inf
    """Longest axis of a gaussian, m at rest."""
    reach: float = math.inf
    place_pull: float = 0.0
    turn_unit: float = 1.0
    """rad in which a pose's distance from the fit is measured."""
    shift_unit: float = 1.0
    """m, likewise."""
    offset_rate: float = 0.0
    """m of a step of the body's displacement at rest, falls to a tenth over its share of the steps."""
    offset_share: float = 1.0
    """Part of the steps that move it; then `CudaTrainer.replace` takes the gaussians that it was folded into."""
    offset_every: int = 1
    """Steps whose gradients are gathered for one of the displacement."""
    beta_rate: float = 0.0
    """Adam rate of the betas, which all frames share."""
    expression_rate: float = 0.0
    """Adam rate of each frame's expression, falls to a hundredth; as the poses' it is pulled, to none."""
    expression_unit: float = 1.0
    """Coefficient in which an expression's size is measured."""
    joint_rate: float = 0.0
    """m, Adam rate of the joints at rest, which all frames share, likewise."""
    joint_unit: float = 1.0
    """m."""
    gain_rate: float = 0.0
    """Step of each frame's gain per colour channel at the start, falls to a tenth."""
    smoothness: float = 0.0
    """lambda of the displacement's smoothing."""
    hand_share: float = 1.0
    """Pose rate of the fingers relative to the body's; jaw and eyes stay."""
    perceptual: float = 0.0
    """Weight of LPIPS of a window of one of a step's frames, where the trainer is given a network; as a mean over the frames."""
    perceptual_steps: int = 0
    """Steps that have it, the last."""
    frame_size: tuple[int, int] = (0, 0)
    """Width and height of the whole frame that the shots are cut from, px."""

    @classmethod
    def of(cls, config, **more) -> Recipe:
        """The fields that `config` has by the same name and not as None, `more` on top."""
        given = {f.name: getattr(config, f.name, None) for f in fields(cls)}
        return cls(**({name: value for name, value in given.items() if value is not None} | more))


class Drawn(NamedTuple):
    order: np.ndarray
    """(steps, batch) int32, indices of frames; no frame twice in a step."""
    background: np.ndarray
    """(steps, batch, 3) float32."""
    rates: np.ndarray
    """(steps,) structured as `scene.PLAN`."""


def draw(recipe: Recipe, frames: int, levels: int) -> Drawn:
    """The same draws as `stages.train.fast` makes from the seed, for one frame a step."""
    batch = min(recipe.batch, frames, MOST_BATCH)
    random = np.random.default_rng(recipe.seed)
    order, background = np.empty((recipe.steps, batch), np.int32), np.empty((recipe.steps, batch, 3), np.float32)
    left: list[int] = []
    for step in range(recipe.steps):
        if len(left) < batch:
            left = list(random.permutation(frames))
        for b in range(batch):
            order[step, b] = left.pop()
            background[step, b] = random.random(3)
    done = recipe.begin + (1 - recipe.begin) * np.arange(recipe.steps) / max(recipe.steps, 1)
    return Drawn(order, background, rates_of(recipe, done, levels))


def no_rates(steps: int) -> np.ndarray:
    """(steps,) as `Drawn.rates`: nothing is learned, LPIPS takes no part."""
    rates = np.zeros(steps, [(name, np.dtype(kind)) for name, kind in PLAN.items()])
    rates["centre"] = -1
    return rates


def rates_of(recipe: Recipe, done: np.ndarray, levels: int = 1) -> np.ndarray:
    """As `Drawn.rates`, of steps at these shares of the way, (steps,)."""
    rates = no_rates(len(done))
    rates["level"] = np.where(done < recipe.coarse_share, 0, levels - 1)
    for name, rate, end in (("mu", recipe.mu_rate, 0.01), ("quat", recipe.quat_rate, 0.1), ("log_scale", recipe.scale_rate, 0.1),
                            ("expression", recipe.expression_rate, 0.01),
                            ("joints", recipe.joint_rate, 0.01),
                            ("rgb", recipe.rgb_rate, 0.1), ("opacity", recipe.opacity_rate, 0.1), ("pose", recipe.pose_rate, 0.01),
                            ("place_pull", recipe.place_pull if recipe.mu_rate else 0.0, 0.01)):
        rates[name] = rate * end**done
    rates["offset"] = np.where(done < recipe.offset_share, recipe.offset_rate * 0.1 ** (done / max(recipe.offset_share, 1e-9)), 0)
    rates["betas"], rates["gain"] = recipe.beta_rate, recipe.gain_rate * 0.1**done
    return rates

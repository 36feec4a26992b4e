"""Parameters of stage `train`."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final, Literal

from gsac.stages.body_choice import OPEN, brought_files
from gsac.stages.contract import BadInput

Recipe = Literal["fast", "paper"]
Device = Literal["auto", "cpu", "cuda"]
Lpips = Literal["auto", "none", "judge", "loss", "vgg-hed"]
AUTO: Final = "auto"
"""`gaussians` that the size search chooses; `device` that the engine chooses; `lpips` as the recipe has it."""
FULL_SIZE = 12000
"""Gaussians that `largest` is meant for."""
FAST_STEPS = {"cpu": 1200, "cuda": 3200}
"""Steps of recipe fast where none are configured, by device. More than twice the CPU's on a GPU: 0.4 s more for 0.15 dB, 0.3 with
poses moved to their images."""
SMALL, LARGE = (3e4, 0.15), (1.6e5, 0.8)
"""Pixels of a person in a frame, and the share of the steps, the first, that run at half the size: small images are cheap, large
ones have little that half the size does not show. A longer training has no more of these steps than one of the CPU's."""
SIZES = 3000, 30000
"""Least and most gaussians where none are asked for: `FULL_SIZE` for a person of `LARGE`, half as many for a quarter of it."""
MORE = {"cpu": 1.15, "cuda": 1.5}
"""Factor on them by device: joints take some more, and on a GPU they cost least."""
NETWORKS = ("lpips-vgg", "lpips-alex")
VGG_HED = "vgg-hed"
"""The network whose features take the place of LPIPS in the loss; it is no LPIPS, and its figure has its own name."""
MOST_FRAMES = 10**6
"""Largest number of a frame."""


def coarse_share(pixels: float) -> float:
    """Share of the steps, the first, that run at half the size. pixels: of the person in a frame."""
    (small, least), (large, most) = SMALL, LARGE
    part = math.log(max(pixels, 1) / small) / math.log(large / small)
    return least + (most - least) * min(max(part, 0.0), 1.0)


def coarse_steps(pixels: float, steps: int) -> int:
    """Number of steps, of `steps`, that run at half the size. pixels: of the person in a frame."""
    return math.ceil(coarse_share(pixels) * min(steps, FAST_STEPS["cpu"]))


def asked_size(pixels: float, device: str) -> int:
    """Gaussians that a person of so many pixels in a frame asks for on `device` (cpu, cuda)."""
    return round(min(max(MORE[device] * FULL_SIZE * (pixels / LARGE[0]) ** 0.5, SIZES[0]), SIZES[1]), -3)


def read_numbers(text: int | str) -> list[int]:
    """Rising frame numbers of a list such as `100-119,125`. Raises BadInput."""
    found: set[int] = set()
    for part in str(text).split(","):
        span = re.fullmatch(r"\s*(\d+)\s*(?:-\s*(\d+)\s*)?", part)
        first, last = (int(span[1]), int(span[2] or span[1])) if span else (0, -1)
        if last < first or last > MOST_FRAMES:
            raise BadInput(f"train.heldout_frames has {part.strip()!r}; expected frame numbers from 0 to {MOST_FRAMES} such as "
                           "100-119,125")
        found.update(range(first, last + 1))
    return sorted(found)


@dataclass
class TrainConfig:
    body_model: str = OPEN
    """Which body; the same as smplx.body_model."""
    recipe: Recipe = "fast"
    """Which optimisation fits the gaussians: fast; or paper, with one gaussian a face and its own rates."""
    paper_text: bool = False
    """Whether recipe paper has its losses as the paper's text: L2 and SSIM without alpha times mask, squared Sobel, no Dice."""
    device: Device = AUTO
    """Where the steps run: cpu, cuda, or auto: cuda where a GPU can be used."""
    gaussians: int | str = AUTO
    """How many; auto: the smallest size whose held-out frames score as well as with as many as the person's pixels ask for: 14,000
    for a person of 1,000 px, 18,000 on a GPU. Recipe fast adds up to 2 %, halves of those that a bent joint would lift off
    the body. Recipe paper has one a face."""
    every_size: bool = False
    """Whether auto tries all its sizes instead of stopping at the first that scores worse: for `gsac bench size`."""
    steps: int | None = None
    """Optimisation steps; null: the recipe's own: fast 1200 of one frame, 3200 on cuda; paper 3000 of four frames."""
    height: int | None = None
    """Height of the images to train on, px; null: the frames' own. Smaller frames are not enlarged."""
    seed: int = 0
    """Seed of the placement, the order of the frames and the backgrounds."""
    holdout: int = 8
    """Holds out every k-th frame, in the order of the body's yaw, for judging; at least one. 0, or fewer than 5 frames: none."""
    heldout_frames: int | str | None = None
    """Numbers of the frames to hold out for judging, from 0 and with both ends, such as 100-119,125: the test frames of a published
    protocol. null: by holdout."""
    curve: int = 0
    """How often the held-out frames are judged during training, for the curve in metrics.json; that time is not counted."""
    mu_rate: float = 3e-3
    """Adam rate of the positions (face units) at the start; falls to a hundredth."""
    rgb_rate: float = 1e-2
    """Adam rate of the colours at the start; falls to a tenth, like the three below."""
    quat_rate: float = 1e-2
    """Adam rate of the rotations."""
    scale_rate: float = 2e-2
    """Adam rate of the log scales."""
    opacity_rate: float = 3e-2
    """Adam rate of the opacity logits."""
    pose_rounds: int = 3
    """Rounds of Gauss-Newton that align all poses to small images before the steps (fast); 0: none, and none later."""
    pose_rate: float = 2e-3
    """Adam rate of orientation, body pose (rad) and translation (m), falls to a hundredth; the hands have a tenth of it. On the CPU
    late steps go by the frame's Hessian instead, but for the hands (fast). 0: no step moves a pose."""
    pose_pull: float = 1e-4
    """Weight of the squared distance of a refined pose from its start, in units of 0.05 rad and 2 cm."""
    joint_rate: float = 0.0
    """Adam rate of the joints at rest, m, shared by all frames (fast), falls to a hundredth; pulled likewise, in units of 1 cm."""
    light: bool = True
    """Whether to separate the clip's light, which stays while the person turns, from the colours (fast)."""
    exposure: bool = False
    """Whether to learn a gain per frame and colour channel (fast)."""
    ssim: float = 0.1
    """Weight of 1 - SSIM beside L2."""
    sobel: float = 0.0
    """Weight of the Sobel term beside L2."""
    mask: float = 0.3
    """Weight of the L2 between the avatar's alpha and the mask."""
    needle: float = 4.0
    """Largest ratio of a gaussian's longest axis to its middle one."""
    largest: float = 0.025
    """Longest axis (standard deviation) of a gaussian at rest, m, in an avatar of 12,000; fewer gaussians may be larger."""
    reach: float = 0.08
    """How far a gaussian may move from where it was placed on its face, m at rest."""
    place_pull: float = 1e-3
    """Share of that distance that each step takes back, relative to the rate of the positions."""
    pose_test_steps: int = 40
    """Steps of the test-time pose optimisation for the `*_ttpo` figures; 0 leaves these figures null."""
    flip: bool = False
    """Whether to judge held-out frames by FLIP, too, at 67 pixels a degree."""
    lpips: Lpips = AUTO
    """Where LPIPS is used, with weights that `gsac models add` brought: none; judge: metrics only; loss: also in the training loss
    (on the CPU only recipe paper, takes hours); vgg-hed: judge, and in its place in the loss the VGG features of HED; auto: with
    weights, loss for recipe paper, otherwise judge. Those VGG features are measured wherever LPIPS may be, once they are pulled."""

    def models(self) -> tuple[str, ...]:
        """Names of the model files that this configuration needs."""
        return *brought_files(self.body_model), *(NETWORKS[:1] if self.lpips == "loss" else ()), *(
            (VGG_HED,) if self.lpips == VGG_HED else ())

    def wishes(self) -> tuple[str, ...]:
        """Names of the model files that are used where the user has brought them."""
        return () if self.lpips == "none" else (*NETWORKS, VGG_HED)

    def any_of(self) -> tuple[str, ...]:
        """Names of the model files of which one must be there."""
        return NETWORKS if self.lpips == "judge" else ()

    def in_loss(self) -> str | None:
        """The network that is to be in the loss, where it can; None: none."""
        if self.lpips == VGG_HED:
            return VGG_HED
        return NETWORKS[0] if self.lpips == "loss" or self.lpips == AUTO and self.recipe == "paper" else None

    def searches_size(self) -> bool:
        """Whether held-out frames choose the number of gaussians."""
        return self.recipe == "fast" and self.gaussians == AUTO

    def check_on(self, device: str) -> None:
        """Raises BadInput where a network is asked for in a loss that the device (cpu, cuda) has none of."""
        if self.lpips in ("loss", VGG_HED) and self.recipe != "paper" and device == "cpu":
            raise BadInput(f"train.lpips is {self.lpips}, but on the CPU recipe paper alone has LPIPS in its loss; set train.lpips "
                           "to judge, or train.recipe to paper")

    def check(self) -> None:
        """Raises BadInput that names the first value that cannot be."""
        if self.recipe == "paper" and self.exposure:
            raise BadInput("train.exposure is learned by recipe fast only; set train.recipe to fast, or train.exposure to false")
        if self.paper_text and self.recipe != "paper":
            raise BadInput("train.paper_text is of recipe paper; set train.recipe to paper, or train.paper_text to false")
        if isinstance(self.gaussians, str) and self.gaussians != AUTO:
            raise BadInput(f"train.gaussians is {self.gaussians!r}; give a whole number such as 12000, or {AUTO}")
        if self.gaussians != AUTO and self.gaussians < 100:
            raise BadInput(f"train.gaussians is {self.gaussians}; it must be at least 100, or {AUTO}")
        for name, low in (("steps", 1), ("height", 64), ("seed", 0), ("holdout", 0), ("curve", 0), ("pose_rounds", 0),
                          ("pose_test_steps", 0), ("needle", 1)):
            if getattr(self, name) is not None and getattr(self, name) < low:
                raise BadInput(f"train.{name} is {getattr(self, name)}; it must be at least {low}")
        if self.heldout_frames is not None:
            read_numbers(self.heldout_frames)
        if self.holdout == 1:
            raise BadInput("train.holdout is 1: every frame would be held out; use 0 for none, or 2 and more")
        for name in ("mu_rate", "rgb_rate", "quat_rate", "scale_rate", "opacity_rate", "pose_rate", "joint_rate",
                     "pose_pull", "ssim", "sobel", "mask", "largest", "reach", "place_pull"):
            if not 0 <= getattr(self, name) < 1e3:
                raise BadInput(f"train.{name} is {getattr(self, name)}; it must be 0 or more")

"""Parameters of segment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gsac.stages.contract import BadInput

Method = Literal["pose", "selfie", "sapiens", "brought"]

MODELS: dict[Method, tuple[str, ...]] = {
    "pose": ("pose_landmark_full",), "selfie": ("selfie_segmentation",), "sapiens": ("sapiens-seg",), "brought": (),
}
"""segment.method -> the network files it needs."""


@dataclass
class SegmentConfig:
    method: Method = "pose"
    """What finds the person. pose: the body network's own mask, refined; selfie: the selfie network's, refined; sapiens: the soft
    alpha of a network that you bring by `gsac models add sapiens-seg FILE`; brought: the masks in the folder masks beside the
    footage, as they are."""
    iterations: int = 1
    """Iterations of GrabCut; 0 keeps the network's outline. For pose and selfie."""
    use_plate: bool = True
    """Whether the empty scene is used: the plate that photos came with, or for a video of a still camera the median of its
    frames."""

    def uses_device(self) -> bool:
        """Whether a network that the user brings, which may run on a GPU, makes the result."""
        return self.method == "sapiens"

    def check(self) -> None:
        if not 0 <= self.iterations <= 20:
            raise BadInput(f"segment.iterations is {self.iterations}; expected 0 to 20")

    def models(self) -> tuple[str, ...]:
        """Names of the network files that the method needs."""
        return MODELS[self.method]

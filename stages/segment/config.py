"""Parameters of segment."""

from __future__ import annotations

from dataclasses import dataclass

from gsac.stages.contract import BadInput

MODELS = {"pose": ("pose_landmark_full",), "selfie": ("selfie_segmentation",)}
"""Method -> the network files it needs."""


@dataclass
class SegmentConfig:
    method: str = "pose"
    """Which network says where the person is: pose (the body network's own mask) or selfie."""
    iterations: int = 1
    """Rounds of GrabCut; 0 keeps the network's outline."""
    use_plate: bool = True
    """Whether the empty scene joins in: the one that photos came with, or the one that a still camera's video shows
    where the person is not."""

    def check(self) -> None:
        if self.method not in MODELS:
            raise BadInput(f"segment.method is {self.method!r}; expected one of {', '.join(MODELS)}")
        if not 0 <= self.iterations <= 20:
            raise BadInput(f"segment.iterations is {self.iterations}; expected 0 to 20")

    def models(self) -> tuple[str, ...]:
        """Names of the network files that the method needs."""
        return MODELS[self.method]

"""Parameters of face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gsac.stages.brought_file import NONE
from gsac.stages.contract import BadInput

ENCODER, PLAIN, ATTENTIVE = "deca-encoder", "face_landmark", "face_landmark_with_attention"


@dataclass
class FaceConfig:
    angle: float = 125.0
    """Least angle, degrees, between the camera's viewing direction and the face's for the face to count as seen: at 180 it looks
    into the camera, 90 is a profile."""
    threshold: float = 0.5
    """Least confidence of the face network, 0..1."""
    sparsity: float = 0.3
    """Weight of the L1 penalty on the actions, against squared residuals in units of the network's noise; larger uses fewer
    actions."""
    doubt: float = 1.0
    """Factor on the network's measured noise; larger gives calmer faces."""
    smooth: float = 0.04
    """Standard deviation, s, of the smoothing over time of jaw and mouth, at least the time between frames; 0: none. Photos are not
    smoothed."""
    smooth_slow: float = 0.1
    """The same for slow actions: smiles, cheeks and nose."""
    smooth_lids: float = 0.02
    """The same for lids, however far frames are apart: a blink may last one frame."""
    smooth_brow: float = 0.35
    """Standard deviation, s, of the Gaussian over time by which frames are weighted when a frame's brows are found: one frame alone
    shows them poorly; 0: that frame alone."""
    rest_time: float = 0.2
    """Time, s, in which the expression of an unseen face falls by a factor e."""
    method: Literal["actions", "deca"] = "actions"
    """Where a FLAME head's shape, expression and jaw come from. actions: from the facial actions; deca: from DECA's encoder, which
    you bring by `gsac models add deca-encoder FILE.onnx`; it needs `face.flame`. The open body acts the actions either way."""
    flame: str = NONE
    """Name under which `gsac models add NAME FLAME.npz` keeps your FLAME head, or none. With it, smplx.method paper fits the body's
    head to FLAME's instead of the open body's, and an SMPL-X body takes its expression from it."""
    flame_points: str = "flame-points"
    """Name of FLAME's own mediapipe_landmark_embedding.npz; used only with a FLAME head."""

    def models(self) -> tuple[str, ...]:
        """Names of the model files that this configuration needs."""
        own = () if self.flame == NONE else (self.flame, self.flame_points)
        return (PLAIN, ATTENTIVE, *own, *((ENCODER,) if self.method == "deca" else ()))

    def uses_device(self) -> bool:
        """Whether a network that the user brings, which may run on a GPU, makes the result."""
        return self.method == "deca"

    def check(self) -> None:
        if not 90 <= self.angle < 180:
            raise BadInput(f"face.angle is {self.angle}; expected degrees from 90 to below 180")
        if self.method == "deca" and self.flame == NONE:
            raise BadInput("face.method is deca, but face.flame is none; DECA's numbers mean something to a FLAME head only: "
                           "`gsac models add flame FLAME.npz`, then face.flame=flame")
        if not 0 < self.threshold < 1:
            raise BadInput(f"face.threshold is {self.threshold}; expected a number between 0 and 1")
        for name in ("doubt", "rest_time"):
            if not getattr(self, name) > 0:
                raise BadInput(f"face.{name} is {getattr(self, name)}; expected a number above 0")
        for name in ("sparsity", "smooth", "smooth_slow", "smooth_lids", "smooth_brow"):
            if getattr(self, name) < 0:
                raise BadInput(f"face.{name} is {getattr(self, name)}; expected 0 or more")

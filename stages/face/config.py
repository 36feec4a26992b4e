"""Parameters of face."""

from __future__ import annotations

from dataclasses import dataclass

from gsac.stages.contract import BadInput

NONE = "none"


@dataclass
class FaceConfig:
    angle: float = 125.0
    """A face counts as seen where it looks at least this far, degrees, away from the camera's own direction of view:
    180 looks straight into the camera, 90 is a profile."""
    threshold: float = 0.5
    """Least confidence of the face network, 0..1."""
    sparsity: float = 0.3
    """Price of each action, against one for the square of each number that tells actions apart: larger uses fewer actions."""
    doubt: float = 1.0
    """How far the network wavers, as a multiple of what was measured: larger is calmer."""
    smooth: float = 0.04
    """Standard deviation, s, of the smoothing over time of jaw and mouth, at least the time between frames; 0 is none. Photos have
    no time and are not smoothed."""
    smooth_slow: float = 0.1
    """The same of what moves slowly: smiles, cheeks and nose."""
    smooth_lids: float = 0.02
    """The same of lids, however far frames are apart: a blink may be one frame."""
    smooth_brow: float = 0.35
    """Standard deviation, s, of the weights in time of the looks that each frame's brows are found from: one look alone says little
    of them; 0 is that one look."""
    rest_time: float = 0.2
    """Time, s, in which an unseen face falls back to rest by a factor e."""

    flame: str = NONE
    """The name under which `gsac models add NAME FLAME.npz` keeps your FLAME head, or none: smplx.method paper holds the body's
    head to it instead of the open body's own head, and an SMPL-X body takes its expression from it."""
    flame_points: str = "flame-points"
    """The same of FLAME's own mediapipe_landmark_embedding.npz; only with a FLAME head."""

    def models(self) -> tuple[str, ...]:
        """Names of the model files that this configuration needs."""
        own = () if self.flame == NONE else (self.flame, self.flame_points)
        return ("face_detection_short_range", "face_landmark", *own)

    def check(self) -> None:
        if not 90 <= self.angle < 180:
            raise BadInput(f"face.angle is {self.angle}; expected degrees from 90 to below 180")
        if not 0 < self.threshold < 1:
            raise BadInput(f"face.threshold is {self.threshold}; expected a number between 0 and 1")
        for name in ("doubt", "rest_time"):
            if not getattr(self, name) > 0:
                raise BadInput(f"face.{name} is {getattr(self, name)}; expected a number above 0")
        for name in ("sparsity", "smooth", "smooth_slow", "smooth_lids", "smooth_brow"):
            if getattr(self, name) < 0:
                raise BadInput(f"face.{name} is {getattr(self, name)}; expected 0 or more")

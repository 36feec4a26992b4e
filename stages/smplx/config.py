"""Parameters of `smplx`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gsac.stages.body_choice import OPEN, brought_files
from gsac.stages.brought_file import NONE
from gsac.stages.contract import BadInput

Method = Literal["lm", "paper", "brought"]


@dataclass
class SmplxConfig:
    method: Method = "lm"
    """Solver of the fit. `lm`: Levenberg-Marquardt over all frames at once; `paper`: the published co-registration by Adam, slower
    and less exact; `brought`: the poses of `start` as they are."""
    start: str = NONE
    """Name of a file of poses that the fit starts from, or none: ExAvatar's, SMPLer-X's, Hand4Whole's or WHAM's, as docs/models.md
    tells, or InstantHMR's network, which sees the frames. A frame whose trunk it puts in a wrong place starts in closed form."""
    body_model: str = OPEN
    """Body model: `open`, or the name under which `gsac models add NAME SMPLX_NEUTRAL.npz` keeps your own; train and export must be
    given the same."""
    flame: str = NONE
    """Name of your FLAME head, the one of `face.flame`, or none. With it and `flame_ids` an SMPL-X body acts FLAME's expression."""
    flame_ids: str = "smplx-flame-ids"
    """Name of SMPL-X's own SMPL-X__FLAME_vertex_ids.npy; used only with a FLAME head."""
    detector_offsets: str = NONE
    """Name under which `gsac models add NAME FILE.npz` keeps the systematic errors of the detector that you brought, as
    `tools/detector_offsets.py` measures them, or none: those of the embedded detector are known, of others none."""
    height_m: float | None = None
    """Height of the person, m; fixes the scale, which one camera cannot see. null: 1.72 m is assumed, which costs taller and
    shorter people their proportions, and the avatar its looks in poses that the clip does not show."""
    focal_px: float | None = None
    """Focal length, px of the frames as split cut and scaled them, of a clip that does not carry it. null: estimated."""
    rounds: int = 2
    """`lm`: how often the correspondences of the silhouette and the spread of the person's pose are renewed."""
    iterations: int = 8
    """`lm`: Levenberg-Marquardt steps a round, at most."""
    silhouette: float = 1.0
    """`lm`: weight of the silhouette against the key points; 0 turns it off."""
    smoothness: float = 1.0
    """`lm`: weight of the temporal terms; 0 turns them off."""
    contact: float = 1.0
    """`lm`: weight of the ground; 0 turns it off. Soles lie on one plane or above it, and feet at rest in the image do not slide.
    On eight turns joints 17.1 -> 16.6 mm, acceleration's error .98 -> .79 of the truth's own; on two with planted feet soles at
    rest slide 5 mm a frame instead of 9, joints 23.0 -> 23.6 mm."""
    joint_offsets: float = 0.0
    """`lm`: standard deviation, m, of the joints' offsets from where the betas put them, the same left and right; 0 turns them off.
    On turns 0.005 measured the same within 1 %: 13.8 mm of joints, 13.2 against 13.3 mm of vertices in unseen poses."""

    def models(self) -> tuple[str, ...]:
        """Names of the model files that this configuration needs."""
        flame = () if self.flame == NONE else (self.flame, self.flame_ids)
        own = tuple(name for name in (self.detector_offsets, self.start) if name != NONE)
        return (*brought_files(self.body_model), *flame, *own)

    def uses_device(self) -> bool:
        """Whether a network that the user brings, which may run on a GPU, makes the result."""
        return self.start != NONE

    def check(self) -> None:
        """Raises BadInput where a value is out of range."""
        if self.method == "brought" and self.start == NONE:
            raise BadInput("smplx.method is 'brought', but smplx.start names no poses; bring them with `gsac models add NAME FILE`")
        if self.height_m is not None and not 0.5 <= self.height_m <= 2.5:
            raise BadInput(f"smplx.height_m is {self.height_m}; expected metres between 0.5 and 2.5")
        if self.focal_px is not None and self.focal_px <= 0:
            raise BadInput(f"smplx.focal_px is {self.focal_px}; expected pixels above 0")
        for name in ("rounds", "iterations"):
            if getattr(self, name) < 1:
                raise BadInput(f"smplx.{name} is {getattr(self, name)}; expected 1 or more")
        for name in ("silhouette", "smoothness", "contact", "joint_offsets"):
            if getattr(self, name) < 0:
                raise BadInput(f"smplx.{name} is {getattr(self, name)}; expected 0 or more")

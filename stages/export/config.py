"""Parameters of `export`."""

from __future__ import annotations

from dataclasses import dataclass

from gsac.stages.body_choice import OPEN, brought
from gsac.stages.contract import BadInput

POSES = ("a", "t")
ANIMATIONS = ("wave", "walk")


@dataclass
class ExportConfig:
    body_model: str = OPEN
    """Which body; the same as smplx.body_model."""
    ply_pose: str = "a"
    """Pose of avatar.ply and avatar.spz: a (arms half down) or t (arms out)."""
    ply_pad_sh: bool = False
    """Write the 45 zero f_rest values that older PLY importers ask for (248 bytes a gaussian instead of 68)."""
    animations: str = "wave,walk"
    """Clips that avatar.gsac, avatar.glb and viewer.html carry, by name with commas between; the first plays first."""
    licence: str = "All rights stay with the person shown"
    """Words about the use of this person's likeness, kept in the files."""

    def models(self) -> tuple[str, ...]:
        """Names of the model files that this configuration needs."""
        return brought(self.body_model)

    def check(self) -> None:
        if self.ply_pose not in POSES:
            raise BadInput(f"export.ply_pose is {self.ply_pose!r}; choose one of: {', '.join(POSES)}")
        for name in self.clip_names():
            if name not in ANIMATIONS:
                raise BadInput(f"export.animations names {name!r}; choose among: {', '.join(ANIMATIONS)}")

    def clip_names(self) -> tuple[str, ...]:
        """Names in `animations`, each once, in order."""
        return tuple(dict.fromkeys(n.strip() for n in self.animations.split(",") if n.strip()))

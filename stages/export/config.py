"""Parameters of `export`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from gsac.stages.body_choice import OPEN, brought_files
from gsac.stages.contract import BadInput

Pose = Literal["a", "t"]
AnimationName = Literal["wave", "walk"]


@dataclass
class ExportConfig:
    body_model: str = OPEN
    """Body model; the same as smplx.body_model."""
    ply_pose: Pose = "a"
    """Pose of avatar.ply and avatar.spz: a (arms half down) or t (arms out)."""
    ply_pad_sh: bool = False
    """Whether avatar.ply has the 45 zero f_rest values that older importers need (248 bytes a gaussian instead of 68)."""
    animations: str = "walk,wave"
    """Animations of avatar.gsac, avatar.glb, avatar.fbx and viewer.html: names with commas between; a player that starts by itself
    takes the first one, and viewer.html opens on the A-pose, turning slowly."""
    licence: str = "All rights stay with the person shown"
    """Terms of use of this person's likeness, written into the files."""

    def models(self) -> tuple[str, ...]:
        """Names of the model files that this configuration needs."""
        return brought_files(self.body_model)

    def check(self) -> None:
        for name in self.clip_names():
            if name not in get_args(AnimationName):
                raise BadInput(f"export.animations names {name!r}; choices: {', '.join(get_args(AnimationName))}")

    def clip_names(self) -> tuple[str, ...]:
        """Names in `animations`, each once, in order."""
        return tuple(dict.fromkeys(n.strip() for n in self.animations.split(",") if n.strip()))

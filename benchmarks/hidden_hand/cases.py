"""Rendered clips of people who hold a hand behind the back for some frames of a turn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gsac.benchmarks.clip_runs import render_clip
from gsac.pipeline.journal import Journal
from gsac.stages.contract import BadInput
from gsac.stages.smplx.lm.hidden_arms import SIDES

FRAMES, HEIGHT = 60, 480
"""Of a clip; px."""
NOISE, CRF = 0.56, 4
"""Of a larger clip that was made as small as this one."""
LEAVES = 0.97
"""Share of the clip at which the hand leaves the back: the person then faces the camera."""


@dataclass(frozen=True)
class HiddenHand:
    """A person, and the frames on end in which the hand of one side lies on the back; none: a clean turn."""

    seed: int
    side: str
    count: int

    @classmethod
    def parse(cls, text: str) -> HiddenHand:
        """From SEED:SIDE:FRAMES, or SEED for a clean turn."""
        seed, _, rest = text.partition(":")
        side, _, count = rest.partition(":") if rest else ("left", ":", "0")
        if not seed.isdigit() or side not in SIDES or not count.isdigit() or int(count) >= FRAMES:
            raise BadInput(f"case {text}: expected SEED:left:FRAMES or SEED:right:FRAMES with fewer than {FRAMES} frames, or SEED")
        return cls(int(seed), side, int(count))

    @property
    def name(self) -> str:
        """Of its folder and of its row."""
        return f"{self.seed}-{self.side}-{self.count}" if self.count else f"{self.seed}-clean"

    @property
    def hidden(self) -> np.ndarray:
        """(T,) bool, frames in which the hand lies on the back."""
        share = np.arange(FRAMES) / FRAMES
        return (share >= LEAVES - self.count / FRAMES) & (share <= LEAVES) & (self.count > 0)

    def render(self, folder: Path, say: Journal) -> Path:
        """The clip's folder below `folder`, rendered unless it is there."""
        hand = {"hidden_hand": f"{self.side}_back", "hidden_from": LEAVES - self.count / FRAMES, "hidden_to": LEAVES}
        return render_clip(folder / self.name, say, seed=self.seed, frames=FRAMES, height=HEIGHT, noise=NOISE, crf=CRF,
                           **(hand if self.count else {}))

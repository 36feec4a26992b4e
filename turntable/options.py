"""What a truth clip can be asked to be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class TurntableOptions:
    """One clip; equal options give equal clips."""

    seed: int = 1
    """Person, clothes, room, light and motion."""
    frames: int = 60
    """Frames of the clip; the turn is spread over all of them."""
    fps: float = 10.0
    """Frames a second."""
    height: int = 1280
    """Pixels; even."""
    width: int | None = None
    """Pixels, even; None: 9:16 portrait."""
    focal: float | None = None
    """Pixels; None: 1.05 times the longer side, a phone's main camera in video mode."""
    poses: Literal["turn", "novel"] = "turn"
    """`turn`: A-pose, once around. `novel`: squat, raised arms, reach, twist; PNG frames, no video, no noise."""
    feet: Literal["turning", "planted"] = "turning"
    """`turning`: feet go round with the body and lift in turn. `planted`: soles rest on the floor and step after the body."""
    hidden_hand: Literal["none", "left_back", "right_back", "left_front", "right_front"] = "none"
    """A hand that goes behind the back, or before the belly, for a while."""
    hidden_from: float | None = None
    """Where the hand has arrived, as a share of the clip; None: when the body comes to cover it."""
    hidden_to: float | None = None
    """Where the hand leaves again, as a share of the clip."""
    expression: bool = True
    """Mouth, smile, brows and blinks change; else a neutral face."""
    arm_swing: float = 1.0
    """How much arms, hands, spine and head stir; 1 is a few degrees, 0 holds them still."""
    sway: float = 1.0
    """How unevenly the person turns, shifts and steps; 1 is lifelike, 0 a turntable."""
    outside: float = 1.0
    """How far the body leaves the fit's shape basis; 0 stays inside."""
    clothing: float = 1.0
    """Thickness of clothes and hair as a factor."""
    noise: float = 1.5
    """Sensor noise, standard deviation in 8-bit steps at mid grey."""
    crf: int = 18
    """H.264 quality; lower is better."""
    supersample: int = 2
    """Samples a pixel along each axis."""
    vertices: bool = True
    """Whether truth.npz holds the bare body's vertices (0.16 MB a frame)."""
    lossless: bool = False
    """Whether the frames before coding are kept, as frames/%06d.png."""

    def check(self) -> None:
        """Raises ValueError that names the option."""
        for name, low in (("frames", 1), ("height", 32), ("supersample", 1), ("crf", 0)):
            if getattr(self, name) < low:
                raise ValueError(f"{name} is {getattr(self, name)}, expected at least {low}")
        for name in ("arm_swing", "sway", "outside", "clothing", "noise"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} is {getattr(self, name)}, expected 0 or more")
        if not self.fps > 0:
            raise ValueError(f"fps is {self.fps}, expected more than 0")
        if self.height % 2 or self.size[0] % 2:
            raise ValueError(f"size is {self.size[0]}x{self.height}, expected even numbers (H.264 wants them)")
        for name, choices in (("poses", ("turn", "novel")), ("feet", ("turning", "planted")), ("hidden_hand", HIDDEN_HANDS)):
            if getattr(self, name) not in choices:
                raise ValueError(f"{name} is {getattr(self, name)!r}, expected one of {', '.join(choices)}")
        start, stop = self.hidden
        if not 0 <= start <= stop <= 1:
            raise ValueError(f"hidden_from is {start}, hidden_to {stop}; expected 0 <= from <= to <= 1")

    @property
    def hidden(self) -> tuple[float, float]:
        """Shares of the clip between which the hand is away: towards the end, facing the camera, or half-way, facing off."""
        start, stop = (0.42, 0.58) if self.hidden_hand.endswith("front") else (0.85, 0.97)
        return (start if self.hidden_from is None else self.hidden_from,
                stop if self.hidden_to is None else self.hidden_to)

    @property
    def size(self) -> tuple[int, int]:
        """Width, height in pixels."""
        return self.width or round(self.height * 9 / 32) * 2, self.height

    @property
    def focal_px(self) -> float:
        return self.focal or 1.05 * max(self.size)


HIDDEN_HANDS = ("none", "left_back", "right_back", "left_front", "right_front")

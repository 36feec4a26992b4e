"""Options of a truth clip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args, get_origin, get_type_hints

HiddenHand = Literal["none", "left_back", "right_back", "left_front", "right_front"]
Behaviour = Literal["none", "left_pocket", "right_pocket", "pockets", "left_hip", "right_hip", "hips", "left_hair", "right_hair",
                    "crossed", "left_phone", "right_phone", "looking_down", "talking"]


@dataclass(frozen=True)
class TurntableOptions:
    """One clip; equal options give equal files."""

    seed: int = 1
    """Decides person, clothes, room, light and motion."""
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
    poses: Literal["turn", "novel", "strong"] = "turn"
    """`turn`: A-pose, once around. `novel`: squat, raised arms, reach, twist; PNG frames, no video, no noise. `strong`: likewise,
    elbows and knees bent by 100 degrees and more, both arms up, a wave, hands on hips, seen from all round."""
    distance: float = 1.0
    """Distance of the camera, as a factor on that from which the whole figure is seen."""
    feet: Literal["turning", "planted"] = "turning"
    """`turning`: feet turn with the body and lift alternately. `planted`: soles rest on the floor, then step after the body."""
    hidden_hand: HiddenHand = "none"
    """The hand that moves behind the back, or in front of the belly, for part of the clip."""
    hidden_from: float | None = None
    """Time of the hand's arrival, as a share of the clip; None: when the body covers it."""
    hidden_to: float | None = None
    """Time at which the hand leaves, as a share of the clip; None: as for hidden_from."""
    behaviour: Behaviour = "none"
    """What the person does for part of a turn: hands in pockets, on the hips, in the hair, arms crossed, a phone, a talk."""
    behaviour_from: float = 0.2
    """Time of the behaviour's beginning, as a share of the clip."""
    behaviour_to: float = 0.8
    """Time of its end, as a share of the clip."""
    behaviour_amount: float = 1.0
    """Share of the way that it goes; 1: all of it, 0: none."""
    top: Literal["shirt", "hoodie"] = "shirt"
    """`hoodie`: long, far too wide, with a hood on the back."""
    legs: Literal["trousers", "skirt"] = "trousers"
    """`skirt`: down to the knees, open at the bottom."""
    hair: Literal["drawn", "long"] = "drawn"
    """`drawn`: short or a bob, as the seed has it. `long`: down the back."""
    glasses: bool = False
    """Whether the person wears glasses."""
    hat: Literal["none", "beanie", "cap"] = "none"
    """What the person wears on the head."""
    expression: bool = True
    """Whether mouth, smile, brows and blinks move; otherwise the face stays neutral."""
    arm_swing: float = 1.0
    """Amplitude of small motions of arms, hands, spine and head; 1: a few degrees, 0: none."""
    sway: float = 1.0
    """Unevenness of turning, shifting and stepping; 1: lifelike, 0: a turntable."""
    outside: float = 1.0
    """Distance of the body from the span of the fit's shape basis, as a factor; 0: inside."""
    clothing: float = 1.0
    """Factor on the thickness of clothes and hair."""
    noise: float = 1.5
    """Sensor noise, standard deviation in 8-bit steps at mid grey."""
    crf: int = 18
    """H.264 quality; lower is better."""
    supersample: int = 2
    """Samples a pixel along each axis."""
    vertices: bool = True
    """Whether truth.npz holds the bare body's vertices (0.16 MB a frame)."""
    drawn: bool = False
    """Whether truth.npz holds the surface with clothes, hair and what is held, too."""
    lossless: bool = False
    """Whether the frames before coding are kept, as frames/%06d.png."""

    def check(self) -> None:
        """Raises a ValueError that names the wrong option."""
        for name, low in (("frames", 1), ("height", 32), ("supersample", 1), ("crf", 0)):
            if getattr(self, name) < low:
                raise ValueError(f"{name} is {getattr(self, name)}, expected at least {low}")
        for name in ("arm_swing", "sway", "outside", "clothing", "noise"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} is {getattr(self, name)}, expected 0 or more")
        for name in ("fps", "distance"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name)}, expected more than 0")
        if self.height % 2 or self.size[0] % 2:
            raise ValueError(f"size is {self.size[0]}x{self.height}, expected even numbers (H.264 wants them)")
        for name, kind in get_type_hints(type(self)).items():
            if get_origin(kind) is Literal and getattr(self, name) not in get_args(kind):
                raise ValueError(f"{name} is {getattr(self, name)!r}, expected one of {', '.join(get_args(kind))}")
        if self.behaviour != "none" and (self.poses != "turn" or self.hidden_hand != "none"):
            raise ValueError(f"behaviour is {self.behaviour}, expected none with poses {self.poses} and hidden_hand "
                             f"{self.hidden_hand}; it goes with a turn and no hidden hand")
        if not 0 <= self.behaviour_amount <= 1:
            raise ValueError(f"behaviour_amount is {self.behaviour_amount}, expected 0..1")
        if not 0 <= self.behaviour_from <= self.behaviour_to <= 1:
            raise ValueError(f"behaviour_from is {self.behaviour_from}, behaviour_to {self.behaviour_to}; "
                             "expected 0 <= from <= to <= 1")
        start, stop = self.hidden
        if not 0 <= start <= stop <= 1:
            raise ValueError(f"hidden_from is {start}, hidden_to {stop}; expected 0 <= from <= to <= 1")

    @property
    def hidden(self) -> tuple[float, float]:
        """First and last time of the hidden hand, shares of the clip.

        Behind the back: near the end, as the person faces the camera. In front: half-way, as the person faces away.
        """
        start, stop = (0.42, 0.58) if self.hidden_hand.endswith("front") else (0.85, 0.97)
        return (start if self.hidden_from is None else self.hidden_from,
                stop if self.hidden_to is None else self.hidden_to)

    @property
    def size(self) -> tuple[int, int]:
        """Width, height in pixels."""
        return self.width or round(self.height * 9 / 32) * 2, self.height

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return self.focal or 1.05 * max(self.size)


"""Faults of the person, who is rendered anew: what people do while they are filmed, and what they wear."""

from __future__ import annotations

import numpy as np

from gsac.benchmarks.stability.fault import Change, Fault, Origin

SHARES = (0.1, 0.2, 0.35, 0.5, 0.7)
"""Of the clip, in which someone does something else than turn; about its middle."""
DOINGS = {"hands-in-pockets": "pockets", "hands-on-hips": "hips", "arms-crossed": "crossed", "hand-in-hair": "left_hair",
          "holds-phone": "right_phone", "looks-down": "looking_down", "talks": "talking"}
"""Fault -> behaviour of the turntable."""
CLOTHES = {"hoodie": {"top": "hoodie"}, "skirt": {"legs": "skirt"}, "long-hair": {"hair": "long"},
           "cap-and-glasses": {"hat": "cap", "glasses": True}}
"""Fault -> options of the turntable."""
FACTORS = (0.75, 1.0, 1.5, 2.0, 3.0)
"""On the thickness of such clothes and hair."""


def hide_hand(options: dict, share: float, rng: np.random.Generator) -> tuple[dict, np.ndarray]:
    """share: of the clip in which the left hand is behind the back, before its end. Returns options and frames (0,) bool."""
    return options | {"hidden_hand": "left_back", "hidden_from": 0.97 - share, "hidden_to": 0.97}, np.zeros(0, bool)


def thicken(options: dict, factor: float, rng: np.random.Generator) -> tuple[dict, np.ndarray]:
    """factor: on the thickness of clothes and hair. Returns options and frames (0,) bool."""
    return options | {"clothing": factor}, np.zeros(0, bool)


def step(options: dict, factor: float, rng: np.random.Generator) -> tuple[dict, np.ndarray]:
    """factor: on the unevenness of a turn by steps. Returns options and frames (0,) bool."""
    return options | {"feet": "planted", "sway": factor}, np.zeros(0, bool)


def doing(behaviour: str) -> Change:
    """(options, share, random numbers) -> options of a person who behaves so for that share of the clip, and frames (0,) bool."""
    return lambda options, share, rng: (options | {"behaviour": behaviour, "behaviour_from": 0.5 - share / 2,
                                                   "behaviour_to": 0.5 + share / 2}, np.zeros(0, bool))


def wearing(clothes: dict) -> Change:
    """(options, factor, random numbers) -> options of a person who wears these, that much thicker, and frames (0,) bool."""
    return lambda options, factor, rng: (options | clothes | {"clothing": factor}, np.zeros(0, bool))


FAULTS = (
    Fault("hand-behind-back", "share of the clip", (0.08, 0.14, 0.2, 0.28, 0.4), hide_hand, Origin.PERSON),
    *(Fault(name, "share of the clip", SHARES, doing(behaviour), Origin.PERSON) for name, behaviour in DOINGS.items()),
    Fault("steps", "the person steps instead of turning on the spot; factor on the unevenness", (0.5, 1.0, 1.5, 2.0, 3.0), step,
          Origin.PERSON),
    Fault("wide-clothes", "factor on the thickness of clothes and hair", (1.5, 2.0, 2.5, 3.0, 4.0), thicken, Origin.PERSON),
    *(Fault(name, "factor on the thickness of clothes and hair", FACTORS, wearing(clothes), Origin.PERSON)
      for name, clothes in CLOTHES.items()),
)

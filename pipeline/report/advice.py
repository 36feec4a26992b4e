"""What to film differently next time, by the cause that the figures show."""

from __future__ import annotations

from enum import Enum
from typing import Any

from gsac.pipeline.report.results import number

TURN, HANDS, ENDS, PERSON, OUTLINE, CUT_OUT = 270.0, 0.5, 0.8, 0.95, 0.85, 0.95
"""Least degrees of the turn; least share of the frames with a person that show each hand, head and feet; least share of the frames
with a person; least IoU of the fitted body's and of the avatar's outline."""
FEW_PHOTOS, DARK, BLURRED, FACE_PX = 10, 0.14, 1.0, 24
"""Least photos, brightness of the person (0..1), sharpness, and px of the face's box."""


class Advice(Enum):
    """Each sentence tells what to do."""

    TURN = "Turn once fully on the spot, in 10 to 20 seconds, and film all of it."
    PHOTOS = "Take at least 12 photos, one every 30 degrees of a full turn."
    ONE_PERSON = "Let one person alone be in the picture, from the first frame to the last."
    STILL = "Stand the phone on something firm that does not move, and leave its zoom alone."
    WHOLE = "Step back until head and feet stay in the picture all the time."
    CLOSER = "Hold the phone upright and come closer, until the person fills the height of the picture."
    FACE = "Begin with the face to the camera, in even light, nothing before it."
    HANDS = "Hold the arms a little away from the body, fingers spread, so that both hands stay in view."
    LIGHT = "Turn on more light, or go outside under an even sky."
    SHARP = "Keep the picture sharp: put the phone on something firm, clean its lens, and turn more slowly."
    BACKGROUND = "Stand before a plain background that differs from the clothes."
    CLOTHES = "Wear clothes that lie close to the body, and tie long hair back."


def give_advice(metrics: dict[str, Any], facts: dict[str, float]) -> list[Advice]:
    """In the order in which it helps. metrics: train's metrics.json, {} without one; facts: figures of the sheets."""
    face = ((metrics.get("likeness") or {}).get("face")) or {}
    cut_out = number(metrics.get("alpha_iou_ttpo")) or number(metrics.get("alpha_iou")) or 1
    few = facts.get("photos", FEW_PHOTOS) < FEW_PHOTOS
    cut_off = min(facts.get("feet_share", 1), facts.get("top_share", 1)) < ENDS
    causes = {
        Advice.PHOTOS: few,
        Advice.TURN: not few and facts.get("turn_degrees", 360) < TURN,
        Advice.ONE_PERSON: facts.get("person_share", 1) < PERSON,
        Advice.STILL: bool(facts.get("moved_frames")),
        Advice.WHOLE: cut_off,
        Advice.CLOSER: not cut_off and (number(face.get("px")) or FACE_PX) < FACE_PX,
        Advice.FACE: facts.get("face_share", 1) == 0 or facts.get("face_used", 1) == 0,
        Advice.HANDS: any(facts.get(f"{side}_hand_share", 1) < HANDS for side in ("left", "right")),
        Advice.LIGHT: facts.get("brightness", 1) < DARK,
        Advice.SHARP: facts.get("sharpness", 1) < BLURRED,
        Advice.BACKGROUND: bool(facts.get("empty_masks")) or cut_out < CUT_OUT,
        Advice.CLOTHES: facts.get("outline_iou", 1) < OUTLINE,
    }
    return [advice for advice, needed in causes.items() if needed]

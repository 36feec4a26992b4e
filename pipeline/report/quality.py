"""The weak points of input, fit and avatar in words, for the details behind the verdict."""

from __future__ import annotations

from typing import Any

from gsac.pipeline.report.results import number
from gsac.stages.counting import counted

OVERFIT_DB, POSE_DB, WORST_DB = 2.0, 1.0, 3.0
TURN, OUTLINE, ALPHA_IOU, HAND, PERSON = 270.0, 0.85, 0.95, 0.5, 0.95
"""Bounds beyond which a figure is a weakness: shares and IoUs in 0..1, TURN in degrees."""


def weaknesses(metrics: dict[str, Any], facts: dict[str, float]) -> list[str]:
    """Sentences. metrics: train's metrics.json, {} without one; facts: figures of the sheets, as far as measured."""
    return [*input_weaknesses(facts), *fit_weaknesses(facts), *(avatar_weaknesses(metrics) if metrics else [])]


def input_weaknesses(facts: dict[str, float]) -> list[str]:
    """Of the clip: person, hands, face, masks."""
    found = []
    if facts.get("person_share", 1) < PERSON:
        found.append(f"A person was found in only {facts['person_share']:.0%} of the frames.")
    for side in ("left", "right"):
        seen, filled = facts.get(f"{side}_hand_share", 1), facts.get(f"{side}_hand_filled", 0)
        if seen == 0:
            found.append(f"The {side} hand was never seen; its pose is a guess.")
        elif seen < HAND:
            found.append(f"The {side} hand was seen in {seen:.0%} of the frames with a person (another {filled:.0%} were "
                         "filled from their neighbours).")
    if facts.get("face_share") == 0:
        found.append("The face was never seen; its shape and expression are the average's.")
    elif facts.get("face_used") == 0:
        found.append("No frame's face was usable; its shape and expression are the average's.")
    if facts.get("empty_masks"):
        found.append("Some masks are empty.")
    return found


def fit_weaknesses(facts: dict[str, float]) -> list[str]:
    """Of the body fit."""
    found = []
    if facts.get("turn_degrees", 360) < TURN:
        found.append(f"Only {facts['turn_degrees']:.0f} of 360 degrees of the turn were seen; the rest of the person is made up.")
    if facts.get("outline_iou", 1) < OUTLINE:
        found.append(f"The fitted body covers the person badly (outline IoU {facts['outline_iou']:.2f}): loose clothes, hair, "
                     "or a wrong fit.")
    return found


def avatar_weaknesses(metrics: dict[str, Any]) -> list[str]:
    """Of the trained avatar."""
    found = []
    psnr, train, aligned = (number(metrics.get(k)) for k in ("psnr_fg", "psnr_fg_train", "psnr_fg_ttpo"))
    if psnr is not None and train is not None and train - psnr > OVERFIT_DB:
        found.append(f"Frames that were trained on look better by {train - psnr:.1f} dB than held-out ones: it has learnt "
                     "frames rather than the person.")
    if psnr is not None and aligned is not None and aligned - psnr > POSE_DB:
        found.append(f"Aligning the pose to a held-out frame gains {aligned - psnr:.1f} dB: the poses are not exact yet.")
    rows = [row for row in metrics.get("heldout") or [] if isinstance(row, dict) and number(row.get("psnr_fg")) is not None]
    if rows and psnr is not None:
        worst = min(rows, key=lambda row: row["psnr_fg"])
        if psnr - worst["psnr_fg"] > WORST_DB:
            found.append(f"Held-out frame {worst.get('frame')} is much worse than the others ({worst['psnr_fg']:.1f} dB).")
    iou = number(metrics.get("alpha_iou"))
    if iou is not None and iou < ALPHA_IOU:
        found.append(f"Its outline misses the person's (alpha IoU {iou:.2f} on held-out frames).")
    if rows and len(rows) < 3:
        found.append(f"Quality was judged on {counted(len(rows), 'held-out frame')} only.")
    return found

"""What `face` saw, in the words of the body at hand."""

from __future__ import annotations

import numpy as np

JAW_OPEN, JAW_ANGLE = 24, 0.38
"""Place of jawOpen among face.npz's 52 actions, and the turn, rad, of a jaw that is fully open."""


def translate_expression(body, face: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, str]:
    """body: avatar.body.Body; face: arrays of face.npz. Returns expression (T, E), jaw_pose (T, 3) rad and what was lost, if any.

    The open body acts the 52 actions as they are. An official file's expressions are FLAME's, which no action names: with a FLAME
    head in face.npz they are there, without one only the jaw moves.
    """
    actions, jaw = face["expression"], face["jaw"].astype(np.float32)
    if actions.shape[1] == len(body.expression_names) and body.jaw_actions.any():
        return actions, jaw, ""
    if "flame_expression" in face:
        expression = np.zeros((len(actions), len(body.expression_names)), np.float32)
        known = min(expression.shape[1], face["flame_expression"].shape[1])
        expression[:, :known] = face["flame_expression"][:, :known]
        return expression, face["flame_jaw"].astype(np.float32), ""
    jaw = jaw.copy()
    jaw[:, 0] += JAW_ANGLE * actions[:, JAW_OPEN]
    return np.zeros((len(actions), len(body.expression_names)), np.float32), jaw, (
        "This body model has no named facial actions: of the face only the jaw is carried over; a FLAME head (face.flame) "
        "would bring the rest.")

"""Translates the facial actions of face.npz into the body model's expression and jaw pose."""

from __future__ import annotations

import numpy as np

from gsac.avatar.body import Body
from gsac.avatar.flame_file import Flame
from gsac.stages.findings import Code, Finding
from gsac.stages.smplx.flame_motion import translate_flame

JAW_OPEN, JAW_ANGLE = 24, 0.38
"""Index of jawOpen in face.npz's 52 actions, and the angle, rad, of a fully open jaw."""


def acts_actions(body: Body, face: dict[str, np.ndarray]) -> bool:
    """Whether the body's expressions are the facial actions of face.npz, (T, 52) and more arrays, as the open body's are."""
    return face["expression"].shape[1] == len(body.expression_names) and body.has_actions


def translate_rest(body: Body, face: dict[str, np.ndarray]) -> np.ndarray | None:
    """The body's (E,) expression at rest; None, its neutral face, where no face was seen.

    face: arrays of face.npz, `expression` (T, 52) and, where a face was seen, `rest_expression` (52,). An official body keeps its
    neutral face: its jaw is a joint, and joints rest without rotation.
    """
    return face.get("rest_expression") if acts_actions(body, face) else None


def translate_expression(body: Body, betas: np.ndarray, face: dict[str, np.ndarray],
                         shared: tuple[Flame, np.ndarray] | None) -> tuple[np.ndarray, np.ndarray, Finding | None]:
    """Expression (T, E), jaw_pose (T, 3) rad and what was lost.

    betas: (B,); face: arrays of face.npz, `expression` (T, 52), `jaw` (T, 3), ...; shared: the user's FLAME head and (5023,) the
    body's vertices that are its. The open body's expressions are the 52 actions. An official body's follow the FLAME head of
    face.npz by these vertices; without them only the jaw moves.
    """
    actions, jaw = face["expression"], face["jaw"].astype(np.float32)
    if acts_actions(body, face):
        return actions, jaw, None
    if "flame_expression" in face and shared is not None:
        moved = translate_flame(body, betas, *shared, face["head_vertices"], face["flame_expression"], face["flame_jaw"])
        return *moved, None
    still = np.zeros((len(actions), len(body.expression_names)), np.float32)
    if "flame_expression" in face:
        return still, face["flame_jaw"].astype(np.float32), Finding.of(Code.FLAME_LEFT_OUT)
    jaw = jaw.copy()
    jaw[:, 0] += JAW_ANGLE * actions[:, JAW_OPEN]
    return still, jaw, Finding.of(Code.JAW_ALONE)

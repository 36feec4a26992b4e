"""The structs that host and kernels share: a table for each, from which both the CUDA text and the ctypes class are made."""

from __future__ import annotations

import ctypes

INT, FLOAT, DOUBLE, LONG = ctypes.c_int, ctypes.c_float, ctypes.c_double, ctypes.c_longlong
_NAMES = {INT: "int", FLOAT: "float", DOUBLE: "double", LONG: "long long"}
MOST_BATCH = 16

FRAME = {"pixels": LONG, "tiles": INT, "width": INT, "height": INT, "fx": FLOAT, "fy": FLOAT, "cx": FLOAT, "cy": FLOAT, "rest": INT,
         "pose": INT, "left": INT, "top": INT, "sharp": FLOAT}
"""pixels, tiles: where the frame's pixels and tile flags begin; rest, pose: indices of its vertices at rest and of its pose;
left, top: px, its corner in the whole frame; sharp: 0, or of a side that no frame shows, the weight of its outline."""

PLAN = {"level": INT, "mu": FLOAT, "quat": FLOAT, "log_scale": FLOAT, "rgb": FLOAT, "opacity": FLOAT, "pose": FLOAT,
        "place_pull": FLOAT, "offset": FLOAT, "betas": FLOAT, "gain": FLOAT, "expression": FLOAT, "joints": FLOAT, "centre": INT,
        "counts": INT}
"""Of one step. level: size of the images; place_pull: share of its way that a gaussian is pulled back; offset: m of a step of the
displacement; centre: vertex in the middle of the window that LPIPS sees, -1 for no LPIPS; counts: whether the gradients of the
places in the image are summed; the others: Adam rates."""

STATE = dict.fromkeys((
    "step", "stop", "overflow", "needed", "most", "pairs", "listed", "checkpoints", "heavy", "light", "near", "segments",
    "blend_ticket", "back_ticket", "frames_done", "shape_done", "barrier", "peak"), INT) | {"joints_done": INT * MOST_BATCH}
"""Counters on the device. overflow: the lists were too short, and nothing moves until they have the length `needed`."""

POINTERS = {
    "frames": "Frame", "pixels": "unsigned char", "occupied": "unsigned char", "plan": "Plan", "order": "int",
    "background": "float",
    "state": "State", "now": "Now",
    "rest": "float", "joints": "float", "parents": "int", "joint_level": "int", "child_start": "int", "child": "int",
    "skin_index": "int", "skin_weight": "float", "corner": "int", "vertex_start": "int", "vertex_item": "int",
    "joint_start": "int", "joint_vertex": "int", "joint_weight": "float",
    "pose": "double", "fit": "double", "pose_first": "double", "pose_second": "double", "pose_share": "double", "pose_steps": "int",
    "mu": "float", "quat": "float", "log_scale": "float", "rgb": "float", "logit": "float", "first": "float", "second": "float",
    "start": "float", "face_scale": "float", "seen": "int", "clip_light": "float", "resting": "unsigned char",
    "largest": "float", "tied": "unsigned char",
    "local": "float", "transform": "float", "vertices": "float", "grad_vertices": "float", "corner_grad": "float",
    "joint_grad": "float", "splat": "float", "box": "unsigned short", "slot_start": "int", "depth": "float", "rank": "int",
    "list": "unsigned long long", "moments": "float", "tile_count": "int", "tile_start": "int", "tile_check": "int",
    "tile_done": "int", "near_flag": "unsigned char", "heavy": "int", "light": "int", "near": "int", "segment": "int",
    "checkpoint": "float", "image": "float", "grad_image": "float", "slopes": "float", "tile_loss": "float", "losses": "float",
    "near_start": "int", "near_vertex": "int", "offset_share": "float", "offset": "float", "grad_rest": "float",
    "gathered": "float", "offset_first": "float", "offset_second": "float", "solve_step": "float", "series": "float",
    "shape": "float", "joint_shape": "float", "betas": "double", "beta_first": "double", "beta_second": "double",
    "beta_part": "float", "beta_move": "float", "grad_joints": "float",
    "expression_dirs": "float", "expression": "double", "expression_first": "double", "expression_second": "double",
    "worn": "float", "joint_offset": "double", "joint_first": "double", "joint_second": "double", "joint_share": "double",
    "gain": "float", "gain_part": "float", "overlap": "float", "dice": "float",
    "nearest_gaussian": "int", "posed": "float", "hull": "float", "pull": "long long", "pull_value": "long long",
    "pulled": "float", "hits": "int", "centres": "int",
    "window": "float", "window_slope": "float", "window_value": "float",
    "grad_out": "float", "pose_grad_out": "double",
    "turn_share": "float", "tile_shown": "float", "hessian_part": "float", "hessian": "float", "pose_gradient": "double",
    "shown": "float",
}
NUMBERS = {"frame_count": INT, "batch": INT, "count": INT, "vertex_count": INT, "levels": INT, "max_tiles": INT, "max_pixels": INT,
           "pair_room": INT, "ssim": FLOAT, "sobel": FLOAT, "mask": FLOAT, "pose_pull": FLOAT, "turn_unit": FLOAT,
           "shift_unit": FLOAT, "low_pass_px2": FLOAT, "low_pass_energy": INT, "needle": FLOAT, "least": FLOAT, "reach": FLOAT,
           "tie": FLOAT, "smoothness": FLOAT,
           "series_terms": INT, "series_middle": FLOAT, "series_half": FLOAT, "offset_every": INT, "beta_count": INT,
           "area": FLOAT, "half_side": FLOAT, "edges": FLOAT, "dice_weight": FLOAT, "knn": FLOAT, "scale_limit": FLOAT,
           "masked": INT, "window_width": INT, "window_height": INT, "whole_width": INT, "whole_height": INT,
           "perceptual": FLOAT, "expression_count": INT, "joint_unit": FLOAT,
           "hessian_parts": INT, "fresh": DOUBLE, "tiny": DOUBLE}
"""area: pixels that a frame's losses are a mean over, 0: its own; it and the next six are recipe `paper`'s (paper.cuh); the next
five are LPIPS' (perceptual.cuh), the next two belong to expressions and joints at rest (shape.cuh), the next one to the
poses' normal equations (equations.cuh), the last two to Adam of the body."""


class Frame(ctypes.Structure):
    _fields_ = list(FRAME.items())


class Plan(ctypes.Structure):
    _fields_ = list(PLAN.items())


class State(ctypes.Structure):
    _fields_ = list(STATE.items())


class Scene(ctypes.Structure):
    """What every kernel is given, by value: addresses of the buffers, sizes and weights."""

    _fields_ = [(name, ctypes.c_void_p) for name in POINTERS] + list(NUMBERS.items())


def declarations() -> str:
    """The structs as CUDA text."""
    lines = ["struct Now;"]
    for name, fields in (("Frame", FRAME), ("Plan", PLAN), ("State", STATE)):
        body = (f"{_NAMES[kind]} {field};" if kind in _NAMES else f"int {field}[{MOST_BATCH}];" for field, kind in fields.items())
        lines.append(f"struct {name} {{ {' '.join(body)} }};")
    body = [f"{kind} *{name};" for name, kind in POINTERS.items()] + [f"{_NAMES[kind]} {name};" for name, kind in NUMBERS.items()]
    return "\n".join([*lines, f"struct Scene {{ {' '.join(body)} }};", ""])

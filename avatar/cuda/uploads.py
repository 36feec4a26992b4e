"""Uploads: how shots, body, gaussians and a step's scratch are laid out in the device's memory."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import face_frames
from gsac.avatar.cuda.adjacency import face_corners, joint_children, joint_levels, joint_vertices, vertex_neighbours
from gsac.avatar.cuda.arrays import JOINTS, SEGMENT, TILE, Arrays, BodyArrays, Shot
from gsac.avatar.cuda.recipe import Recipe
from gsac.avatar.cuda.smoothing import smoothing_series
from gsac.avatar.cuda.structs import FRAME
from gsac.avatar.joints import BODY, FINGERS, JAW, JAW_EYES
from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.threads import Workspace, side_by_side

NOW = 256
"""Bytes kept for each frame of the batch's `Now`; at least the struct's."""


def upload_shots(arrays: Arrays, levels: list[list[Shot]], rest_of: np.ndarray, sharp: np.ndarray) -> None:
    """Pixels and cameras of levels of T shots, and which of their tiles show the person.

    rest_of: (T,) as in BodyArrays; sharp: (T,) as in `structs.FRAME`.
    """
    frames = np.zeros(len(levels) * arrays.scene.frame_count, [(name, np.dtype(kind)) for name, kind in FRAME.items()])
    places = []
    at = tiles = 0
    for i, (t, shot) in enumerate((t, shot) for level in levels for t, shot in enumerate(level)):
        h, w = shot.pixels.shape[:2]
        frames[i] = (at, tiles, w, h, *shot.camera.focal, *shot.camera.center, rest_of[t], t, *shot.corner, sharp[t])
        places.append((shot.pixels, at, tiles))
        at, tiles = at + h * w, tiles + -(-h // TILE) * -(-w // TILE)
    pixels, occupied = np.empty((at, 4), np.uint8), np.zeros(tiles, np.uint8)

    def lay(place: tuple[np.ndarray, int, int], _: Workspace) -> None:
        shot, at, tiles = place
        own = pixels[at:at + shot.shape[0] * shot.shape[1]].reshape(shot.shape)
        own[:] = shot
        _mark_tiles(own.view(np.uint32)[..., 0], occupied[tiles:], TILE)

    side_by_side(lay, places)
    arrays.upload("frames", frames.view(np.uint8), np.uint8)
    arrays.upload("pixels", pixels, np.uint8)
    arrays.upload("occupied", occupied, np.uint8)


@own_kernel(nogil=True)
def _mark_tiles(pixels, occupied, tile):
    """Sets the first of `occupied` to one where a tile, row by row, shows anything. pixels: (h, w), 0 where nothing is shown; tile:
    px, its side.
    """
    height, width = pixels.shape
    columns = -(-width // tile)
    for y in range(height):
        for column in range(columns):
            found = np.uint32(0)
            for x in range(tile * column, min(tile * (column + 1), width)):
                found |= pixels[y, x]
            if found:
                occupied[y // tile * columns + column] = 1


def upload_body(arrays: Arrays, body: BodyArrays, recipe: Recipe, pose: np.ndarray, transl: np.ndarray) -> None:
    """The body, the poses and what else of it is learned, with empty Adam moments. pose: (T, 55, 3) rad; transl: (T, 3) m."""
    scene = arrays.scene
    level = joint_levels(body.parents)
    scene.levels = int(level.max()) + 1
    child_start, child = joint_children(body.parents)
    joint_start, joint_vertex, joint_weight = joint_vertices(body.skin_index, body.skin_weight, JOINTS)
    both = np.concatenate([np.asarray(pose, np.float64), np.asarray(transl, np.float64)[:, None]], 1)
    share = np.full(JOINTS + 1, recipe.hand_share)
    share[BODY], share[JAW_EYES], share[JAW], share[JOINTS] = 1, 0, recipe.jaw_share, 1
    for name, array, kind in (
            ("rest", body.rest, np.float32), ("joints", body.joints, np.float32), ("parents", body.parents, np.int32),
            ("joint_level", level, np.int32), ("child_start", child_start, np.int32), ("child", child, np.int32),
            ("skin_index", body.skin_index, np.int32), ("skin_weight", body.skin_weight, np.float32),
            ("joint_start", joint_start, np.int32),
            ("joint_vertex", joint_vertex, np.int32), ("joint_weight", joint_weight, np.float32), ("pose", both, np.float64),
            ("fit", both, np.float64), ("pose_share", share, np.float64)):
        arrays.upload(name, array, kind)
    near_start, near_vertex = vertex_neighbours(np.asarray(body.faces), body.rest.shape[1])
    if recipe.offset_rate:
        found = smoothing_series(body.faces, body.rest.shape[1], recipe.smoothness)
        scene.smoothness, scene.series_terms = recipe.smoothness, len(found.factors)
        scene.series_middle, scene.series_half = found.middle, found.half
        arrays.upload("series", found.factors, np.float32)
    on_fingers = np.where(np.asarray(body.skin_index) >= FINGERS.start, body.skin_weight, 0).sum(1)
    for name, array, kind in (("near_start", near_start, np.int32), ("near_vertex", near_vertex, np.int32),
                              ("offset_share", 1 - on_fingers, np.float32)):
        arrays.upload(name, array, kind)
    for name, shape in (("offset", (body.rest.shape[1], 3)), ("offset_first", (body.rest.shape[1], 3)),
                        ("gathered", (body.rest.shape[1], 3)), ("offset_second", 1)):
        arrays.allocate(name, shape, np.float32).fill(0)
    for name in ("pose_first", "pose_second"):
        arrays.allocate(name, both.shape, np.float64).fill(0)
    arrays.allocate("pose_steps", scene.frame_count, np.int32).fill(0)
    arrays.upload("gain", np.ones((scene.frame_count, 3)), np.float32)
    if recipe.beta_rate:
        _upload_betas(arrays, body)
    if recipe.expression_rate:
        directions = np.moveaxis(body.expression, 2, 0)
        scene.expression_count = len(directions)
        arrays.upload("expression_dirs", directions, np.float32)
        for name in ("expression", "expression_first", "expression_second"):
            arrays.allocate(name, (scene.frame_count, len(directions)), np.float64).fill(0)
    if recipe.joint_rate:
        share[0] = 0  # the pelvis is where the translation puts it
        arrays.upload("joint_share", share, np.float64)
        for name in ("joint_offset", "joint_first", "joint_second"):
            arrays.allocate(name, (JOINTS, 3), np.float64).fill(0)


def _upload_betas(arrays: Arrays, body: BodyArrays) -> None:
    """Directions of the betas, one after the other."""
    shape, joint_shape = (np.moveaxis(a, 2, 0) for a in (body.shape, body.joint_shape))
    arrays.scene.beta_count = len(shape)
    arrays.upload("shape", shape, np.float32)
    arrays.upload("joint_shape", joint_shape, np.float32)
    for name in ("betas", "beta_first", "beta_second"):
        arrays.allocate(name, len(shape), np.float64).fill(0)


def upload_gaussians(arrays: Arrays, values: dict[str, np.ndarray], face: np.ndarray, light: np.ndarray | None,
                     body: BodyArrays, recipe: Recipe) -> None:
    """Gaussians with empty Adam moments.

    values: buffer's name -> (N, ...); face: (N,); light: (4, 3) of the clip; recipe: with their limits.
    """
    scene = arrays.scene
    scale = face_frames(body.rest[0], body.faces).k[face]
    largest, tied = (np.broadcast_to(limit, len(body.faces))[face] for limit in (recipe.largest, recipe.tied))
    for name, array in (*values.items(), ("face_scale", scale), ("largest", largest)):
        arrays.upload(name, array, np.float32)
    arrays.upload("tied", tied, np.uint8)
    if light is not None:
        arrays.upload("clip_light", light, np.float32)
    start, item = face_corners(body.faces, face, scene.vertex_count)
    for name, array in (("corner", np.asarray(body.faces)[face]), ("vertex_start", start), ("vertex_item", item)):
        arrays.upload(name, array, np.int32)
    for name in ("first", "second"):
        arrays.allocate(name, (14, scene.count), np.float32).fill(0)
    arrays.allocate("seen", scene.count, np.int32).fill(0)
    arrays.allocate("resting", scene.count, np.uint8).fill(0)


def make_scratch(arrays: Arrays, recipe: Recipe) -> None:
    """Memory for what one step computes, of the sizes in the scene."""
    scene = arrays.scene
    batch, n, v = scene.batch, scene.count, scene.vertex_count
    tiles, pixels = batch * scene.max_tiles, batch * scene.max_pixels
    shapes = {
        "local": (batch, JOINTS, 9), "transform": (batch, JOINTS, 12), "vertices": (batch, v, 3),
        "grad_vertices": (batch, v, 3),
        "corner_grad": (batch, n, 9), "joint_grad": (batch, JOINTS, 12), "splat": (batch, n, 12), "depth": (batch, n),
        "grad_rest": (batch, v, 3), "solve_step": (2, v, 4), "image": (pixels, 4), "grad_image": (pixels, 4),
        "tile_loss": tiles}
    if recipe.ssim:
        shapes["slopes"] = (9, pixels)
    for name, shape in shapes.items():
        arrays.allocate(name, shape, np.float32)
    integers = {"slot_start": (batch, n), "tile_count": tiles, "tile_start": tiles, "tile_check": tiles, "tile_done": tiles,
                "heavy": tiles, "light": tiles, "near": tiles}
    for name, shape in integers.items():
        arrays.allocate(name, shape, np.int32)
    arrays.allocate("box", (batch, n, 4), np.uint16)
    arrays.allocate("near_flag", tiles, np.uint8)
    arrays.allocate("now", batch * NOW, np.uint8)
    arrays.scratch = [*shapes, *integers, "box", "near_flag", "now"]
    more = {}
    if recipe.beta_rate:
        betas = scene.beta_count
        more |= {"grad_joints": (batch, JOINTS, 3), "beta_part": (-(-v // 256), betas), "beta_move": betas}
    if recipe.joint_rate:
        more["grad_joints"] = (batch, JOINTS, 3)
    if recipe.expression_rate:
        more["worn"] = (batch, v, 3)
    for name, shape in more.items():
        arrays.allocate(name, shape, np.float32)
        arrays.scratch.append(name)
    if recipe.gain_rate:
        arrays.allocate("gain_part", (tiles, 3), np.float32)
        arrays.scratch.append("gain_part")


def make_pairs(arrays: Arrays, room: int) -> None:
    """Memory for `room` (tile, gaussian) pairs of a batch, and for what is kept of each."""
    tiles = arrays.scene.batch * arrays.scene.max_tiles
    for name, shape, kind in (("rank", room, np.int32), ("list", room, np.uint64), ("moments", (room, 9), np.float32),
                              ("segment", (room // SEGMENT + tiles, 2), np.int32),
                              ("checkpoint", (room // SEGMENT + 1, TILE * TILE, 4), np.float32)):
        arrays.allocate(name, shape, kind)
    arrays.scratch = list(dict.fromkeys([*arrays.scratch, "rank", "list", "moments", "segment", "checkpoint"]))
    arrays.scene.pair_room = room

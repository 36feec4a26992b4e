"""Differentiable CPU rasteriser of 3-D gaussians.

`render` and `render_bound` return the image and a state, from which `render_backward` and `render_bound_backward` turn the image's
gradient into the gaussians'. EWA splatting in 32x32 tiles, one global depth sort, gradients in one slot for each (tile, gaussian):
results are bitwise the same for any number of threads. float32; float64 in, float64 out (tests).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gsac.avatar import binding
from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import PIXEL, LowPass
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.raster import backward, forward, project, tiles
from gsac.avatar.raster.lit import shade_faces
from gsac.avatar.threads import Workspace


@dataclass
class State:
    """A rendering's intermediate values, which its backward pass needs. P pairs of a tile and a gaussian that it shows."""

    camera: Camera
    workspace: Workspace
    means: np.ndarray  # (N, 3) m, camera frame
    rotations: np.ndarray  # (N, 3, 3)
    scales: np.ndarray  # (N, 3) m
    opacity: np.ndarray  # (N,)
    low_pass: tuple[np.floating, bool]  # px^2, keeps energy
    lens: np.ndarray  # (4,) focal lengths and principal point, px
    lattice: np.ndarray  # (32,) x, then y of the pixel centres of a block
    splats: np.ndarray  # (N, 16), columns as in project.py
    slot_start: np.ndarray  # (N + 1,) int32: the slots of a gaussian's pairs
    tile_order: np.ndarray  # (tiles,) int, the tile with most gaussians first
    tile_start: np.ndarray  # (tiles + 1,) int32: the pairs of a tile
    pair_gaussian: np.ndarray  # (P,) int32, front to back in each tile
    pair_slot: np.ndarray  # (P,) int32
    pair_mask: np.ndarray  # (P,) uint64, a bit for each block of the tile in which it was composited
    columns: int
    """Tiles in a row of the image."""
    rgb: np.ndarray  # (H, W, 3) as rendered
    alpha: np.ndarray  # (H, W) as rendered
    bound: tuple = field(default=())
    """vertices, faces, face, mu, quat, log_scale of `render_bound`."""
    shade: np.ndarray | None = None
    """(N, 3) factors of the colours in `render_bound`; None without a light."""


class Rendering(NamedTuple):
    """Image and state of a forward pass; both may lie in its workspace."""

    rgb: np.ndarray
    """(H, W, 3) premultiplied, without background: an image is rgb + (1 - alpha) background."""
    alpha: np.ndarray
    """(H, W)."""
    state: State


class Gradients(NamedTuple):
    """Gradients of a loss with respect to free gaussians."""

    means: np.ndarray
    """(N, 3)."""
    rotations: np.ndarray
    """(N, 3, 3), of the free matrix."""
    scales: np.ndarray
    """(N, 3)."""
    rgb: np.ndarray
    """(N, 3)."""
    opacity: np.ndarray
    """(N,)."""


class BoundGradients(NamedTuple):
    """Gradients of a loss with respect to gaussians on a mesh, and to the mesh."""

    mu: np.ndarray
    """(N, 3)."""
    quat: np.ndarray
    """(N, 4)."""
    log_scale: np.ndarray
    """(N, 3)."""
    rgb: np.ndarray
    """(N, 3)."""
    opacity: np.ndarray
    """(N,)."""
    vertices: np.ndarray
    """(V, 3)."""


def render(means: np.ndarray, rotations: np.ndarray, scales: np.ndarray, rgb: np.ndarray, opacity: np.ndarray, camera: Camera,
           workspace: Workspace | None = None, low_pass: LowPass = PIXEL) -> Rendering:
    """Renders free gaussians.

    means: (N, 3) m, camera frame; rotations: (N, 3, 3); scales: (N, 3) m; rgb: (N, 3); opacity: (N,) in 0..1.
    """
    means = binding.kernel_array(means)
    real = means.dtype
    rotations, scales, rgb, opacity = (binding.kernel_array(a, real) for a in (rotations, scales, rgb, opacity))
    workspace = workspace or Workspace()
    share, take, count = workspace.share, workspace.take, len(means)
    lens = np.array([*camera.focal, *camera.center], real)
    splat_filter = real.type(low_pass.px2), low_pass.keeps_energy
    splats, depths = take("splats", (count, project.SPLAT), real), take("depths", (count,), real)
    boxes = take("boxes", (count, 4), np.int32)
    share(project.project, means, rotations, scales, rgb, opacity, lens, camera.width, camera.height, *splat_filter,
          splats, depths, boxes)

    columns, rows = -(-camera.width // project.TILE), -(-camera.height // project.TILE)
    slot_start = take("slot_start", (count + 1,), np.int32)
    seen = tiles.slots(boxes, slot_start)
    unsigned = np.uint32 if real == np.float32 else np.uint64
    order = tiles.depth_order(depths, slot_start, take("keys", (count,), unsigned), take("order", (count,), np.int32),
                              take("spare_keys", (count,), unsigned), take("spare", (count,), np.int32))
    pairs = int(slot_start[count])
    tile_start = take("tile_start", (columns * rows + 1,), np.int32)
    pair_gaussian, pair_slot = take("pair_gaussian", (pairs,), np.int32), take("pair_slot", (pairs,), np.int32)
    pair_mask = take("pair_mask", (pairs,), np.uint64)
    tiles.fill(order, seen, boxes, slot_start, columns, tile_start, pair_gaussian, pair_slot)
    # heavy tiles first, so that they spread evenly over the workers
    tile_order = np.argsort(-np.diff(tile_start), kind="stable")

    inside = np.arange(forward.LANES)
    lattice = np.concatenate([inside % forward.BLOCK, inside // forward.BLOCK]).astype(real) + real.type(0.5)
    image = take("rgb", (camera.height, camera.width, 3), real)
    alpha = take("alpha", (camera.height, camera.width), real)
    scratch = take("forward", (workspace.workers, forward.PLANES * project.TILE ** 2), real)
    share(forward.composite, tile_order, tile_start, pair_gaussian, pair_mask, splats, lattice, columns,
          scratch, image, alpha)
    state = State(camera, workspace, means, rotations, scales, opacity, splat_filter, lens, lattice, splats, slot_start, tile_order,
                  tile_start, pair_gaussian, pair_slot, pair_mask, columns, image, alpha)
    return Rendering(image, alpha, state)


def render_backward(state: State, grad_rgb: np.ndarray, grad_alpha: np.ndarray) -> Gradients:
    """Gradients of the gaussians from grad_rgb (H, W, 3) and grad_alpha (H, W), those of the rendering of `state`."""
    real, count = state.means.dtype, len(state.means)
    share, take = state.workspace.share, state.workspace.take
    moments = take("moments", (len(state.pair_slot), project.MOMENTS), real)
    scratch = take("backward", (state.workspace.workers, backward.PLANES * project.TILE ** 2), real)
    share(backward.composite_backward, state.tile_order, state.tile_start, state.pair_gaussian,
          state.pair_slot, state.pair_mask, state.splats, state.lattice, state.columns, scratch, state.rgb, state.alpha,
          binding.kernel_array(grad_rgb, real), binding.kernel_array(grad_alpha, real), moments)
    gradients = Gradients(take("grad_means", (count, 3), real), take("grad_rotations", (count, 3, 3), real),
                          take("grad_scales", (count, 3), real), take("grad_rgb", (count, 3), real),
                          take("grad_opacity", (count,), real))
    share(project.project_backward, state.means, state.rotations, state.scales, state.opacity, state.lens,
          state.camera.width, state.camera.height, *state.low_pass, state.splats, state.slot_start, moments, *gradients)
    return gradients


def screen_gradients(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Of the last backward pass: gradient with respect to the splats' centres (N, 2), 1/px, and (N,) bool, visible at all."""
    moments = state.workspace.take("moments", (len(state.pair_slot), project.MOMENTS), state.means.dtype)
    visible = np.diff(state.slot_start) > 0
    g = np.zeros((len(visible), 2))
    if visible.any():
        g[visible] = np.add.reduceat(moments[:, 1:3], state.slot_start[:-1][visible], axis=0)
    x, y = g.T
    ha, b, hc = (state.splats[:, c] for c in (project.HA, project.B, project.HC))
    return np.stack([2 * ha * x + b * y, b * x + 2 * hc * y], 1), visible


def render_bound(vertices: np.ndarray, faces: np.ndarray, gaussians: Gaussians, camera: Camera,
                 workspace: Workspace | None = None) -> Rendering:
    """Renders gaussians bound to a posed mesh. vertices: (V, 3) m, camera frame; faces: (F, 3) int."""
    vertices = binding.kernel_array(vertices)
    real = vertices.dtype
    faces, face = binding.kernel_array(faces, np.int32), binding.kernel_array(gaussians.face, np.int32)
    mu, quat, log_scale = (binding.kernel_array(a, real) for a in (gaussians.mu, gaussians.quat, gaussians.log_scale))
    workspace = workspace or Workspace()
    take, n, f = workspace.take, len(face), len(faces)
    frames = binding.FaceFrames(take("R", (f, 3, 3), real), take("T", (f, 3), real), take("k", (f,), real),
                                take("valid", (f,), np.bool_))
    bound = binding.Bound(take("means", (n, 3), real), take("rotations", (n, 3, 3), real), take("scales", (n, 3), real))
    binding.forward(workspace.share, vertices, faces, take("used", (f,), np.bool_), frames, face, mu, quat, log_scale, bound)
    shade = None if gaussians.light is None else shade_faces(gaussians.light, frames.R, face, workspace)
    rgb = gaussians.rgb if shade is None else gaussians.rgb * shade
    rendering = render(*bound, rgb, gaussians.opacity, camera, workspace, gaussians.low_pass)
    rendering.state.bound, rendering.state.shade = (vertices, faces, face, mu, quat, log_scale), shade
    return rendering


def render_bound_backward(state: State, grad_rgb: np.ndarray, grad_alpha: np.ndarray) -> BoundGradients:
    """As `render_backward`, for the state of `render_bound`: gradients of the gaussians' own values and of the vertices.

    grad_rgb: (H, W, 3); grad_alpha: (H, W). The light is a constant here: how it changes with a face's normal gives no gradient.
    """
    gradients = render_backward(state, grad_rgb, grad_alpha)
    vertices, faces, face, mu, quat, log_scale = state.bound
    real, take, n = mu.dtype, state.workspace.take, len(mu)
    out = binding.BindingGradients(take("grad_mu", (n, 3), real), take("grad_quat", (n, 4), real),
                                   take("grad_log_scale", (n, 3), real), take("grad_vertices", vertices.shape, real))
    binding.backward(state.workspace.share, vertices, faces, face, mu, quat, log_scale, gradients.means,
                     gradients.rotations, gradients.scales, take("corners", (n, 9), real), out)
    if state.shade is not None:
        gradients.rgb[:] *= state.shade
    return BoundGradients(out.mu, out.quat, out.log_scale, gradients.rgb, gradients.opacity, out.vertices)

"""Tiles of frames and their lists of splats, nearest first, as 3DGS (Kerbl et al. 2023) makes them, in plain torch."""

from __future__ import annotations

from typing import NamedTuple

import torch

TILE = 16
"""px, side of a tile."""
MOST, LEAST, STOP = 0.99, 1 / 255, 1e-4
"""Alpha at most and at least, and the transmittance below which nothing more is drawn."""


class Sheet(NamedTuple):
    """What lies under the splats of B frames."""

    width: int
    height: int
    background: torch.Tensor
    """(B, 3) in 0..1."""
    opacity: float
    exact: bool
    """Whether the backward pass gives the gradient."""


class Lists(NamedTuple):
    """P pairs of a tile and a splat of B frames of N splats each."""

    splat: torch.Tensor
    """(P,) indices among B * N, by tile and then by depth."""
    start: torch.Tensor
    """(B * rows * columns + 1,) int32, where a tile's splats begin."""
    columns: int
    rows: int


def radii(covariance: torch.Tensor) -> torch.Tensor:
    """(...,) px, three deviations of splats of covariance (..., 2, 2) along their longest axis."""
    a, b, c = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    middle = (a + c) / 2
    return torch.ceil(3 * torch.sqrt(middle + torch.sqrt((middle**2 - (a * c - b * b)).clamp(min=0.1))))


@torch.no_grad()
def make_lists(middle: torch.Tensor, radius: torch.Tensor, depth: torch.Tensor, width: int, height: int) -> Lists:
    """The lists of B frames of width x height px. middle: (B, N, 2) px; radius: (B, N) px, 0 where not drawn; depth: (B, N) m."""
    columns, rows = -(-width // TILE), -(-height // TILE)
    frames, count = radius.shape
    low = torch.div(middle - 0.5 - radius[..., None], TILE, rounding_mode="trunc").int()
    high = torch.div(middle - 0.5 + radius[..., None] + TILE - 1, TILE, rounding_mode="trunc").int()
    size = torch.tensor([columns, rows], dtype=torch.int32, device=middle.device)
    low, high = torch.minimum(low.clamp(min=0), size), torch.minimum(high.clamp(min=0), size)
    wide, tall = ((high - low) * (radius > 0)[..., None]).reshape(-1, 2).unbind(-1)
    pairs = (wide * tall).long()
    splat = torch.repeat_interleave(torch.arange(len(pairs), device=middle.device), pairs)
    inside = torch.arange(len(splat), device=middle.device) - (pairs.cumsum(0) - pairs)[splat]
    x, y = (low.reshape(-1, 2)[splat] + torch.stack([inside % wide[splat], inside // wide[splat]], -1)).unbind(-1)
    tile = (splat // count * rows + y) * columns + x
    bits = depth.float().reshape(-1).view(torch.int32)[splat].long()  # positive floats are ordered as their bits are
    key, order = ((tile << 32) | bits).sort(stable=True)
    edges = torch.arange(frames * rows * columns + 1, device=middle.device) << 32
    return Lists(splat[order], torch.searchsorted(key, edges).int(), columns, rows)

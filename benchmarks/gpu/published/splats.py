"""Drawing of splats as HAHA's rasteriser does it, a modified 3DGS: forward, and its own backward pass.

That backward pass is not the gradient in two places, both at semi-transparent pixels; `exact` asks for the gradient instead:

- behind a pixel's splats it takes for all three channels the red of the background (it reads an image as if it were one colour);
- by the alpha image a splat of alpha a, with A behind it, has T (A - a) in the place of T (1 - A).

In both cases alpha is cut at 0.99 without stopping the gradient. `composite` and `composite_back` are the plain reference of the
kernels beside this file; both work on P pairs of a tile and a splat, each pair eight numbers (`PAIR`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import torch

from gsac.benchmarks.gpu.published import formulas
from gsac.benchmarks.gpu.published.tiles import LEAST, MOST, STOP, TILE, Lists, Sheet, make_lists, radii

NEAR = 0.2
"""m: what is nearer is not drawn."""
PAIR = 8
"""Middle x and y, px; the inverse covariance's xx, xy and yy; red, green and blue."""


class Drawn(NamedTuple):
    image: torch.Tensor
    """(B, h, w, 3) over the background."""
    alpha: torch.Tensor
    """(B, h, w)."""
    radius: torch.Tensor
    """(B, N) px, 0 where not seen."""


def draw(places: torch.Tensor, quats: torch.Tensor, scales: torch.Tensor, rgb: torch.Tensor, shift: torch.Tensor,
         focal: torch.Tensor, centre: torch.Tensor, sheet: Sheet) -> Drawn:
    """Draws B frames of N posed gaussians.

    places: (B, N, 3) m, camera frame; quats: (B, N, 4) of length one; scales: (B, N, 3) m; rgb: (N, 3); shift: (B, N, 2) px, added
    to the middles; focal, centre: (B, 2) px.
    """
    middle, covariance = formulas.splats(places, quats, scales, focal, centre)
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    det = xx * yy - xy * xy
    conic = torch.stack([yy, -xy, xx], -1) / det[..., None]
    rows = torch.cat([middle + shift, conic, rgb.expand(len(places), -1, 3)], -1)
    depth = places[..., 2].detach()
    radius = torch.where(depth > NEAR, radii(covariance.detach()), 0)
    lists = make_lists(middle.detach(), radius, depth, sheet.width, sheet.height)
    image, alpha = Composite.apply(rows, lists, sheet)
    return Drawn(image, alpha, radius)


class Composite(torch.autograd.Function):
    """(image, alpha) of rows (B, N, PAIR) by their lists on a sheet."""

    @staticmethod
    def forward(ctx: Any, rows: torch.Tensor, lists: Lists, sheet: Sheet) -> tuple[torch.Tensor, torch.Tensor]:
        """Image (B, h, w, 3) and alpha (B, h, w). rows: (B, N, PAIR)."""
        passes = choose_passes(rows)
        pairs = rows.reshape(-1, PAIR)[lists.splat].T.contiguous()
        colour, left, last = passes[0](pairs, lists, sheet)
        ctx.save_for_backward(pairs, left, last)
        ctx.lists, ctx.sheet, ctx.passes, ctx.shape = lists, sheet, passes, rows.shape
        return colour + left[..., None] * sheet.background[:, None, None], 1 - left

    @staticmethod
    def backward(ctx: Any, grad_image: torch.Tensor, grad_alpha: torch.Tensor) -> tuple[torch.Tensor, None, None]:
        """Of rows (B, N, PAIR). grad_image: (B, h, w, 3); grad_alpha: (B, h, w)."""
        pairs, left, last = ctx.saved_tensors
        sheet = ctx.sheet
        ground = sheet.background if sheet.exact else sheet.background[:, :1].expand(-1, 3)
        behind = (grad_image * ground[:, None, None]).sum(-1)
        grad = ctx.passes[1](pairs, left, last, grad_image.contiguous(), grad_alpha.contiguous(), behind, ctx.lists, sheet)
        rows = torch.zeros(ctx.shape[0] * ctx.shape[1], PAIR, dtype=grad.dtype, device=grad.device)
        return rows.index_add_(0, ctx.lists.splat, grad.T.contiguous()).reshape(ctx.shape), None, None


def choose_passes(rows: torch.Tensor) -> tuple[Callable, Callable]:
    """The kernels on a GPU, their plain reference elsewhere. rows: (B, N, PAIR)."""
    if not rows.is_cuda:
        return composite, composite_back
    from gsac.benchmarks.gpu.published import kernels

    return kernels.composite, kernels.composite_back


def composite(pairs: torch.Tensor, lists: Lists, sheet: Sheet) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Premultiplied colour (B, h, w, 3), what is left of the light (B, h, w), and the number after the last pair that a pixel shows
    (B, h, w) int32. pairs: (PAIR, P)."""
    frames = len(sheet.background)
    colour = pairs.new_zeros(frames, sheet.height, sheet.width, 3)
    left, last = pairs.new_ones(colour.shape[:3]), torch.zeros(colour.shape[:3], dtype=torch.int32)
    for first, end, pixels, at in each_tile(lists, sheet):
        alpha, _, _, _ = alphas(pairs[:, first:end], at, sheet)
        after = torch.cumprod(1 - alpha, 0)
        shown = (after >= STOP) & (alpha > 0)
        weight = torch.where(shown, alpha * after / (1 - alpha), 0)
        colour[pixels] = torch.einsum("pyx,cp->yxc", weight, pairs[5:, first:end])
        left[pixels] = torch.where(shown, 1 - alpha, 1).prod(0)
        number = torch.arange(first + 1, end + 1, dtype=torch.int32)[:, None, None]
        last[pixels] = torch.where(shown, number, 0).amax(0)
    return colour, left, last


def composite_back(pairs: torch.Tensor, left: torch.Tensor, last: torch.Tensor, grad_image: torch.Tensor, grad_alpha: torch.Tensor,
                   behind: torch.Tensor, lists: Lists, sheet: Sheet) -> torch.Tensor:
    """(PAIR, P), the gradient of pairs (PAIR, P). left, last: of `composite`; grad_image: (B, h, w, 3); grad_alpha: (B, h, w);
    behind: (B, h, w), of the light that is left."""
    out = torch.zeros_like(pairs)
    for first, end, pixels, at in each_tile(lists, sheet):
        part = pairs[:, first:end]
        alpha, falloff, dx, dy = alphas(part, at, sheet)
        number = torch.arange(first, end)[:, None, None]
        alpha = torch.where(number < last[pixels], alpha, 0)
        clear = 1 - alpha
        before = torch.cat([torch.ones_like(clear[:1]), clear[:-1]]).cumprod(0)
        g, ga, light = grad_image[pixels], grad_alpha[pixels], left[pixels]
        shade = torch.einsum("yxc,cp->pyx", g, part[5:])
        lit = before * alpha * shade
        beyond = (lit.sum(0) - lit.cumsum(0)) / (before * clear)  # what the splats behind add, seen from right behind this one
        covered = 1 - light / (before * clear)
        through = (1 - covered) if sheet.exact else covered - alpha
        slope = before * (shade - beyond + through * ga) - light / clear * behind[pixels]
        slope = torch.where(alpha > 0, slope, 0) * sheet.opacity * falloff
        _, _, a, b, c = part[:5, :, None, None]
        rows = [a * dx + b * dy, b * dx + c * dy, dx * dx / 2, dx * dy, dy * dy / 2]
        out[:5, first:end] = torch.stack([-(slope * row).sum((1, 2)) for row in rows])
        out[5:, first:end] = torch.einsum("pyx,yxc->cp", before * alpha, g)
    return out


def alphas(part: torch.Tensor, at: tuple[torch.Tensor, torch.Tensor],
           sheet: Sheet) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    """Of a part (PAIR, p) of the pairs at rows (y,) and columns (x,): alpha, falloff, and middle minus pixel across and down,
    (p, y, x) each.
    """
    x, y, a, b, c = part[:5, :, None, None]
    dx, dy = x - at[1][None, None], y - at[0][None, :, None]
    power = -0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy
    falloff = torch.exp(power)
    alpha = (sheet.opacity * falloff).clamp(max=MOST)
    return torch.where((power <= 0) & (alpha >= LEAST), alpha, 0), falloff, dx + 0 * dy, dy + 0 * dx


def each_tile(lists: Lists, sheet: Sheet) -> Iterator[tuple[int, int, tuple, tuple]]:
    """First and end pair of each tile that has any, its pixels as an index of (B, h, w), and their rows and columns, px."""
    for tile in (lists.start[1:] > lists.start[:-1]).nonzero()[:, 0].tolist():
        frame, inside = divmod(tile, lists.rows * lists.columns)
        y, x = (TILE * k for k in divmod(inside, lists.columns))
        down, across = slice(y, min(y + TILE, sheet.height)), slice(x, min(x + TILE, sheet.width))
        at = torch.arange(down.start, down.stop) + 0.5, torch.arange(across.start, across.stop) + 0.5
        yield int(lists.start[tile]), int(lists.start[tile + 1]), (frame, down, across), at

"""The passes of splats.py on a GPU, in Triton: a program a tile, which goes through the tile's splats one after the other."""

from __future__ import annotations

# pyright: reportMissingImports=false, reportIndexIssue=false
# Triton comes with torch's wheels for GPUs only.
import torch
import triton
import triton.language as tl

from gsac.benchmarks.gpu.published.tiles import LEAST, MOST, STOP, TILE, Lists, Sheet


def composite(pairs: torch.Tensor, lists: Lists, sheet: Sheet) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """As `splats.composite`: (B, h, w, 3), (B, h, w) and (B, h, w) of pairs (PAIR, P)."""
    shape = len(sheet.background), sheet.height, sheet.width
    colour, left = pairs.new_empty(*shape, 3), pairs.new_empty(shape)
    last = torch.empty(shape, dtype=torch.int32, device=pairs.device)
    _composite[(len(lists.start) - 1,)](pairs, lists.start, colour, left, last, pairs.shape[1], lists.columns, lists.rows,
                                        sheet.width, sheet.height, sheet.opacity, most=MOST, least=LEAST, stop=STOP, size=TILE,
                                        num_warps=2)
    return colour, left, last


def composite_back(pairs: torch.Tensor, left: torch.Tensor, last: torch.Tensor, grad_image: torch.Tensor, grad_alpha: torch.Tensor,
                   behind: torch.Tensor, lists: Lists, sheet: Sheet) -> torch.Tensor:
    """As `splats.composite_back`: (PAIR, P) of pairs (PAIR, P).

    left, last, grad_alpha, behind: (B, h, w); grad_image: (B, h, w, 3).
    """
    out = torch.zeros_like(pairs)
    _composite_back[(len(lists.start) - 1,)](pairs, lists.start, left, last, grad_image, grad_alpha, behind.contiguous(), out,
                                             pairs.shape[1], lists.columns, lists.rows, sheet.width, sheet.height, sheet.opacity,
                                             exact=sheet.exact, most=MOST, least=LEAST, size=TILE, num_warps=1)
    return out


@triton.jit
def _pixels(tile, columns, rows, width, height, size: tl.constexpr):
    """Places of a tile's pixels among those of all frames, whether they exist, and their rows and columns."""
    frame, inside = tile // (rows * columns), tile % (rows * columns)
    k = tl.arange(0, size * size)
    y, x = inside // columns * size + k // size, inside % columns * size + k % size
    return (frame * height + y) * width + x, (y < height) & (x < width), y, x


@triton.jit
def _alpha(pairs, i, count, x, y, opacity, most: tl.constexpr, least: tl.constexpr):
    """Alpha of pair i at pixels, its falloff, middle minus pixel across and down, and the inverse covariance."""
    dx, dy = tl.load(pairs + i) - (x + 0.5), tl.load(pairs + count + i) - (y + 0.5)
    a, b, c = tl.load(pairs + 2 * count + i), tl.load(pairs + 3 * count + i), tl.load(pairs + 4 * count + i)
    power = -0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy
    falloff = tl.exp(power)
    alpha = tl.minimum(opacity * falloff, most)
    return tl.where((power <= 0) & (alpha >= least), alpha, 0.0), falloff, dx, dy, a, b, c


@triton.jit
def _composite(pairs, start, colour, left, last, count, columns, rows, width, height, opacity, most: tl.constexpr,
               least: tl.constexpr, stop: tl.constexpr, size: tl.constexpr):
    tile = tl.program_id(0)
    at, there, y, x = _pixels(tile, columns, rows, width, height, size)
    light = tl.full((size * size,), 1.0, tl.float32)
    red, green, blue = tl.zeros_like(light), tl.zeros_like(light), tl.zeros_like(light)
    final, done = tl.zeros((size * size,), tl.int32), tl.zeros((size * size,), tl.int32)
    for i in range(tl.load(start + tile), tl.load(start + tile + 1)):
        alpha, _, _, _, _, _, _ = _alpha(pairs, i, count, x, y, opacity, most, least)
        after = light * (1 - alpha)
        done = tl.where(after < stop, 1, done)
        shown = (alpha > 0) & (done == 0)
        weight = tl.where(shown, alpha * light, 0.0)
        red += weight * tl.load(pairs + 5 * count + i)
        green += weight * tl.load(pairs + 6 * count + i)
        blue += weight * tl.load(pairs + 7 * count + i)
        light = tl.where(shown, after, light)
        final = tl.where(shown, i + 1, final)
    tl.store(colour + 3 * at, red, there)
    tl.store(colour + 3 * at + 1, green, there)
    tl.store(colour + 3 * at + 2, blue, there)
    tl.store(left + at, light, there)
    tl.store(last + at, final, there)


@triton.jit
def _composite_back(pairs, start, left, last, grad_image, grad_alpha, behind, out, count, columns, rows, width, height, opacity,
                    exact: tl.constexpr, most: tl.constexpr, least: tl.constexpr, size: tl.constexpr):
    tile = tl.program_id(0)
    first, end = tl.load(start + tile), tl.load(start + tile + 1)
    if end > first:
        at, there, y, x = _pixels(tile, columns, rows, width, height, size)
        final = tl.load(last + at, there, 0)
        whole = tl.load(left + at, there, 1.0)
        red, green, blue = (tl.load(grad_image + 3 * at, there, 0.0), tl.load(grad_image + 3 * at + 1, there, 0.0),
                            tl.load(grad_image + 3 * at + 2, there, 0.0))
        by_alpha, ground = tl.load(grad_alpha + at, there, 0.0), tl.load(behind + at, there, 0.0)
        light, beyond, covered = whole, tl.zeros_like(whole), tl.zeros_like(whole)
        for k in range(end - first):
            i = end - 1 - k
            alpha, falloff, dx, dy, a, b, c = _alpha(pairs, i, count, x, y, opacity, most, least)
            shown = (alpha > 0) & (i < final)
            alpha = tl.where(shown, alpha, 0.0)
            light = light / (1 - alpha)  # that reaches this splat
            shade = (red * tl.load(pairs + 5 * count + i) + green * tl.load(pairs + 6 * count + i)
                     + blue * tl.load(pairs + 7 * count + i))
            through = 1 - covered if exact else covered - alpha
            slope = light * (shade - beyond + through * by_alpha) - whole / (1 - alpha) * ground
            slope = tl.where(shown, slope * opacity * falloff, 0.0)
            weight = alpha * light
            tl.store(out + i, -tl.sum(slope * (a * dx + b * dy)))
            tl.store(out + count + i, -tl.sum(slope * (b * dx + c * dy)))
            tl.store(out + 2 * count + i, -0.5 * tl.sum(slope * dx * dx))
            tl.store(out + 3 * count + i, -tl.sum(slope * dx * dy))
            tl.store(out + 4 * count + i, -0.5 * tl.sum(slope * dy * dy))
            tl.store(out + 5 * count + i, tl.sum(weight * red))
            tl.store(out + 6 * count + i, tl.sum(weight * green))
            tl.store(out + 7 * count + i, tl.sum(weight * blue))
            beyond = alpha * shade + (1 - alpha) * beyond
            covered = alpha + (1 - alpha) * covered


def nearest(places: torch.Tensor) -> torch.Tensor:
    """(N, 3) int64 as `formulas.nearest`. places: (N, 3)."""
    out = torch.empty(len(places), 3, dtype=torch.int32, device=places.device)
    block = 32
    _nearest[(triton.cdiv(len(places), block),)](places.T.contiguous(), out, len(places), block=block, others=64, num_warps=2)
    return out.long()


@triton.jit
def _nearest(places, out, count, block: tl.constexpr, others: tl.constexpr):
    own = tl.program_id(0) * block + tl.arange(0, block)
    there = own < count
    x, y, z = (tl.load(places + own, there, 0.0)[:, None], tl.load(places + count + own, there, 0.0)[:, None],
               tl.load(places + 2 * count + own, there, 0.0)[:, None])
    far = tl.full((block,), 1e30, tl.float32)
    d0, d1, d2 = far, far, far
    i0, i1, i2 = own, own, own
    for begin in range(0, count, others):
        at = begin + tl.arange(0, others)
        real = at < count
        dx = x - tl.load(places + at, real, 1e9)[None, :]
        dy = y - tl.load(places + count + at, real, 1e9)[None, :]
        dz = z - tl.load(places + 2 * count + at, real, 1e9)[None, :]
        away = dx * dx + dy * dy + dz * dz
        least = tl.min(away, 1)
        while tl.sum((least < d2).to(tl.int32)) > 0:
            which = tl.argmin(away, 1)
            place = begin + which
            closer = least < d2
            zero, one = closer & (least < d0), closer & (least < d1)
            d2, i2 = tl.where(one, d1, tl.where(closer, least, d2)), tl.where(one, i1, tl.where(closer, place, i2))
            d1, i1 = (tl.where(zero, d0, tl.where(one, least, d1)), tl.where(zero, i0, tl.where(one, place, i1)))
            d0, i0 = tl.where(zero, least, d0), tl.where(zero, place, i0)
            away = tl.where(at[None, :] == place[:, None], 1e30, away)
            least = tl.min(away, 1)
    tl.store(out + 3 * own, i0, there)
    tl.store(out + 3 * own + 1, i1, there)
    tl.store(out + 3 * own + 2, i2, there)

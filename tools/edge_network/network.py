"""The edge network: a U-Net at half size and below, and its file."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional

PLANES = 9
"""Those of `CloseUp.stacked`."""
OUTLINE = 7
"""The plane that is the outline."""
WIDTHS = 32, 48, 64, 64
"""Channels at a half, a quarter, an eighth and a sixteenth of the size."""
PULL = 4.0
"""Of the outline: the logit begins at 2 inside, -2 outside."""


class EdgeNetwork(nn.Module):
    def __init__(self):
        super().__init__()
        before = (4 * PLANES, *WIDTHS)
        self.down = nn.ModuleList(nn.ModuleList((_conv(a, b), _conv(b, b))) for a, b in zip(before, WIDTHS, strict=False))
        self.up = nn.ModuleList(nn.ModuleList((nn.Conv2d(b, a, 1), _conv(a, a))) for a, b in zip(WIDTHS, WIDTHS[1:], strict=False))
        self.last = nn.Conv2d(WIDTHS[0], 4, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        """x: (N, 9, H, W) in 0..1, H and W multiples of 16. Returns logits of alpha, (N, 1, H, W)."""
        h, kept = functional.pixel_unshuffle(x - 0.5, 2), []
        for level, (first, second) in enumerate(self.down):
            h = functional.relu(second(functional.relu(first(functional.avg_pool2d(h, 2) if level else h))))
            kept.append(h)
        h = kept.pop()
        for narrow, mix in reversed(self.up):
            h = functional.relu(mix(kept.pop() + functional.interpolate(narrow(h), scale_factor=2, mode="nearest")))
        return functional.pixel_shuffle(self.last(h), 2) + PULL * (x[:, OUTLINE: OUTLINE + 1] - 0.5)


def _conv(given: int, gives: int) -> nn.Conv2d:
    return nn.Conv2d(given, gives, 3, padding=1)


class _HalfConv(nn.Module):
    """A convolution whose weights are kept in half precision."""

    def __init__(self, conv: nn.Conv2d):
        super().__init__()
        self.weight, self.bias = (nn.Buffer(x.detach().half()) for x in (conv.weight, conv.bias))
        self.padding = conv.padding

    def forward(self, x: Tensor) -> Tensor:
        return functional.conv2d(x, self.weight.float(), self.bias.float(), padding=self.padding)


class _Packed(nn.Module):
    """The network from bytes to alpha, its weights in half precision."""

    def __init__(self, network: EdgeNetwork):
        super().__init__()
        self.network = deepcopy(network).cpu().eval()
        for block in (*self.network.down, *self.network.up):
            block[0], block[1] = _HalfConv(block[0]), _HalfConv(block[1])
        self.network.last = _HalfConv(self.network.last)

    def forward(self, planes: Tensor) -> Tensor:
        """planes: (N, H, W, 9) uint8. Returns alpha (N, H, W) float32."""
        return torch.sigmoid(self.network(planes.permute(0, 3, 1, 2).float() / 255))[:, 0]


def export(network: EdgeNetwork, out: Path) -> None:
    """Writes the network as ONNX: `planes` (1, H, W, 9) uint8 -> `alpha` (1, H, W) float32."""
    sizes = {1: "height", 2: "width"}
    torch.onnx.export(_Packed(network), (torch.zeros(1, 64, 64, PLANES, dtype=torch.uint8),), str(out), dynamo=False,
                      do_constant_folding=False, opset_version=17, input_names=["planes"], output_names=["alpha"],
                      dynamic_axes={"planes": sizes, "alpha": sizes})

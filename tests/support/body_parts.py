"""A made-up network of Sapiens' shapes, whose classes and alphas follow from a pixel's colour, and pictures for it."""

import numpy as np
from onnx import helper

from gsac.avatar.sapiens import PARTS
from support.onnx_files import write_network

MEAN, DEVIATION = (123.5, 116.5, 103.5), (58.5, 57.0, 57.5)
"""Of red, green and blue, as published."""
TELLS = {"lower_clothing": (0, 150), "upper_clothing": (1, 130), "hair": (2, 110)}
"""A class and what it is told by: a channel, and its value at which the class is as likely as the background."""
STEEP = 0.125
"""Logits per step of a channel."""
CELL = 4
"""px of the input for one logit."""
HEIGHT, WIDTH = 500, 420


def weights():
    """Of the convolution (28, 3, 1, 1) that takes normalised colours, and its offsets (28,)."""
    weight, offset = np.zeros((28, 3, 1, 1), np.float32), np.full(28, -60, np.float32)
    offset[0] = 0
    for name, (channel, middle) in TELLS.items():
        weight[PARTS.index(name), channel] = STEEP * DEVIATION[channel]
        offset[PARTS.index(name)] = STEEP * (MEAN[channel] - middle)
    return weight, offset


def write_onnx(folder, classes=28, side=(1024, 768), kind="network"):
    weight, offset = weights()
    cells = helper.make_node("AveragePool", ["image"], ["cells"], kernel_shape=[CELL, CELL], strides=[CELL, CELL])
    return write_network(folder / f"{kind}.onnx", (1, 3, *side), {"logits": (1, classes, side[0] // CELL, side[1] // CELL)},
                         [cells, helper.make_node("Conv", ["cells", "weight", "offset"], ["logits"])],
                         {"weight": weight[:classes], "offset": offset[:classes]})


def write_torchscript(folder):
    import torch

    pool, conv = torch.nn.AvgPool2d(CELL), torch.nn.Conv2d(3, 28, 1)
    with torch.no_grad():
        for mine, given in zip((conv.weight, conv.bias), weights(), strict=True):
            mine.copy_(torch.from_numpy(given))
    torch.jit.trace(torch.nn.Sequential(pool, conv), torch.zeros(1, 3, 1024, 768)).save(str(folder / "network.pt2"))
    return folder / "network.pt2"


def alpha_of(colour):
    odds = sum(np.exp(STEEP * (colour[channel] - middle)) for channel, middle in TELLS.values())
    return odds / (1 + odds)


def paint(*patches, height=HEIGHT, width=WIDTH):
    """(height, width, 3) uint8: patches of x0, y0, x1, y1 and colour on a grey that shows nothing."""
    image = np.full((height, width, 3), 20, np.uint8)
    for (x0, y0, x1, y1), colour in patches:
        image[y0:y1, x0:x1] = colour
    return image

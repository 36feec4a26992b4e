"""Trains the edge network on patches of truth clips; writes it as ONNX.

    python tools/edge_network/train.py PATCHES/*.npy --out stages/segment/edge_network.onnx [--seconds 210]

The first sixteenth of the files is not trained on and judges. The kept network took 13,295 steps in 210 s of one H200: the squared
error in the three judging clips' patches ended at .28 of that of closed-form matting. On two cores a step of 8 patches takes .35 s.
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch
from augment import augment
from network import OUTLINE, PLANES, EdgeNetwork, export

BATCH = 64
RATE, WARM_UP, FALL = 1.5e-3, 200, 0.9
"""Adam's largest rate, the steps in which it rises, and the power by which it falls to the end."""
DECAY, MOST_GRADIENT = 1e-4, 1.0
TELL = 1000
"""Steps between judgements."""


def loss_of(alpha: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """The absolute error keeps edges sharp where their place is unsure, the squared one is what avatars are harmed by."""
    return (alpha - truth).abs().mean() + ((alpha - truth) ** 2).mean()


@torch.no_grad()
def judge(network: EdgeNetwork, patches: torch.Tensor) -> float:
    """Squared error, as a share of that of the outline. patches: (N, 192, 192, 10) uint8."""
    ours = outlines = 0.0
    for some in patches.split(BATCH):
        x = some.permute(0, 3, 1, 2).float() / 255
        truth = x[:, PLANES:]
        ours += ((torch.sigmoid(network(x[:, :PLANES])) - truth) ** 2).sum().item()
        outlines += ((x[:, OUTLINE: OUTLINE + 1] - truth) ** 2).sum().item()
    return ours / outlines


def train(patches: torch.Tensor, judged: torch.Tensor, seconds: float) -> EdgeNetwork:
    """patches, judged: (N, 192, 192, 10) uint8, on the device that trains."""
    device = patches.device
    network = EdgeNetwork().to(device).to(memory_format=torch.channels_last)
    adam = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY, betas=(0.9, 0.99))
    start, step = time.monotonic(), 0
    while (spent := (time.monotonic() - start) / seconds) < 1:
        adam.param_groups[0]["lr"] = RATE * min(1, (step + 1) / WARM_UP) * (1 - spent) ** FALL
        with torch.no_grad():
            x = augment(patches[torch.randint(len(patches), (BATCH,), device=device)])
        with torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda"):
            logit = network(x[:, :PLANES].contiguous(memory_format=torch.channels_last)).float()
        adam.zero_grad(set_to_none=True)
        loss_of(torch.sigmoid(logit), x[:, PLANES:]).backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), MOST_GRADIENT)
        adam.step()
        step += 1
        if step % TELL == 0:
            share, after = judge(network, judged), time.monotonic() - start
            print(f"step {step}, {after:.0f} s: {share:.4f} of the outline's squared error", flush=True)
    return network


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("patches", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, default=210)
    arguments = parser.parse_args()
    torch.manual_seed(1)
    with ThreadPoolExecutor() as pool:
        parts = list(pool.map(np.load, arguments.patches))
    held = max(1, len(parts) // 16)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    judged, patches = (torch.from_numpy(np.concatenate(some)).to(device) for some in (parts[:held], parts[held:]))
    network = train(patches, judged, arguments.seconds)
    print(f"{judge(network, judged):.4f} of the outline's squared error")
    export(network, arguments.out)


if __name__ == "__main__":
    main()

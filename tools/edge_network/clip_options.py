"""Prints the options of one clip of the edge network's training set, drawn by its seed: clothes, hair, behaviour, noise, size.

    python -m gsac.turntable CLIPS/3000 $(python tools/edge_network/clip_options.py 3000)
"""

from __future__ import annotations

import random
import sys

BEHAVIOURS = ("left_pocket right_pocket pockets left_hip right_hip hips left_hair right_hair crossed left_phone right_phone "
              "talking").split()


def main(seed: int) -> None:
    draw = random.Random(f"edge {seed}")
    options = ["--seed", seed, "--frames", 24, "--no-vertices"]
    options += ["--noise", draw.choice([0.7, 1.5, 1.5, 2.5]), "--crf", draw.choice([16, 18, 18, 22, 26])]
    options += ["--clothing", round(draw.uniform(0.7, 1.6), 2), "--outside", round(draw.uniform(0.5, 1.4), 2)]
    if draw.random() < 0.25:
        options += ["--top", "hoodie"]
    if draw.random() < 0.2:
        options += ["--legs", "skirt"]
    if draw.random() < 0.35:
        options += ["--hair", "long"]
    if draw.random() < 0.25:
        options += ["--glasses"]
    if draw.random() < 0.2:
        options += ["--hat", draw.choice(["beanie", "cap"])]
    if draw.random() < 0.35:
        options += ["--behaviour", draw.choice(BEHAVIOURS)]
    elif draw.random() < 0.3:
        options += ["--hidden-hand", draw.choice("left_back right_back left_front right_front".split())]
    if draw.random() < 0.4:
        options += ["--feet", "planted"]
    options += ["--arm-swing", round(draw.uniform(0.5, 2.5), 2), "--sway", round(draw.uniform(0.5, 1.8), 2)]
    options += ["--height", draw.choice([960, 1280, 1280, 1280, 1920])]
    print(*options)


if __name__ == "__main__":
    main(int(sys.argv[1]))

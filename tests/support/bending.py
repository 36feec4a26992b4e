"""Poses an avatar's file with the viewer's modules under node, and with the Unity package's scripts under Mono."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.skinning import skin
from support import mono
from support.page_modules import copy_modules

JS = r"""
import fs from "node:fs";
import { readAvatar } from "./reader.js";
import { Pose, Skin } from "./skin.js";
const [file, numbers] = process.argv.slice(2);
const avatar = readAvatar(new Uint8Array(fs.readFileSync(file)).buffer), pose = new Pose(avatar), skin = new Skin(avatar);
const turns = JSON.parse(numbers);
turns.forEach(([x, y, z], joint) => pose.turn(joint, x, y, z));
skin.update(pose, {});
const vertices = Array.from(skin.vertices);
pose.reset();
skin.update(pose, {});
const rest = Array.from(skin.vertices);
console.log(JSON.stringify({ vertices, rest }));
"""
MIRROR = np.array([-1.0, 1, 1])
"""Unity's axes to ours."""


def pose_in_viewer(file: Path, pose: np.ndarray, folder: Path) -> dict[str, np.ndarray]:
    """`vertices` (V, 3) m posed, and `rest` (V, 3) m in the T-pose. pose: (55, 3) axis-angle; folder: empty."""
    if not shutil.which("node"):
        pytest.skip("needs node")
    script = copy_modules(folder) / "bend.js"
    script.write_text(JS)
    done = subprocess.run(["node", str(script), str(file), json.dumps(pose.tolist())], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return {name: np.array(values).reshape(-1, 3) for name, values in json.loads(done.stdout).items()}


def pose_in_unity(play: Callable, file: Path, pose: np.ndarray, folder: Path) -> np.ndarray:
    """(V, 3) m posed, in our axes: the buffers that a frame of the scripts hands to Gsac.compute, its arithmetic done here.

    play: runs a command of programs/Play.cs; pose: (55, 3) axis-angle.
    """
    avatar = RiggedAvatar.read(file)
    numbers = np.concatenate([pose.ravel(), np.zeros(3 + len(avatar.expression_names))])
    np.savetxt(folder / "numbers", numbers[None], "%.9g")
    play("frame", file, folder / "numbers", folder / "frame")
    asked = mono.arrays(folder / "frame")
    assert asked["skins_bent"].tolist() == [1]
    rest, pairs, turns = (asked[name].view(np.float32).reshape(-1, width)
                          for name, width in (("GsacRest", 4), ("GsacPairs", 28), ("GsacTurns", 12)))
    moves = np.einsum("cab,cb->ca", pairs[:, :27].reshape(-1, 3, 9), turns[pairs[:, 27].astype(int), :9])
    bent = rest[:, :3].astype(np.float64)
    np.add.at(bent, np.repeat(np.arange(len(bent)), np.diff(asked["GsacFirst"].view(np.int32))), moves)
    bones = asked["GsacBones"].view(np.float32).reshape(-1, 3, 4)
    posed = skin(bent.astype(np.float32), bones, avatar.skin_index, avatar.skin_weight)
    return (posed + [0, avatar.ground, 0]) * MIRROR

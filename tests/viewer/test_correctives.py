"""The viewer bends an avatar's surface as the Python body does; its modules run in node."""

import json
import shutil
import subprocess

import numpy as np
import pytest

from support.page_modules import copy_modules

JS = r"""
import fs from "node:fs";
import { packRest } from "./pack.js";
import { readAvatar } from "./reader.js";
import { Pose, Skin } from "./skin.js";
const [file, numbers] = process.argv.slice(2);
const avatar = readAvatar(new Uint8Array(fs.readFileSync(file)).buffer), pose = new Pose(avatar), skin = new Skin(avatar);
const turns = JSON.parse(numbers);
const turn = () => turns.forEach(([x, y, z], joint) => pose.turn(joint, x, y, z));
turn();
skin.update(pose, {});
const vertices = Array.from(skin.vertices);
pose.reset();
skin.update(pose, {});
const rest = Array.from(skin.vertices);
turn();
skin.bend(pose);
console.log(JSON.stringify({ vertices, rest, bent: Array.from(packRest(skin.rest)) }));
"""


def test_a_bent_elbow_lies_where_the_python_body_has_it(bent_arm, tmp_path):
    if not shutil.which("node"):
        pytest.skip("needs node")
    script = copy_modules(tmp_path) / "bend.js"
    script.write_text(JS)
    done = subprocess.run(["node", str(script), str(bent_arm.file), json.dumps(bent_arm.pose.tolist())], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    got = {name: np.array(values) for name, values in json.loads(done.stdout).items()}
    off = np.linalg.norm(got["vertices"].reshape(-1, 3) - bent_arm.vertices, axis=1)
    assert off.max() < 1e-4, "0.1 mm"
    assert np.linalg.norm(bent_arm.plain - bent_arm.vertices, axis=1).max() > 5e-3, "plain skinning is far off"
    np.testing.assert_array_equal(got["rest"].reshape(-1, 3), bent_arm.avatar.vertices, "the T-pose has none")
    moved = bent_arm.avatar.vertices + bent_arm.avatar.correctives.move_rest(bent_arm.pose)
    np.testing.assert_allclose(got["bent"].reshape(-1, 4), np.pad(moved, ((0, 0), (0, 1)), constant_values=1), atol=2e-5)

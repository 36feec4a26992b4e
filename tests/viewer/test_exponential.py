"""The page's own exponential is that of mathematics, in and beyond its table."""

import json
import shutil
import subprocess

import numpy as np
import pytest

from support.page_modules import copy_modules

SCRIPT = """
import { readFileSync } from "node:fs";
import { exponential } from "./exponential.js";
console.log(JSON.stringify(JSON.parse(readFileSync(0)).map(exponential)));
"""


@pytest.mark.skipif(not shutil.which("node"), reason="needs the Debian package nodejs")
def test_the_exponential_is_right_to_a_hundred_millionth_of_itself(tmp_path):
    rng = np.random.default_rng(0)
    x = np.r_[np.linspace(-40, 40, 4001), -32, np.nextafter(32, 0), 32, 0, -1e-300, rng.uniform(-12, 0, 4000), -700]
    (copy_modules(tmp_path) / "run.mjs").write_text(SCRIPT)
    done = subprocess.run(["node", "run.mjs"], cwd=tmp_path, input=json.dumps(x.tolist()).encode(), capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    np.testing.assert_allclose(json.loads(done.stdout), np.exp(x), rtol=2e-8)

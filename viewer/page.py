"""`viewer.html`: the viewer's scripts and the avatar in one page that needs no network."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path

from gsac.avatar.motion import names

HERE = Path(__file__).parent
PAGE, STYLE = "page.html", "style.css"
SCRIPTS = ("reader.js", "flat_quat.js", "skin.js", "binding.js", "sort.js", "webgl.js",
           "software.js", "shaders.js", "pack.js", "webgpu.js", "renderer.js", "camera.js",
           "quat.js", "motion.js", "match_names.js", "bvh.js", "gltf.js", "retarget.js",
           "motion_files.js", "rate.js", "viewer.js", "xr.js", "sliders.js", "ui.js")
"""Plain scripts, in the order in which they lean on each other. Whole names, so that the cache sees these files."""


def page_bytes(container: bytes) -> bytes:
    """container: the bytes of avatar.gsac. The same bytes give the same page."""
    packed = base64.b64encode(zlib.compress(container, 9)).decode()
    page = (HERE / PAGE).read_text()
    joint_names = json.dumps({"noise": names.NOISE, "sides": names.SIDES, "rules": names.RULES}, separators=(",", ":"))
    scripts = "\n".join([f"const JOINT_NAMES = {joint_names};", *(f"// {name}\n{(HERE / name).read_text()}" for name in SCRIPTS)])
    for mark, text in (("STYLE", (HERE / STYLE).read_text()), ("SCRIPTS", scripts), ("AVATAR", packed)):
        before, found, after = page.partition(f"<!--{mark}-->")
        if not found:
            raise ValueError(f"{PAGE} has no <!--{mark}-->")
        page = before + text + after
    return page.encode()

"""`viewer.html`: the viewer's modules and the avatar in one page that opens from disk without a network."""

from __future__ import annotations

import base64
import re
import zlib
from collections.abc import Iterable
from pathlib import Path

HERE = Path(__file__).parent
PAGE, STYLE = "page.html", "style.css"
MODULES = ("json.js", "base64.js", "container.js", "reader.js",
           "flat_quat.js", "projection.js", "skin.js", "binding.js", "sort.js", "scene_light.js",
           "levels.js", "pack.js", "webgl.js", "software.js", "shaders.js", "device.js", "webgpu.js", "renderer.js",
           "quat.js", "motion.js", "places.js", "joint_names.js", "match_names.js", "bvh.js", "gltf.js",
           "fbx_file.js", "fbx_curve.js", "fbx.js", "retarget.js", "motion_files.js",
           "address.js", "name.js", "camera.js", "rate.js", "viewer.js", "limb.js", "share.js", "xr.js", "sliders.js", "keys.js",
           "light_dial.js", "controls.js", "main.js")
"""Each after those that it imports; main.js runs the page. Whole names, so that the cache sees these files."""
_IMPORT = re.compile(r'^import \{ [\w, ]+ \} from "\./\w+\.js";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(async )?function |class |const )", re.MULTILINE)


def page_bytes(container: bytes) -> bytes:
    """viewer.html for an avatar. container: the bytes of avatar.gsac; the same bytes give the same page."""
    page = (HERE / PAGE).read_text()
    for mark, text in (("STYLE", (HERE / STYLE).read_text()), ("SCRIPT", join_modules(MODULES)),
                       ("AVATAR", base64.b64encode(zlib.compress(container, 9)).decode())):
        before, found, after = page.partition(f"<!--{mark}-->")
        if not found:
            raise ValueError(f"{PAGE} has no <!--{mark}-->")
        page = before + text + after
    return page.encode()


def join_modules(modules: Iterable[str]) -> str:
    """The text of one module made of several, given in an order in which each comes after those that it imports.

    All share one scope, in which their top-level names are unique: `import` lines and the word `export` are left out.
    """
    return "\n".join(f"// {name}\n{_EXPORT.sub('', _IMPORT.sub('', (HERE / name).read_text()))}" for name in modules)

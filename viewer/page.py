"""`viewer.html`: the viewer's modules and the avatar in one page that opens from disk without a network."""

from __future__ import annotations

import html
import json
import re
import zlib
from collections.abc import Iterable
from pathlib import Path

from gsac.viewer.arrays import pack_arrays
from gsac.viewer.letters import encode_letters

HERE = Path(__file__).parent
PAGE, STYLE = "page.html", "style.css"
LETTERS = "letters.js"
"""What unpacks the script, and stands before it."""
MODULES = ("json.js", "base64.js", LETTERS, "container.js", "reader.js",
           "exponential.js", "flat_quat.js", "projection.js", "skin.js", "binding.js", "sort.js", "scene_light.js",
           "levels.js", "pack.js", "webgl.js", "software.js", "shaders.js", "device.js", "webgpu.js", "renderer.js",
           "quat.js", "motion.js", "places.js", "joint_names.js", "match_names.js", "bvh.js", "gltf.js",
           "fbx_file.js", "fbx_curve.js", "fbx.js", "retarget.js", "motion_files.js",
           "address.js", "camera.js", "rate.js", "viewer.js", "limb.js", "share.js", "film.js", "keys.js",
           "mirror_pose.js", "mirror.js", "markup.js", "element.js", "kit.js", "name.js", "arrays.js", "messages.js", "xr.js",
           "sliders.js", "light_dial.js", "controls.js", "main.js")
"""Each after those that it imports; main.js runs the page. Whole names, so that the cache sees these files."""
_IMPORT = re.compile(r'^import \{ [\w, ]+ \} from "\./\w+\.js";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(async )?function |class |const )", re.MULTILINE)
_COMMENT = re.compile(r"^ *(?://.*|/\*\*(?:.|\n)*?\*/)\n", re.MULTILINE)


def page_bytes(container: bytes) -> bytes:
    """viewer.html for an avatar. container: the bytes of avatar.gsac; the same bytes give the same page."""
    page, (avatar, arrays) = (HERE / PAGE).read_text(), pack_arrays(container)
    script = zlib.compress(_bare(join_modules(MODULES)).encode(), 9)
    places = html.escape(json.dumps(arrays, separators=(",", ":")))
    for mark, text in (("STYLE", (HERE / STYLE).read_text()), ("ARRAYS", places), ("AVATAR", encode_letters(avatar)),
                       ("LETTERS", _bare(join_modules([LETTERS]))), ("SCRIPT", encode_letters(script))):
        before, found, after = page.partition(f"<!--{mark}-->")
        if not found:
            raise ValueError(f"{PAGE} has no <!--{mark}-->")
        page = before + text + after
    return page.encode()


def _bare(text: str) -> str:
    """A script without the comments that have lines of their own."""
    return _COMMENT.sub("", text)


def join_modules(modules: Iterable[str]) -> str:
    """The text of one module made of several, given in an order in which each comes after those that it imports.

    All share one scope, in which their top-level names are unique: `import` lines and the word `export` are left out.
    """
    return "\n".join(f"// {name}\n{_EXPORT.sub('', _IMPORT.sub('', (HERE / name).read_text()))}" for name in modules)

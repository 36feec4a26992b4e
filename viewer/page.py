"""`viewer.html`: the viewer's modules and the avatar in one page that opens from disk without a network."""

from __future__ import annotations

import base64
import json
import math
import re
import zlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from gsac.avatar.gsac_file.container import DTYPES, HEADER, GsacError, unpack

HERE = Path(__file__).parent
PAGE, STYLE = "page.html", "style.css"
MODULES = ("json.js", "base64.js", "container.js", "reader.js",
           "flat_quat.js", "projection.js", "skin.js", "binding.js", "sort.js", "scene_light.js",
           "levels.js", "pack.js", "webgl.js", "software.js", "shaders.js", "device.js", "webgpu.js", "renderer.js",
           "quat.js", "motion.js", "places.js", "joint_names.js", "match_names.js", "bvh.js", "gltf.js",
           "fbx_file.js", "fbx_curve.js", "fbx.js", "retarget.js", "motion_files.js",
           "address.js", "camera.js", "rate.js", "viewer.js", "limb.js", "share.js", "film.js", "keys.js",
           "mirror_pose.js", "mirror.js", "markup.js", "element.js", "kit.js", "name.js", "planes.js", "xr.js", "sliders.js",
           "light_dial.js", "controls.js", "main.js")
"""Each after those that it imports; main.js runs the page. Whole names, so that the cache sees these files."""
_IMPORT = re.compile(r'^import \{ [\w, ]+ \} from "\./\w+\.js";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(async )?function |class |const )", re.MULTILINE)


def page_bytes(container: bytes) -> bytes:
    """viewer.html for an avatar. container: the bytes of avatar.gsac; the same bytes give the same page."""
    page, arrays = (HERE / PAGE).read_text(), find_arrays(container)
    for mark, text in (("STYLE", (HERE / STYLE).read_text()), ("PLANES", json.dumps(arrays, separators=(",", ":"))),
                       ("SCRIPT", _packed(join_modules(MODULES).encode())), ("AVATAR", _packed(split_planes(container, arrays)))):
        before, found, after = page.partition(f"<!--{mark}-->")
        if not found:
            raise ValueError(f"{PAGE} has no <!--{mark}-->")
        page = before + text + after
    return page.encode()


def find_arrays(container: bytes) -> list[tuple[int, int, int, int]]:
    """Of each array in avatar.gsac: its first byte, its rows, its columns, and bytes a number; none where the file is broken."""
    try:
        head, _ = unpack(container)
    except GsacError:
        return []
    start, found = HEADER.size + HEADER.unpack_from(container)[2], []
    for entry in head["blocks"].values():
        rows, *columns = entry["shape"] or [1]
        found.append((start + entry["offset"], rows, math.prod(columns), np.dtype(DTYPES[entry["dtype"]]).itemsize))
    return found


def split_planes(data: bytes, arrays: Iterable[tuple[int, int, int, int]]) -> bytes:
    """The same bytes with each array's (as `find_arrays`) in planes: the first byte of all numbers, column after column, then the
    second. What is alike lies together then, and packs smaller; planes.js puts it back."""
    split = np.frombuffer(data, np.uint8).copy()
    for start, rows, columns, width in arrays:
        part = split[start:start + rows * columns * width]
        part[:] = part.reshape(rows, columns, width).transpose(2, 1, 0).ravel()
    return split.tobytes()


def _packed(data: bytes) -> str:
    """Compressed and in base64, as the page unpacks it."""
    return base64.b64encode(zlib.compress(data, 9)).decode()


def join_modules(modules: Iterable[str]) -> str:
    """The text of one module made of several, given in an order in which each comes after those that it imports.

    All share one scope, in which their top-level names are unique: `import` lines and the word `export` are left out.
    """
    return "\n".join(f"// {name}\n{_EXPORT.sub('', _IMPORT.sub('', (HERE / name).read_text()))}" for name in modules)

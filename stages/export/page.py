"""`viewer.html`: the viewer's scripts and the avatar in one page that needs no network."""

from __future__ import annotations

import base64
import zlib
from pathlib import Path

VIEWER = Path(__file__).parent / "viewer"
SCRIPTS = ("gsac.js", "math.js", "skin.js", "bind.js", "sort.js", "draw.js", "camera.js", "ui.js")
"""Plain scripts, in the order in which they lean on each other."""


def page_bytes(container: bytes) -> bytes:
    """container: the bytes of avatar.gsac. The same bytes give the same page."""
    packed = base64.b64encode(zlib.compress(container, 9)).decode()
    page = (VIEWER / "page.html").read_text()
    scripts = "\n".join(f"// {name}\n{(VIEWER / name).read_text()}" for name in SCRIPTS)
    for mark, text in (("STYLE", (VIEWER / "style.css").read_text()), ("SCRIPTS", scripts), ("AVATAR", packed)):
        before, found, after = page.partition(f"<!--{mark}-->")
        if not found:
            raise ValueError(f"viewer/page.html has no <!--{mark}-->")
        page = before + text + after
    return page.encode()

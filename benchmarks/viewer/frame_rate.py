"""Frame rate of a page in headless Chromium. Every frame is waited for, so that none is counted before it is drawn."""

from __future__ import annotations

import contextlib
import functools
import http.server
import os
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from gsac.avatar.frame_files import write_image
from gsac.benchmarks.viewer.browser import WEBGPU, Browser
from gsac.stages.contract import StageError

WARM_S = 2.0
"""Seconds before the measurement starts."""
UNCAPPED = ("--disable-frame-rate-limit", "--disable-gpu-vsync")
"""Flags that lift the limit of 60 frames a second."""
WATCH = """
(() => {
  if (window.drawn !== undefined) return;
  window.drawn = 0;
  document.body.classList.add("bare");
  const { gl, device } = gsac.renderer, pixel = new Uint8Array(4), draw = gsac.draw.bind(gsac);
  let waiting = false;
  gsac.draw = () => {
    if (waiting) return;
    draw();
    if (gl) gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    if (!device) window.drawn += 1;
    else {
      waiting = true;
      device.queue.onSubmittedWorkDone().then(() => { waiting = false; window.drawn += 1; });
    }
  };
})()
"""
"""Script that makes viewer.html count its frames and hide its controls; the other page has none and counts by itself."""


class _QuietHandler(http.server.SimpleHTTPRequestHandler):
    """Serves files without a log."""

    extensions_map = http.server.SimpleHTTPRequestHandler.extensions_map | {".mjs": "text/javascript"}

    def log_message(self, *words: object) -> None:
        pass


@contextlib.contextmanager
def serve(folder: Path) -> Iterator[str]:
    """Serves a folder's files on this machine; gives the address."""
    handler = functools.partial(_QuietHandler, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@dataclass
class FrameRate:
    """One measurement of a page."""

    fps: float
    cpu_s: float
    """CPU seconds a frame of all of the browser's processes; the machine's other load changes it little."""


def cpu_seconds(pid: int) -> float:
    """CPU seconds so far of a process and its running descendants."""
    parents, spent = {}, {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            words = stat.read_text().rpartition(")")[2].split()
            parents[int(stat.parent.name)], spent[int(stat.parent.name)] = int(words[1]), int(words[11]) + int(words[12])
    family = {pid}
    while more := {child for child, parent in parents.items() if parent in family} - family:
        family |= more
    return sum(spent.get(one, 0) for one in family) / os.sysconf("SC_CLK_TCK")


def measure(address: str, size: int, seconds: float, picture: Path | None) -> FrameRate:
    """Measures the page at an address, `size` px a side. picture: file for a screenshot. Raises StageError if the page fails."""
    page = Browser(size, size, UNCAPPED + (WEBGPU if "draw=webgpu" in address else ()))
    try:
        page.open(address)
        page.run(WATCH)
        time.sleep(WARM_S)
        began, worked, first = time.monotonic(), cpu_seconds(page.process.pid), page.run("window.drawn")
        time.sleep(seconds)
        frames, ended, done = page.run("window.drawn") - first, time.monotonic(), cpu_seconds(page.process.pid)
        if picture is not None:
            write_image(picture, page.picture()[:, :, ::-1])
        if page.errors:
            raise StageError(f"{address}: the page failed: {page.errors[0]}")
        return FrameRate(frames / (ended - began), (done - worked) / max(frames, 1))
    finally:
        page.close()

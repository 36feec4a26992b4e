"""Headless Chromium for benchmarks and tests, driven over its debugging pipe: no driver package, no port."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

FLAGS = ["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-extensions",
         "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run",
         "--remote-debugging-pipe", "--hide-scrollbars"]
WEBGPU = ("--enable-unsafe-webgpu", "--enable-features=Vulkan", "--use-vulkan=swiftshader")
"""Flags for WebGPU on a software device."""


def find_chromium() -> str | None:
    """Path of the program in Debian's package `chromium`, or None."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


class Browser:
    """One page. `errors`: its exceptions and logged errors and warnings; `requests`: every address that it asked for."""

    def __init__(self, width: int = 640, height: int = 640, flags: Sequence[str] = ()):
        self.home = tempfile.mkdtemp()
        to_browser, self.writing = os.pipe()
        self.reading, from_browser = os.pipe()

        def connect_pipes() -> None:
            """Puts the pipes at descriptors 3, from which the browser reads, and 4, to which it writes."""
            ours = [os.dup2(fd, 200 + i) for i, fd in enumerate((to_browser, from_browser))]
            for fd, place in zip(ours, (3, 4), strict=True):
                os.dup2(fd, place)

        self.process = subprocess.Popen([find_chromium(), *FLAGS, *flags, f"--user-data-dir={self.home}"], preexec_fn=connect_pipes,
                                        pass_fds=(3, 4), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        self.number, self.left, self.errors, self.requests, self.session = 0, b"", [], [], None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.resize(width, height)

    def resize(self, width: int, height: int, ratio: float = 1, mobile: bool = False) -> None:
        """width, height: CSS px; ratio: device px a CSS px."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=ratio,
                  mobile=mobile)

    def open(self, address: str) -> None:
        """Opens the page and waits until it is ready (`data-ready` of its root element)."""
        self.call("Page.navigate", url=address)
        self.until("document.documentElement?.dataset.ready === 'yes'")

    def has_webgpu(self) -> bool:
        """Whether the open page finds a WebGPU adapter."""
        return self.run("navigator.gpu?.requestAdapter().then(Boolean) ?? false")

    def until(self, condition: str, timeout: float = 120) -> None:
        """Waits for a JavaScript condition. Raises AssertionError if the page throws or after `timeout` seconds."""
        end = time.monotonic() + timeout
        while time.monotonic() < end and not self.errors:
            if self.run(condition):
                return
            time.sleep(0.1)
        raise AssertionError(f"not so: {condition}; errors of the page: {self.errors}")

    def run(self, script: str) -> Any:
        """Evaluates a JavaScript expression; a promise is awaited. Raises AssertionError if it throws."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise AssertionError(answer["exceptionDetails"])
        return answer["result"].get("value")

    def picture(self) -> np.ndarray:
        """Screenshot (H, W, 3) uint8 RGB of the page."""
        import cv2
        import numpy as np

        png = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Calls a method of the DevTools protocol and returns its result."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.writing, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._receive()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self._note(answer)

    def _receive(self) -> dict[str, Any]:
        """The next message of the browser."""
        while b"\0" not in self.left:
            part = os.read(self.reading, 1 << 20)
            if not part:
                raise RuntimeError("the browser ended")
            self.left += part
        message, self.left = self.left.split(b"\0", 1)
        return json.loads(message)

    def _note(self, event: dict[str, Any]) -> None:
        """Records errors and requests."""
        method, params = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            thrown = params["exceptionDetails"]
            self.errors.append(thrown.get("exception", {}).get("description", thrown["text"]))
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning", "assert"):
            self.errors.append(str([a.get("description", a.get("value")) for a in params["args"]]))
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.errors.append(params["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])

    def close(self) -> None:
        """Ends the browser and removes its profile."""
        self.process.terminate()
        self.process.wait(10)
        os.close(self.writing)
        os.close(self.reading)
        shutil.rmtree(self.home, ignore_errors=True)

"""Headless Chromium for benchmarks and tests, driven over its debugging pipe: no driver package, no port."""

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time

FLAGS = ["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-extensions",
         "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run",
         "--remote-debugging-pipe", "--hide-scrollbars"]


WEBGPU = ("--enable-unsafe-webgpu", "--enable-features=Vulkan", "--use-vulkan=swiftshader")
"""Flags with which WebGPU, too, is drawn by software, and shown."""


def find_chromium():
    """Path of the program that Debian's package `chromium` brings, or None."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


class Browser:
    """One page. `errors` collects what the page threw or logged as an error; `requests` every address it asked for."""

    def __init__(self, width=640, height=640, flags=()):
        self.home = tempfile.mkdtemp()
        to_browser, self.writing = os.pipe()
        self.reading, from_browser = os.pipe()

        def pipes():
            """The browser reads from descriptor 3 and writes to 4."""
            ours = [os.dup2(fd, 200 + i) for i, fd in enumerate((to_browser, from_browser))]
            for fd, place in zip(ours, (3, 4), strict=True):
                os.dup2(fd, place)

        self.process = subprocess.Popen([find_chromium(), *FLAGS, *flags, f"--user-data-dir={self.home}"], preexec_fn=pipes,
                                        pass_fds=(3, 4), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        self.number, self.left, self.errors, self.requests, self.session = 0, b"", [], [], None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.resize(width, height)

    def resize(self, width, height, ratio=1, mobile=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=ratio,
                  mobile=mobile)

    def open(self, address):
        """Opens the page and waits until it says that it is ready."""
        self.call("Page.navigate", url=address)
        self.until("document.documentElement?.dataset.ready === 'yes'")

    def has_webgpu(self):
        """Whether a page that is open finds an adapter."""
        return self.run("navigator.gpu?.requestAdapter().then(Boolean) ?? false")

    def until(self, condition, timeout=120):
        """Waits for a JavaScript condition; AssertionError when the page throws or time is up."""
        end = time.monotonic() + timeout
        while time.monotonic() < end and not self.errors:
            if self.run(condition):
                return
            time.sleep(0.1)
        raise AssertionError(f"not so: {condition}; errors of the page: {self.errors}")

    def run(self, script):
        """Value of a JavaScript expression; a promise is awaited."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise AssertionError(answer["exceptionDetails"])
        return answer["result"].get("value")

    def picture(self):
        """(H, W, 3) uint8 RGB of the page."""
        import cv2
        import numpy as np

        png = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]

    def call(self, method, **params):
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.writing, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.receive()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self.note(answer)

    def receive(self):
        while b"\0" not in self.left:
            part = os.read(self.reading, 1 << 20)
            if not part:
                raise RuntimeError("the browser ended")
            self.left += part
        message, self.left = self.left.split(b"\0", 1)
        return json.loads(message)

    def note(self, event):
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

    def close(self):
        self.process.terminate()
        self.process.wait(10)
        os.close(self.writing)
        os.close(self.reading)
        shutil.rmtree(self.home, ignore_errors=True)

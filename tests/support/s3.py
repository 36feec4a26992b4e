"""A server in this process that speaks as much of S3 as a shared store needs, and misbehaves on request.

Written here and not taken from moto (60 packages, 290 MB): it starts at once, and cuts, spoils and delays single answers.
Signatures are not checked.
"""

from __future__ import annotations

import contextlib
import hashlib
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from email.utils import formatdate
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, unquote, urlsplit
from xml.sax.saxutils import escape

SECRET = "wJalrXUtnFEMI-K7MDENG-EXAMPLESECRET"
PAGE = 3
"""Names in one answer to a list: few, so that tests see several pages."""


@dataclass
class Bucket:
    """What one server holds, and how it behaves."""

    url: str = ""
    objects: dict[str, tuple[bytes, float]] = field(default_factory=dict)
    """Name with prefix -> content and time of the last writing, s since 1970, by the server's clock."""
    asked: list[tuple[str, str]] = field(default_factory=list)
    """Method and name of each request."""
    trouble: Callable[[str, str], str | None] = lambda method, name: None
    """What goes wrong with a request, if anything: `500`, `403`, `cut`, `spoil`, `lost`, `slow`."""
    clock_apart_s: float = 0.0
    slow_s: float = 30.0
    serving: int = 0
    """Requests that are not answered yet."""
    lock: threading.Lock = field(default_factory=threading.Lock)
    stopping: threading.Event = field(default_factory=threading.Event)

    @property
    def env(self) -> dict[str, str]:
        """Environment of a client."""
        return {"GSAC_REMOTE": "s3://bucket/prefix", "AWS_ENDPOINT_URL": self.url, "AWS_ACCESS_KEY_ID": "AKIAEXAMPLE",
                "AWS_SECRET_ACCESS_KEY": SECRET, "AWS_REGION": "us-east-1"}

    def names(self, table: str) -> list[str]:
        """Names below one table, such as `actions`, without the prefix."""
        with self.lock:
            return sorted(name.removeprefix("prefix/") for name in self.objects if name.startswith(f"prefix/{table}/"))

    def settle(self) -> None:
        """Waits until all requests are answered, those of clients that were killed, too."""
        while self.serving:
            time.sleep(0.01)

    def age(self, seconds: float) -> None:
        """Makes all that is there older."""
        with self.lock:
            self.objects = {name: (data, at - seconds) for name, (data, at) in self.objects.items()}


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    wbufsize = 1 << 16  # an answer goes out at once, not its head first
    bucket: Bucket

    def log_message(self, format: str, *args: object) -> None:
        pass

    def do_GET(self) -> None:
        self._serve("GET")

    def do_HEAD(self) -> None:
        self._serve("HEAD")

    def do_PUT(self) -> None:
        self._serve("PUT")

    def do_DELETE(self) -> None:
        self._serve("DELETE")

    def do_POST(self) -> None:
        self._serve("POST")

    def _serve(self, method: str) -> None:
        with self.bucket.lock:
            self.bucket.serving += 1
        try:
            self._serve_one(method)
        finally:
            with self.bucket.lock:
                self.bucket.serving -= 1

    def _serve_one(self, method: str) -> None:
        parts = urlsplit(self.path)
        name = unquote(parts.path).removeprefix("/bucket").removeprefix("/")
        query = {key: values[0] for key, values in parse_qs(parts.query, keep_blank_values=True).items()}
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        trouble = self.bucket.trouble(method, name)
        with self.bucket.lock:
            self.bucket.asked.append((method, name))
        if trouble == "slow":
            self.bucket.stopping.wait(self.bucket.slow_s)
        if trouble == "cut" and method == "PUT":
            self.close_connection = True
            return
        if trouble in ("500", "403"):
            self._answer(int(trouble), f"<Error><Code>Trouble</Code><Secret>{SECRET}</Secret></Error>".encode())
            return
        if method == "PUT":
            self._put(name, body, trouble == "lost")
        elif method == "DELETE":
            with self.bucket.lock:
                self.bucket.objects.pop(name, None)
            self._answer(204)
        elif method == "POST" and "delete" in query:
            self._delete(body.decode())
        elif "list-type" in query:
            self._list(query)
        else:
            self._get(name, trouble)

    def _put(self, name: str, body: bytes, lost: bool) -> None:
        with self.bucket.lock:
            there = self.bucket.objects.get(name)
            match = self.headers.get("If-Match")
            refused = (there is not None and self.headers.get("If-None-Match") == "*") or (
                match is not None and (there is None or match != _etag(there)))
            if not refused:
                self.bucket.objects[name] = (body, time.time() + self.bucket.clock_apart_s)
                there = self.bucket.objects[name]
        if lost:  # done, and the client does not learn it
            self.close_connection = True
        elif refused:
            self._answer(412, b"<Error><Code>PreconditionFailed</Code></Error>")
        else:
            self._answer(200, headers={"ETag": _etag(there)})

    def _get(self, name: str, trouble: str | None) -> None:
        with self.bucket.lock:
            there = self.bucket.objects.get(name)
        if there is None:
            self._answer(404, b"<Error><Code>NoSuchKey</Code></Error>")
            return
        body = bytes([there[0][0] ^ 1]) + there[0][1:] if trouble == "spoil" else there[0]
        headers = {"ETag": _etag(there), "Last-Modified": formatdate(there[1], usegmt=True)}
        start = self.headers.get("Range", "").removeprefix("bytes=").partition("-")[0]
        if start:
            headers["Content-Range"] = f"bytes {start}-{len(body) - 1}/{len(body)}"
            body = body[int(start):]
        self._answer(206 if start else 200, body, headers, cut=trouble == "cut")

    def _delete(self, text: str) -> None:
        names = [part.partition("</Key>")[0] for part in text.split("<Key>")[1:]]
        with self.bucket.lock:
            for name in names:
                self.bucket.objects.pop(name, None)
        gone = "".join(f"<Deleted><Key>{escape(name)}</Key></Deleted>" for name in names)
        self._answer(200, f"<DeleteResult>{gone}</DeleteResult>".encode())

    def _list(self, query: dict[str, str]) -> None:
        after = query.get("continuation-token") or query.get("start-after") or ""
        with self.bucket.lock:
            found = sorted((name, there) for name, there in self.bucket.objects.items()
                           if name.startswith(query.get("prefix", "")) and name > after)
        page = found[:PAGE]
        more = f"<NextContinuationToken>{escape(page[-1][0])}</NextContinuationToken>" if len(found) > PAGE else ""
        rows = "".join(
            f"<Contents><Key>{escape(name)}</Key><LastModified>{_iso(there[1])}</LastModified><ETag>{escape(_etag(there))}</ETag>"
            f"<Size>{len(there[0])}</Size></Contents>" for name, there in page)
        self._answer(200, f"<ListBucketResult><IsTruncated>{'true' if more else 'false'}</IsTruncated>{more}{rows}"
                          "</ListBucketResult>".encode())

    def _answer(self, status: int, body: bytes = b"", headers: dict[str, str] | None = None, cut: bool = False) -> None:
        self.send_response(status)
        for name, value in (headers or {}).items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            with contextlib.suppress(OSError):
                self.wfile.write(body[: len(body) // 2] if cut else body)
        if cut:
            self.close_connection = True


def _etag(there: tuple[bytes, float]) -> str:
    return f'"{hashlib.sha256(there[0] + repr(there[1]).encode()).hexdigest()[:32]}"'


def _iso(at: float) -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%S.000Z", time.gmtime(at))


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 64

    def handle_error(self, request: object, client_address: object) -> None:
        """A client that hangs up is no news here."""


@contextlib.contextmanager
def serving() -> Iterator[Bucket]:
    """A server with an empty bucket, ended with the context."""
    bucket = Bucket()
    server = _Server(("127.0.0.1", 0), type("Handler", (_Handler,), {"bucket": bucket}))
    bucket.url = f"http://127.0.0.1:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield bucket
    finally:
        bucket.stopping.set()
        server.shutdown()
        server.server_close()
        thread.join()

"""Serves one avatar's page and files, and nothing else, to this machine or, at an address nobody can guess, to its network."""

from __future__ import annotations

import contextlib
import http.server
import os
import secrets
import shutil
import socket
import ssl
import subprocess
import time
from http import HTTPStatus
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote, unquote_to_bytes, urlsplit

from gsac.stages.contract import BadInput

PAGE = "viewer.html"
FILES = {PAGE: ("text/html; charset=utf-8", b"<!doctype html>"), "avatar.gsac": ("application/octet-stream", b"GSAC\r\n"),
         "avatar.glb": ("model/gltf-binary", b"glTF"), "avatar.fbx": ("application/octet-stream", b"Kaydara FBX"),
         "avatar.ply": ("application/octet-stream", b"ply\n"), "avatar.spz": ("application/octet-stream", b"\x1f\x8b")}
"""What is served of the page's folder, by its name alone -> media type, and how it begins: a link to some other file of this
machine, which a folder from elsewhere may hold, is none."""
PORTS = {"http": 80, "https": 443}
"""Browsers leave these out of the Host header."""
MOST_SILENT = 64
"""Clients that have not asked yet; with one more, the oldest is hung up on."""
PATIENCE_S = 30
"""For a client to ask, and for each part of the answer that it takes."""
HERE = "127.0.0.1"
NOWHERE = "192.0.2.1"
"""An address of no machine (RFC 5737): the way towards it tells this machine's own address, and nothing is sent."""
CERTIFICATE_DAYS = 2


class PageServer(http.server.ThreadingHTTPServer):
    """Serves the folder of one page under /TOKEN/NAME/, where TOKEN may be left out."""

    request_queue_size = 128
    """Connections that wait to be taken: with the 5 of Python's default a burst of them delays the next by seconds."""

    def __init__(self, page: Path, name: str, bound: tuple[str, int], host: str, token: str, certificate: Path | None) -> None:
        self.page, self.name, self.host, self.token = page, name, host, token
        self.scheme = "http" if certificate is None else "https"
        self.silent: dict[socket.socket, float] = {}
        super().__init__(bound, Handler)
        if certificate is not None:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(certificate)
            # The handshake is left to the thread of the request: a client that never speaks holds up nobody.
            self.socket = context.wrap_socket(self.socket, server_side=True, do_handshake_on_connect=False)

    @property
    def prefix(self) -> str:
        """The path below which the files are."""
        return "/".join(["", *([self.token] if self.token else []), quote(os.fsencode(self.name), safe=""), ""])

    @property
    def url(self) -> str:
        """Of the page."""
        return f"{self.scheme}://{self.host}:{self.server_address[1]}{self.prefix}{PAGE}"

    @property
    def hosts(self) -> set[str]:
        """Host headers that name this server: another is a foreign page that had its name point here."""
        port = self.server_address[1]
        names = (self.host, HERE, "localhost")
        return {f"{name}:{port}" for name in names} | (set(names) if port == PORTS[self.scheme] else set())

    def open_file(self, path: str) -> BinaryIO | None:
        """The file that a request's path means, at its beginning, or None."""
        folder, _, name = path.rpartition("/")
        if not secrets.compare_digest(unquote_to_bytes(folder + "/"), unquote_to_bytes(self.prefix)) or name not in FILES:
            return None
        file = self.page.parent / name
        beginning = FILES[name][1]
        try:
            opened = file.open("rb") if file.is_file() else None
        except OSError:
            return None
        if opened is not None and opened.read(len(beginning)) == beginning:
            opened.seek(0)
            return opened
        return None

    def get_request(self) -> tuple[socket.socket, Any]:
        """Takes a connection. Those that never ask cannot keep others out."""
        connection, address = super().get_request()
        self.silent[connection] = time.monotonic()
        for oldest in list(self.silent)[:-MOST_SILENT]:
            self.hang_up(oldest)
        return connection, address

    def service_actions(self) -> None:
        """Hangs up on who has not asked in time, however busy with half a request."""
        for connection, since in list(self.silent.items()):
            if time.monotonic() - since > PATIENCE_S:
                self.hang_up(connection)

    def hang_up(self, connection: socket.socket) -> None:
        """Ends what the connection's thread waits for."""
        self.silent.pop(connection, None)
        with contextlib.suppress(OSError):
            socket.socket.shutdown(connection, socket.SHUT_RDWR)

    def shutdown_request(self, request: Any) -> None:
        self.silent.pop(request, None)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that goes away, or refuses the certificate, is nothing to tell the user."""


class Handler(http.server.BaseHTTPRequestHandler):
    """Answers with a file of the server's page, or with why not."""

    server: PageServer
    timeout = PATIENCE_S

    def do_GET(self) -> None:
        self.answer()

    def do_HEAD(self) -> None:
        self.answer()

    def answer(self) -> None:
        """Sends the file, without its content for HEAD."""
        self.server.silent.pop(self.connection, None)
        if {*self.headers.get_all("Host", [""])} - self.server.hosts:
            return self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
        try:
            path = urlsplit(self.path).path
        except ValueError:
            return self.send_error(HTTPStatus.BAD_REQUEST)
        if path == "/" and not self.server.token:
            return self.redirect()
        file = self.server.open_file(path)
        if file is None:
            return self.send_error(HTTPStatus.NOT_FOUND)
        with file:
            self.send_response(HTTPStatus.OK)
            for name, value in (("Content-Type", FILES[path.rpartition("/")[2]][0]),
                                ("Content-Length", str(os.fstat(file.fileno()).st_size)), ("Cache-Control", "no-store"),
                                ("X-Content-Type-Options", "nosniff"), ("Referrer-Policy", "no-referrer")):
                self.send_header(name, value)
            self.end_headers()
            if self.command == "GET":
                shutil.copyfileobj(file, self.wfile)
        return None

    def redirect(self) -> None:
        """From the bare address to the page."""
        self.send_response(HTTPStatus.FOUND)
        self.send_header("Location", f"{self.server.prefix}{PAGE}")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *words: object) -> None:
        pass


def serve(page: Path, port: int, name: str = "avatar", host: str | None = None, certificate: Path | None = None) -> PageServer:
    """A server of the page under a name: to this machine alone, or with host, its address in the network, to that too."""
    try:
        if host is None:
            return PageServer(page, name, (HERE, port), HERE, "", None)
        return PageServer(page, name, (host, port), host, secrets.token_urlsafe(12), certificate)
    except (OSError, OverflowError) as e:
        raise BadInput(f"--port {port}: cannot be opened ({e}); choose another or leave it out") from e


def find_network_address() -> str | None:
    """This machine's address in its network, or None where it is in none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((NOWHERE, 9))
            found = probe.getsockname()[0]
        except OSError:
            return None
    return None if found.startswith("127.") or found == "0.0.0.0" else found


def make_certificate(folder: Path, host: str) -> Path | None:
    """A key and a self-signed certificate for the address `host`, as one file in the folder; None without openssl."""
    openssl = shutil.which("openssl")
    if openssl is None:
        return None
    key, certificate, both = folder / "key.pem", folder / "certificate.pem", folder / "server.pem"
    made = subprocess.run(
        [openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-keyout", str(key),
         "-out", str(certificate), "-days", str(CERTIFICATE_DAYS), "-subj", "/CN=gsac view",
         "-addext", f"subjectAltName=IP:{host}"],
        capture_output=True, check=False)
    if made.returncode:
        return None
    both.touch(0o600)
    both.write_bytes(key.read_bytes() + certificate.read_bytes())
    return both

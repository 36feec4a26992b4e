"""A person by an address in Unity: https and files, a largest size, a digest."""

import hashlib
import shutil
import ssl
import subprocess
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def server(files, tmp_path_factory):
    """The address of a server with the test's own certificate."""
    if not shutil.which("openssl"):
        pytest.skip("needs the Debian package openssl")
    folder = tmp_path_factory.mktemp("server")
    subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj", "/CN=localhost",
                    "-keyout", folder / "key.pem", "-out", folder / "cert.pem"], check=True, capture_output=True)
    person = (files / "figure.gsac").read_bytes()

    class Answers(BaseHTTPRequestHandler):
        def do_GET(self):
            turn = {"/round": "/round", "/plain": "http://localhost/person.gsac", "/turned": "/person.gsac",
                    "/local": "file:///etc/hostname"}.get(self.path)
            if turn:
                self.send_response(302)
                self.send_header("Location", turn)
                self.end_headers()
                return
            self.send_response(404 if self.path == "/none.gsac" else 200)
            if self.path not in ("/endless", "/slow"):
                self.send_header("Content-Length", str(len(person)))
            self.end_headers()
            try:
                for _ in range(20 if self.path == "/slow" else 0):
                    self.wfile.write(b"x")
                    self.wfile.flush()
                    time.sleep(.2)
                self.wfile.write(person[:100] if self.path == "/cut.gsac" else person)
            except OSError:
                pass  # the reader had enough

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("localhost", 0), Answers)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(folder / "cert.pem", folder / "key.pem")
    server.socket = context.wrap_socket(server.socket, server_side=True)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"https://localhost:{server.server_address[1]}"
    server.shutdown()


def test_an_address_gives_the_bytes_that_were_promised_or_says_what_is_wrong(play, server, files, tmp_path):
    content = (files / "figure.gsac").read_bytes()
    digest, size = hashlib.sha256(content).hexdigest(), len(content)
    most = size + 10
    asked = [(f"{server}/person.gsac", digest, most), (f"{server}/turned", digest.upper(), most),
             ((files / "figure.gsac").as_uri(), digest, most), (f"{server}/person.gsac", "0" * 64, most),
             (f"{server}/person.gsac", "-", size - 1), (f"{server}/endless", "-", size - 1), (f"{server}/cut.gsac", "-", most),
             (f"{server}/none.gsac", "-", most), (f"{server}/round", "-", most), (f"{server}/plain", "-", most),
             (f"{server}/local", "-", most), ("http://localhost/a.gsac", "-", most), ("a.gsac", "-", most),
             ((tmp_path / "none.gsac").as_uri(), "-", most), (f"{server}/person.gsac", "abc", most)]
    lines = play("addresses", *(word for one in asked for word in one)).splitlines()
    assert lines[:3] == [f"read {size}"] * 3
    wanted = [("IOException", f"their SHA-256 is {digest} and not 000"), ("IOException", f"more than the {size - 1} bytes"),
              ("IOException", f"more than the {size - 1} bytes"), ("IOException", ""), ("IOException", "404"),
              ("IOException", "without end"), ("IOException", "is not https"), ("IOException", "is not https"),
              ("ArgumentException", "https:// or file://"), ("ArgumentException", "https:// or file://"),
              ("FileNotFoundException", "none.gsac"), ("ArgumentException", "64 hexadecimal digits")]
    for line, (kind, words), (address, *_) in zip(lines[3:], wanted, asked[3:], strict=False):
        assert line.startswith(kind) and words in line, (line, address)
        assert kind != "IOException" or line.startswith(f"IOException {address}: "), "names the address"
    assert lines[15:] == ["stopped", "person True"]

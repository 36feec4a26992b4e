import contextlib
import http.client
import os
import select
import socket
import ssl
import threading
import urllib.error
import urllib.request

import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.pipeline import page_server
from gsac.pipeline.cli import execute
from gsac.pipeline.commands import view
from gsac.pipeline.commands.demo import make_truth_clip
from gsac.pipeline.commands.view import find_name, find_page
from gsac.pipeline.journal import plain_journal
from gsac.pipeline.page_server import make_certificate, serve
from gsac.stages.contract import BadInput
from gsac.stages.export.fbx import avatar_fbx
from gsac.stages.export.glb import glb_bytes
from gsac.stages.export.ply import ply_bytes
from gsac.stages.export.spz import spz_bytes
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import paint_surface
from gsac.turntable import clip as turntable
from gsac.viewer.page import page_bytes
from support.figure import make_figure

CONTENT = b"<!doctype html><h1>avatar</h1>"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "abc.html").write_bytes(CONTENT)
    export = tmp_path / "run" / "export"
    export.mkdir(parents=True)
    (export / "viewer.html").symlink_to(tmp_path / "store" / "abc.html")
    (tmp_path / "run" / "secret.txt").write_text("secret")
    return tmp_path / "run"


def test_the_viewer_page_is_served_through_its_link_on_this_machine_only(folder):
    with serve(find_page(folder, folder), 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        assert server.url.startswith("http://127.0.0.1:") and server.server_address[0] == "127.0.0.1"
        assert urllib.request.urlopen(server.url).read() == CONTENT
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(server.url.replace("viewer.html", "../secret.txt"))
        server.shutdown()


def test_the_page_is_found_from_the_run_from_its_export_and_from_a_file_beside_it(folder):
    page = folder / "export" / "viewer.html"
    for path in (folder, folder / "export", folder / "export" / "avatar.gsac"):
        assert find_page(path, folder) == page
    with pytest.raises(BadInput, match="gone"):
        find_page(folder / "gone" / "avatar.gsac", folder)


def test_an_avatar_file_that_lies_alone_gets_a_page_and_a_damaged_one_is_named(tmp_path):
    whole = avatar_bytes(make_figure())
    (tmp_path / "me.gsac").write_bytes(whole)
    (tmp_path / "spare").mkdir()
    page = find_page(tmp_path / "me.gsac", tmp_path / "spare")
    assert page.parent == tmp_path / "spare" and page.read_bytes() == page_bytes(whole)
    (tmp_path / "me.gsac").write_bytes(whole[:500])
    with pytest.raises(BadInput, match=r"me\.gsac.*truncated"):
        find_page(tmp_path / "me.gsac", tmp_path)


@contextlib.contextmanager
def running(page, name="me", **options):
    with serve(page, 0, name, **options) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


def ask(server, path, host=None, context=None):
    """Status and content of one request; host: the Host header."""
    address = (server.host, server.server_address[1])
    connection = http.client.HTTPSConnection(*address, context=context) if context else http.client.HTTPConnection(*address)
    connection.request("GET", path, headers={"Host": host or "{}:{}".format(*address)})
    answer = connection.getresponse()
    return answer.status, answer.read()


def test_nothing_but_the_page_and_the_avatars_files_is_served(folder):
    export = folder / "export"
    (export / "avatar.glb").write_bytes(b"glTF")
    (export / ".store").write_text("hidden")
    (export / "notes.txt").write_text("mine")
    with running(export / "viewer.html") as server:
        assert server.url.endswith("/me/viewer.html")
        assert ask(server, "/me/viewer.html") == (200, CONTENT)
        assert ask(server, "/me/avatar.glb") == (200, b"glTF")
        assert ask(server, "/")[0] == 302
        for path in ("/me/", "/me", "/me/.store", "/me/notes.txt", "/me/../secret.txt", "/me/%2e%2e/secret.txt", "//etc/passwd",
                     "/other/viewer.html", "/me/avatar.ply"):
            assert ask(server, path)[0] == 404, path


def say(server, request):
    """The first line of the answer to the bytes of a request; nothing where there is none."""
    with socket.create_connection(server.server_address, timeout=10) as connection:
        connection.sendall(request)
        with connection.makefile("rb") as answer:
            return answer.readline()


def test_an_odd_request_is_answered_and_never_by_a_file(folder):
    with running(folder / "export" / "viewer.html") as server:
        host = b"Host: 127.0.0.1:%d\r\n" % server.server_address[1]
        paths = (b"/%00", b"/me/%00", b"/me/viewer.html%00", b"//[", b"http://[/me/viewer.html", b"/%ff/viewer.html", b"*", b"?",
                 b"/\xff/viewer.html", b"/me/..%2fviewer.html", b"/me//viewer.html", b"/" + b"%2e" * 9000, b"/me/" + b"a" * 70_000)
        for path in paths:
            assert say(server, b"GET " + path + b" HTTP/1.1\r\n" + host + b"\r\n")[:10] == b"HTTP/1.0 4", path[:40]
        for head in (b"X: y\r\n" * 200, b"X: " + b"y" * 70_000 + b"\r\n", b""):
            assert say(server, b"GET /me/viewer.html HTTP/1.1\r\n" + head + b"\r\n")[:10] == b"HTTP/1.0 4", head[:10]
        assert say(server, b"GET /me/viewer.html HTTP/1.1\r\n" + host + b"\r\n")[:12] == b"HTTP/1.0 200"


def test_every_file_that_export_writes_is_served(folder):
    figure, export = make_figure(), folder / "export"
    gaussians = pose_gaussians(figure, figure.pose("T"))
    surface = paint_surface(figure, *gaussians)
    splats = (*gaussians, figure.gaussians.rgb, figure.gaussians.opacity)
    written = {"viewer.html": page_bytes(avatar_bytes(figure)), "avatar.gsac": avatar_bytes(figure),
               "avatar.glb": glb_bytes(figure, surface, *gaussians), "avatar.fbx": avatar_fbx(figure, surface),
               "avatar.ply": ply_bytes(*splats), "avatar.spz": spz_bytes(*splats)}
    assert written.keys() == page_server.FILES.keys()
    (export / "viewer.html").unlink()
    for name, content in written.items():
        (export / name).write_bytes(content)
    with running(export / "viewer.html") as server:
        for name, content in written.items():
            assert ask(server, f"/me/{name}") == (200, content)


def test_a_link_to_another_file_of_this_machine_is_not_served(folder):
    export = folder / "export"
    for name in ("avatar.gsac", "avatar.glb", "avatar.fbx", "avatar.ply", "avatar.spz"):
        (export / name).symlink_to(folder / "secret.txt")
    with running(export / "viewer.html") as server:
        assert [ask(server, f"/me/{name}")[0] for name in page_server.FILES] == [200, 404, 404, 404, 404, 404]


def test_clients_that_never_ask_keep_nobody_out_and_are_hung_up_on(folder, monkeypatch):
    monkeypatch.setattr(page_server, "MOST_SILENT", 3)
    monkeypatch.setattr(page_server, "PATIENCE_S", 1)
    with running(folder / "export" / "viewer.html") as server, contextlib.ExitStack() as open_ones:
        silent = [open_ones.enter_context(socket.create_connection(server.server_address, timeout=10)) for _ in range(4)]
        assert silent[0].recv(1) == b"", "the oldest goes when there are too many"
        assert ask(server, "/me/viewer.html") == (200, CONTENT)
        for _ in range(100):
            if select.select([silent[3]], [], [], 0.05)[0]:
                break
            silent[3].sendall(b"G")
        else:
            pytest.fail("a client that drips a byte at a time is never hung up on")


def test_a_foreign_name_that_points_at_this_machine_is_refused(folder, monkeypatch):
    with running(folder / "export" / "viewer.html") as server:
        port = server.server_address[1]
        assert ask(server, "/me/viewer.html", f"localhost:{port}")[0] == 200
        for host in ("evil.example", f"evil.example:{port}", "127.0.0.1", ""):
            assert ask(server, "/me/viewer.html", host or " ")[0] == 421
        twice = f"GET /me/viewer.html HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nHost: evil.example\r\n\r\n"
        assert say(server, twice.encode())[:12] == b"HTTP/1.0 421"
        monkeypatch.setitem(page_server.PORTS, "http", port)
        assert ask(server, "/me/viewer.html", "localhost")[0] == 200, "browsers leave out the port that is usual"


def test_for_the_network_the_page_is_served_by_https_at_an_address_nobody_can_guess(folder, tmp_path):
    certificate = make_certificate(tmp_path, "127.0.0.1")
    if certificate is None:
        pytest.skip("no openssl here")
    assert certificate.stat().st_mode & 0o077 == 0, "the key is the user's alone"
    context = ssl.create_default_context(cafile=certificate)
    with running(folder / "export" / "viewer.html", host="127.0.0.1", certificate=certificate) as server:
        assert server.url.startswith("https://127.0.0.1:") and len(server.token) >= 16
        assert ask(server, f"/{server.token}/me/viewer.html", context=context) == (200, CONTENT)
        assert [ask(server, path, context=context)[0] for path in ("/", "/me/viewer.html", "/x/me/viewer.html")] == [404] * 3


def view_once(monkeypatch, capsys, *words):
    """What `gsac view` says, and the addresses that it opens, where the user ends it at once."""
    opened = []
    monkeypatch.setattr(view, "has_screen", lambda: True)
    monkeypatch.setattr(view.webbrowser, "open", opened.append)
    monkeypatch.setattr(view.PageServer, "serve_forever", lambda _: (_ for _ in ()).throw(KeyboardInterrupt))
    assert execute(["view", *map(str, words)]) == 0
    said = capsys.readouterr()
    return said.out.strip(), said.err, opened


def test_view_opens_the_browser_unless_told_and_says_how_to_end_it(folder, monkeypatch, capsys):
    url, said, opened = view_once(monkeypatch, capsys, folder)
    assert opened == [url] and url.startswith("http://127.0.0.1:") and url.endswith("/run/viewer.html")
    assert "Ctrl-C ends it" in said
    assert view_once(monkeypatch, capsys, folder, "--no-browser")[2] == []


def test_with_host_a_code_for_the_phone_is_drawn_and_what_is_exposed_is_said(folder, monkeypatch, capsys):
    monkeypatch.setattr(view, "find_network_address", lambda: "127.0.0.1")
    url, said, opened = view_once(monkeypatch, capsys, folder, "--host")
    assert opened == [] and url.startswith("https://127.0.0.1:")
    assert "\N{FULL BLOCK}" in said or "\N{LOWER HALF BLOCK}" in said
    assert "Whoever is in this network" in said and "nothing else of this machine" in said
    monkeypatch.setattr(view, "make_certificate", lambda *_: None)
    assert "VR and AR need https" in view_once(monkeypatch, capsys, folder, "--host")[1]
    monkeypatch.setattr(view, "find_network_address", lambda: None)
    assert execute(["view", str(folder), "--host"]) == 2 and "no address in a network" in capsys.readouterr().err


def test_a_path_without_an_avatar_is_told_what_is_wrong_with_it(folder, tmp_path):
    (folder / "export" / "viewer.html").unlink()
    (tmp_path / "notes.txt").write_text("x")
    for path, why in ((tmp_path / "nope", "nope: no such file or folder"), (tmp_path / "notes.txt", "it is no .gsac file"),
                      (folder, "no viewer.html and no avatar.gsac here")):
        with pytest.raises(BadInput, match=why):
            find_page(path, tmp_path)


def test_a_folder_with_nothing_but_an_avatar_file_gets_a_page(tmp_path):
    (tmp_path / "lone").mkdir()
    (tmp_path / "lone" / "avatar.gsac").write_bytes(avatar_bytes(make_figure()))
    assert find_page(tmp_path / "lone", tmp_path) == tmp_path / "viewer.html"


@pytest.mark.parametrize(("path", "name"), [("squats-avatar", "squats"), ("squats-avatar/export", "squats"), ("me.gsac", "me"),
                                            ("squats-avatar/export/avatar.gsac", "squats"), ("-avatar", "avatar"),
                                            ("squats-avatar/export/..", "squats"), ("..gsac", "avatar")])
def test_the_page_is_served_under_the_avatars_name(tmp_path, path, name):
    (tmp_path / "squats-avatar" / "export").mkdir(parents=True)
    (tmp_path / "-avatar").mkdir()
    for file in ("me.gsac", "..gsac", "squats-avatar/export/avatar.gsac"):
        (tmp_path / file).write_bytes(b"")
    assert find_name(tmp_path / path) == name


def test_a_name_in_another_encoding_is_served(folder):
    with running(folder / "export" / "viewer.html", name=os.fsdecode(b"bad\xff")) as server:
        assert server.prefix == "/bad%FF/" and ask(server, "/bad%ff/viewer.html") == (200, CONTENT)


def test_a_port_that_is_taken_or_impossible_is_named(folder):
    with serve(find_page(folder, folder), 0) as server, pytest.raises(BadInput, match=str(server.server_address[1])):
        serve(find_page(folder, folder), server.server_address[1])
    with pytest.raises(BadInput, match="99999"):
        serve(find_page(folder, folder), 99999)


def test_the_demo_clip_is_made_once_and_whole_or_not_at_all(tmp_path, monkeypatch):
    made = []

    def make_clip(out, **options):
        made.append(out)
        out.mkdir(parents=True, exist_ok=True)
        (out / "clip.mp4").write_text("half")
        if len(made) == 1:
            raise KeyboardInterrupt
        (out / "clip.mp4").write_text("whole")
        return out / "clip.mp4"

    monkeypatch.setattr(turntable, "make_clip", make_clip)
    with pytest.raises(KeyboardInterrupt):
        make_truth_clip(tmp_path / "clip", plain_journal())
    assert not (tmp_path / "clip").exists()
    for _ in range(2):
        assert make_truth_clip(tmp_path / "clip", plain_journal()).read_text() == "whole"
    assert len(made) == 2

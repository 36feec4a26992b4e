import threading
import urllib.error
import urllib.request

import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.pipeline.commands.demo import make_truth_clip
from gsac.pipeline.commands.view import address, find_page, serve
from gsac.pipeline.reporter import PlainReporter
from gsac.stages.contract import BadInput
from gsac.turntable import clip as turntable
from gsac.viewer.page import page_bytes
from support.figure import make_figure


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "abc.html").write_text("<h1>avatar</h1>")
    export = tmp_path / "run" / "export"
    export.mkdir(parents=True)
    (export / "viewer.html").symlink_to(tmp_path / "store" / "abc.html")
    (tmp_path / "run" / "secret.txt").write_text("secret")
    return tmp_path / "run"


def test_the_viewer_page_is_served_through_its_link_on_this_machine_only(folder):
    with serve(find_page(folder, folder), 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        assert address(server).startswith("http://127.0.0.1:") and server.server_address[0] == "127.0.0.1"
        assert urllib.request.urlopen(address(server)).read() == b"<h1>avatar</h1>"
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(address(server).replace("viewer.html", "../secret.txt"))
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
        make_truth_clip(tmp_path / "clip", PlainReporter())
    assert not (tmp_path / "clip").exists()
    for _ in range(2):
        assert make_truth_clip(tmp_path / "clip", PlainReporter()).read_text() == "whole"
    assert len(made) == 2

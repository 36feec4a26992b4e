"""gsac pack: one zip that holds all that its pages link to."""

import html.parser
import json
import os
import shutil
import zipfile
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.cache.key import KeyParts
from gsac.cache.publish import publish
from gsac.cache.record import RunInfo
from gsac.cache.store import Store
from gsac.pipeline.cli import execute
from gsac.pipeline.project import shipped_dag
from gsac.pipeline.report.page import write_report
from gsac.pipeline.run_folder import RunFolder
from gsac.viewer.page import page_bytes
from support.figure import make_figure

EXPORTS = ("avatar.gsac", "avatar.glb", "unity", "viewer.html")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A run's folder whose stage export is done, with the real report and viewer page of the small figure."""
    monkeypatch.chdir(tmp_path)
    store, run = Store(tmp_path / "cache"), RunFolder(tmp_path / "Ärger & 1-avatar")
    run.root.mkdir()
    (tmp_path / "clip.mp4").write_text("clip")
    run.clip.symlink_to(tmp_path / "clip.mp4")
    shutil.copyfile(shipped_dag(), run.root / "dvc.yaml")
    (run.root / "params.yaml").write_text("export: {}\n")
    with store.private("export") as made:
        avatar = avatar_bytes(make_figure())
        (made / "avatar.gsac").write_bytes(avatar)
        (made / "avatar.glb").write_bytes(b"glb")
        (made / "viewer.html").write_bytes(page_bytes(avatar))
        (made / "unity" / "deep").mkdir(parents=True)
        (made / "unity" / "deep" / "scene.txt").write_text("scene")
        run.place(store, publish(store, KeyParts("export", {}, {}), made, EXPORTS, RunInfo()))
    run.write_json("run.json", {"clip": str(tmp_path / "clip.mp4"), "stages": [{"name": "export", "status": "ran"}]})
    run.write_json("metrics.json", {"psnr_fg": 24.5})
    write_report(run.root)
    shutil.rmtree(store.root, ignore_errors=True)
    return run.root


def pack(capsys, *words):
    code = execute(["pack", *map(str, words)])
    said = capsys.readouterr()
    return code, said.out, said.err


class Links(html.parser.HTMLParser):
    """Addresses of a page that lead out of it."""

    def __init__(self, page):
        super().__init__()
        self.found = []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        refresh = attrs.get("content", "") if attrs.get("http-equiv") == "refresh" else ""
        named = [attrs.get(name) for name in ("href", "src", "poster", "data")] + [refresh.partition("url=")[2]]
        self.found += [name for name in named if name and not name.startswith(("#", "data:"))]


def test_unpacked_elsewhere_with_the_cache_gone_every_link_of_every_page_leads_to_a_file_in_the_zip(folder, tmp_path, capsys):
    code, out, err = pack(capsys, folder)
    assert code == 0, err
    assert out == f"{tmp_path / folder.name}.zip\n"
    away = tmp_path / "away"
    zipfile.ZipFile(out.strip()).extractall(away)
    shutil.rmtree(folder)
    top = away / folder.name
    pages = [top / "report.html", top / "viewer.html", top / "export" / "viewer.html"]
    links = {page: [urlsplit(found) for found in Links(page).found] for page in pages}
    assert {unquote(link.path) for link in links[pages[0]]} >= {f"export/{name}" for name in EXPORTS}
    for page, found in links.items():
        for link in found:
            target = (page.parent / unquote(link.path)).resolve()
            assert not link.scheme and target.exists() and target.is_relative_to(top), (page, link)
    assert (top / "export" / "unity" / "deep" / "scene.txt").read_text() == "scene"
    assert json.loads((top / "metrics.json").read_text()) == {"psnr_fg": 24.5} and (top / "params.yaml").is_file()
    assert len((top / "README.txt").read_text().splitlines()) == 5
    assert not any(path.is_symlink() for path in top.rglob("*"))


def test_nothing_in_the_zip_names_a_path_of_this_machine(folder, tmp_path, capsys):
    pack(capsys, folder)
    archive = zipfile.ZipFile(f"{folder}.zip")
    assert all(str(tmp_path).encode() not in archive.read(name) for name in archive.namelist())


def test_the_same_folder_gives_the_same_bytes(folder, capsys, monkeypatch):
    pack(capsys, folder, "--out", "one.zip")
    for file in folder.rglob("*"):
        os.utime(file, (1, 1), follow_symlinks=False)
    monkeypatch.chdir(folder)
    assert pack(capsys, ".", "--out", "../two.zip")[0] == 0
    assert Path("../one.zip").read_bytes() == Path("../two.zip").read_bytes()


def test_a_zip_that_is_there_stays_unless_it_is_forced(folder, tmp_path, capsys):
    (tmp_path / "mine.zip").write_text("mine")
    code, _, err = pack(capsys, folder, "--out", "mine.zip")
    assert code == 2 and "mine.zip is there already" in err and "--force" in err
    assert (tmp_path / "mine.zip").read_text() == "mine"
    code, out, _ = pack(capsys, folder, "--out", "mine.zip", "--force", "--json")
    assert code == 0 and zipfile.is_zipfile(tmp_path / "mine.zip")
    assert json.loads(out.splitlines()[-1])["outputs"] == {"zip": str(tmp_path / "mine.zip")}


def test_results_that_are_not_up_to_date_go_along_with_a_warning(folder, capsys):
    row = {"name": "export", "status": "ran", "stale": True, "stale_reason": "made from an earlier train/avatar.npz; run again"}
    (folder / "run.json").write_text(json.dumps({"stages": [row]}))
    warning = "export is not up to date (made from an earlier train/avatar.npz; run again)"
    picture = ["--out", "one.gif", "--size", "16x16", "--fps", "1"]
    for command in (["pack", folder], ["convert", folder, "glb"], ["render", folder, *picture]):
        assert execute([str(word) for word in command]) == 0
        said = capsys.readouterr()
        assert warning in " ".join(said.err.split()) and warning not in said.out


def test_a_folder_that_takes_no_files_is_named_before_any_work(folder, monkeypatch, capsys, tmp_path):
    (tmp_path / "full").mkdir()
    may = os.access
    monkeypatch.setattr("os.access", lambda path, how: str(path) != str(tmp_path / "full") and may(path, how))
    code, out, err = pack(capsys, folder, "--out", tmp_path / "full/a.zip")
    assert code == 2 and not out and f"{tmp_path}/full may not be written into; give another --out" in " ".join(err.split())


def test_a_packed_zip_is_told_from_a_bundle(folder, monkeypatch, capsys, tmp_path):
    assert pack(capsys, folder)[0] == 0
    monkeypatch.setenv("GSAC_CACHE", str(tmp_path / "other"))
    assert execute(["bundle", "import", f"{folder.name}.zip"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "is no bundle that can be trusted: it is a zip, as `gsac pack` makes it; nothing of it was taken" in said


def test_what_the_user_added_to_export_goes_along_hidden_files_and_the_zip_itself_do_not(folder, capsys):
    (folder / "export" / "note.txt").write_text("mine")
    (folder / "export" / ".thumbs").write_text("hidden")
    for _ in range(2):
        assert pack(capsys, folder, "--out", folder / "export" / "all.zip", "--force")[0] == 0
    names = {name.partition("/")[2] for name in zipfile.ZipFile(folder / "export" / "all.zip").namelist()}
    assert "export/note.txt" in names and not {"export/.thumbs", "export/all.zip"} & names


def test_a_link_to_a_folder_below_export_is_named_with_where_to_take_it_from(folder, capsys):
    (folder / "export" / "mine").mkdir()
    (folder / "export" / "mine" / "link").symlink_to(folder)
    code, _, err = pack(capsys, folder, "--out", "a.zip")
    assert code == 2 and f"{folder}/export/mine/link is neither a file nor a folder" in err and not Path("a.zip").exists()
    assert err.endswith(f"; take it out of {folder}/export\n")


def test_names_that_are_not_text_go_along_with_their_bytes_replaced(folder, capsys):
    folder = folder.rename(folder.with_name(os.fsdecode(b"bad\xff-avatar")))
    (folder / "export" / os.fsdecode(b"note\xff.txt")).write_text("mine")
    assert pack(capsys, folder, "--out", "bad.zip")[0] == 0
    archive = zipfile.ZipFile("bad.zip")
    assert archive.read("bad\ufffd-avatar/export/note\ufffd.txt") == b"mine"
    assert archive.read("bad\ufffd-avatar/README.txt").decode().startswith("bad\ufffd-avatar: an avatar that GSAC made")


@pytest.mark.parametrize(("gone", "words"), [
    ("report.html", "report.html is missing; `gsac run"), ("export/viewer.html", "viewer.html is missing; `gsac run"),
    ("export/avatar.glb", "links to export/avatar.glb, which is not in"), ("dvc.yaml", "not the folder of a run")])
def test_a_folder_that_is_not_complete_is_named_with_the_way_to_complete_it_and_leaves_no_zip(folder, capsys, gone, words):
    (folder / gone).unlink()
    code, _, err = pack(capsys, folder)
    assert code == 2 and words in err
    assert not list(folder.parent.glob("*.zip"))

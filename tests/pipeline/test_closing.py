"""The last lines of a run."""

import os
import subprocess

import pytest

from gsac.pipeline.closing import closing_lines
from gsac.pipeline.run_folder import RunFolder


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    export = tmp_path / "my avatar" / "export"
    export.mkdir(parents=True)
    (export / "avatar.gsac").touch()
    (export / "viewer.html").touch()
    marks = {"drawn-from": "0", "shows": "train", "verdict": "Body good."}
    (tmp_path / "my avatar" / "report.html").write_text(
        "".join(f'<meta name="gsac-{name}" content="{content}">' for name, content in marks.items()))
    return RunFolder(tmp_path / "my avatar")


def test_a_finished_run_ends_with_its_verdict_the_paths_of_what_to_open_and_the_next_command(folder):
    assert closing_lines(folder) == [
        "verdict: Body good.", f"avatar:  {folder.root}/export/avatar.gsac",
        f"viewer:  {folder.root}/export/viewer.html", f"report:  {folder.root}/report.html", "next:    gsac view 'my avatar'"]


def test_the_next_command_is_typed_as_this_one_was_where_the_name_alone_is_not_found(folder, monkeypatch):
    monkeypatch.setattr("sys.argv", ["/there/my bin/gsac", "run"])
    monkeypatch.setenv("PATH", "/nowhere")
    assert closing_lines(folder)[-1] == "next:    '/there/my bin/gsac' view 'my avatar'"


def test_a_name_that_is_not_text_is_written_as_a_shell_reads_it(folder):
    path = os.fsdecode(b"it's a \\ b\xc3\xa4d\xff-avatar")
    line = closing_lines(RunFolder(folder.root.rename(folder.root.with_name(path))))[-1]
    said = subprocess.run(["bash", "-c", line.replace("next:    gsac view", "printf %s")], capture_output=True)
    assert line.isascii() and said.stdout == os.fsencode(path)


def test_a_run_that_stops_early_names_only_what_is_there(folder):
    (folder.root / "export" / "viewer.html").unlink()
    (folder.root / "export" / "avatar.gsac").unlink()
    (folder.root / "report.html").write_text("")
    assert closing_lines(folder) == [f"report:  {folder.root}/report.html"]


def test_stdout_holds_the_folder_of_the_results_and_nothing_else(toy):
    done = toy.gsac("run", toy.clip, "--out", "here")
    assert done.out == f"{toy.root}/here\n" and f"report:  {toy.root}/here/report.html" in done.err

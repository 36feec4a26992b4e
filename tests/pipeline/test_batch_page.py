"""batch.html: what became of each clip, as the reports and runs in the folder say."""

import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.frame_files import write_frame
from gsac.benchmarks.viewer import browser as chromium
from gsac.pipeline.executors.executor import ClipJob, ClipResult
from gsac.pipeline.report import batch
from gsac.pipeline.report.batch import IN_PICTURE, BatchPage
from gsac.pipeline.report.page import write_report
from gsac.stages.contract import BadInput
from gsac.stages.findings import Code

FACES = {"ada": 0.97, "bob": 0.92}
"""Clip -> likeness of the avatar's face: good, fair."""
LIKE = {"psnr": 31.0, "structure": 0.95, "worst": 0.92, "px": 420}
FOUND = {"The camera moves by up to 9 px, in frame 3. Stand the phone on something firm.":
         {"code": "camera_moves", "severity": "wrong"},
         "The face was never seen from the front; the avatar's face stays at rest.": {"code": "face_at_rest", "severity": "poorer"},
         "The edge of the picture cuts off the head in all 9 frames; what lies outside is guessed. Stand in the middle.":
         {"code": "cut_off", "severity": "poorer"},
         "A second person was seen in 2 of 9 frames (0-1); the one on the left in the picture is followed. Keep others out.":
         {"code": "second_person", "severity": "poorer"}}
AXE = "axe-core@4.10.3"


def write_run(folder, clip, *rows):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "run.json").write_text(json.dumps({"clip": f"/home/somebody/{clip}", "stages": rows}))


def write_avatar(folder, clip, face):
    """The folder of a run with a report; the views of the avatar are grey, the front one red."""
    for name in ("train/heldout", "export"):
        (folder / name).mkdir(parents=True)
    found = {"warnings": [*FOUND], "findings": [*FOUND.values()]}
    write_run(folder, clip, {"name": "train", "status": "ran"} | found, {"name": "export", "status": "ran"})
    (folder / "train/metrics.json").write_text(json.dumps({
        "likeness": {"body": LIKE, "face": LIKE | {"worst": face}, "hands": LIKE}, "seen_area": 0.97, "stray_alpha": 0.0,
        "torn_alpha": 0.0}))
    views = np.full((880, 900, 3), 200, np.uint8)
    views[:440, :300] = 200, 0, 0
    write_frame(folder / "train/heldout/views.png", views)
    (folder / "export/viewer.html").write_text("viewer")
    write_report(folder)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """The folder of a batch of five clips: two avatars, a failure, a clip that left no folder and one not done yet. One more
    run, an earlier one, lies there as well."""
    out = tmp_path_factory.mktemp("batch") / "avatars"
    for name, face in FACES.items():
        write_avatar(out / f"{name}-avatar", f"{name}.mp4", face)
    write_avatar(out / "earlier-avatar", "earlier & <i>.mp4", 0.97)
    failed = {"name": "keypoints", "status": "failed", "error": "no person in any frame; record again"}
    write_run(out / "eva-avatar", "eva.mp4", {"name": "split", "status": "ran"}, failed)
    (out / "eva-avatar" / "logs").mkdir()
    (out / "eva-avatar" / "logs" / "keypoints.log").write_text("words")
    write_report(out / "eva-avatar")
    jobs = {name: ClipJob(Path(f"/home/somebody/{name}.mp4"), out / f"{name}-avatar") for name in (*FACES, "eva", "gone", "late")}
    page = BatchPage(out, list(jobs.values()))
    for name in FACES:
        page.add(ClipResult(jobs[name], 0, 10.0))
    page.add(ClipResult(jobs["eva"], 1, 1.0, "stage keypoints failed", {"stages": [failed]}))
    refused = {"name": "split", "status": "failed"}
    page.add(ClipResult(jobs["gone"], 2, 0.1, "stage split failed: /home/somebody/gone.mp4: no video in it", {"stages": [refused]}))
    page.write()
    return out


def write_page(folder, result):
    page = BatchPage(folder, [result.job])
    page.add(result)
    page.write()


def read_cards(page):
    """Clip -> text and HTML of its card, in the page's order."""
    cards = re.findall(r'<li class="card"[^>]*>(.*?)</li>', page.read_text(), re.DOTALL)
    texts = {unescape(re.search("<h3>(.*?)</h3>", card)[1]): card for card in cards}
    return {clip: (" ".join(unescape(re.sub("<[^>]+>", " ", card)).split()), card) for clip, card in texts.items()}


def test_each_clip_has_a_card_with_the_verdict_of_its_report_failures_first(out):
    cards = read_cards(out / "batch.html")
    assert list(cards) == ["eva.mp4", "gone.mp4", "ada.mp4", "bob.mp4", "late.mp4", "earlier & <i>.mp4"]
    assert "✓ Good Body good, face good, hands good, seen from all sides good" in cards["ada.mp4"][0]
    assert "~ Fair Body good, face fair" in cards["bob.mp4"][0]
    assert "Found: camera moves Report" in cards["ada.mp4"][0] and "face at rest" not in cards["ada.mp4"][0]
    said = "cuts off the head in all 9 frames; what lies outside is guessed. A second person was seen in 2 of 9 frames"
    assert said in cards["ada.mp4"][0]
    assert "Stand in the middle" not in cards["ada.mp4"][0], "what to do is the report's"
    assert "✕ Failed Stage keypoints failed: no person in any frame; record again" in cards["eva.mp4"][0]
    assert "✕ Failed stage split failed: gone.mp4: no video in it" in cards["gone.mp4"][0]
    assert "Not done yet" in cards["late.mp4"][0]
    assert "2 of 5 clips done, 2 failed." in (out / "batch.html").read_text()


def test_what_a_card_tells_in_words_are_findings_that_stages_make():
    assert set(IN_PICTURE) <= {code.word for code in Code}


def test_every_link_leads_to_a_file_beside_the_page_and_nothing_tells_where_the_clips_lie(out):
    html = (out / "batch.html").read_text()
    links = re.findall(r'(?:href|src)="([^"]+)"', html)
    assert all(link.startswith("data:") or (out / link).is_file() for link in links)
    assert {"ada-avatar/export/viewer.html", "ada-avatar/report.html", "eva-avatar/logs/keypoints.log"} <= set(links)
    assert "somebody" not in html and str(out) not in html


def test_a_clip_that_was_refused_does_not_show_the_other_avatar_in_its_folder(out, tmp_path):
    write_avatar(tmp_path / "ada-avatar", "ada.mp4", 0.97)
    job = ClipJob(Path("/elsewhere/ada.mp4"), tmp_path / "ada-avatar")
    write_page(tmp_path, ClipResult(job, 2, 0.1, f"{tmp_path}/ada-avatar holds the avatar of /home/ada.mp4"))
    text, html = read_cards(tmp_path / "batch.html")["ada.mp4"]
    assert "✕ Failed ada-avatar holds the avatar of /home/ada.mp4" in text and "<img" not in html and "href" not in html


def test_clips_that_a_resumed_batch_leaves_keep_their_verdict_or_their_failure(out, tmp_path):
    write_avatar(tmp_path / "ada-avatar", "ada.mp4", 0.97)
    jobs = [ClipJob(Path(f"/elsewhere/{name}.mp4"), tmp_path / f"{name}-avatar") for name in ("ada", "cut")]
    page = BatchPage(tmp_path, jobs)
    for job, error in zip(jobs, ("", "stage split failed: /elsewhere/cut.mp4: not a video"), strict=True):
        page.keep(job, error)
    page.write()
    cards = read_cards(tmp_path / "batch.html")
    assert "✓ Good" in cards["ada.mp4"][0] and "✕ Failed stage split failed: cut.mp4: not a video" in cards["cut.mp4"][0]
    assert "1 of 2 clips done, 1 failed." in (tmp_path / "batch.html").read_text()


def test_pictures_of_the_page_before_are_kept_as_long_as_their_report_is_the_same(tmp_path, monkeypatch):
    def write_again():
        write_page(tmp_path, ClipResult(ClipJob(Path("/elsewhere/ada.mp4"), tmp_path / "ada-avatar"), 0, 1.0))
        return (tmp_path / "batch.html").read_text()

    write_avatar(tmp_path / "ada-avatar", "ada.mp4", 0.97)
    first, cut = write_again(), []
    monkeypatch.setattr(batch, "cut_strip", lambda page, drawn: cut.append(page))
    assert write_again() == first and not cut
    metrics = tmp_path / "ada-avatar/train/metrics.json"
    metrics.write_text(metrics.read_text().replace("0.97", "0.92"))
    run = json.loads((tmp_path / "ada-avatar/run.json").read_text())
    run["stages"][0]["outputs"] = {"train/metrics.json": "another"}
    (tmp_path / "ada-avatar/run.json").write_text(json.dumps(run))
    write_report(tmp_path / "ada-avatar")
    write_again()
    assert cut == [tmp_path / "ada-avatar/report.html"]


def test_an_unreadable_report_costs_its_own_verdict_only(tmp_path):
    write_avatar(tmp_path / "ada-avatar", "ada.mp4", 0.97)
    write_run(tmp_path / "old-avatar", "old.mp4", {"name": "train", "status": "ran"})
    (tmp_path / "old-avatar" / "report.html").write_bytes(b"\xff of another version")
    job = ClipJob(Path("/elsewhere/ada.mp4"), tmp_path / "ada-avatar")
    write_page(tmp_path, ClipResult(job, 0, 1.0))
    cards = read_cards(tmp_path / "batch.html")
    assert "`gsac report old-avatar` writes it" in cards["old.mp4"][0] and "✓ Good" in cards["ada.mp4"][0]


def test_a_page_of_the_user_s_by_that_name_is_never_written_over(tmp_path):
    (tmp_path / "batch.html").write_text("mine")
    with pytest.raises(BadInput, match="was not written by `gsac batch`"):
        BatchPage(tmp_path, [])


@pytest.mark.slow
@pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")
def test_everybody_can_read_the_page_and_its_avatars_turn_under_the_pointer(out, node_package):
    axe = (node_package(AXE) / "node_modules/axe-core/axe.min.js").read_text()
    browser = chromium.Browser(390, 900)
    try:
        for width in (390, 1440):
            for scheme in ("light", "dark"):
                browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
                browser.resize(width, 900, mobile=width < 500)
                browser.open((out / "batch.html").as_uri())
                assert browser.run("document.documentElement.scrollWidth") == width
                browser.run(f"{axe};0")
                assert browser.run("axe.run().then(r => r.violations.map(v => v.id))") == []
        front = "document.querySelector('.turn img')"
        assert browser.run(f"{front}.decode().then(() => getComputedStyle({front}).animationName)") == "none"
        x, y = browser.run(f"(box => [box.x + 20, box.y + 20])({front}.parentNode.getBoundingClientRect())")
        assert browser.picture()[int(y), int(x), 0] > 150 > browser.picture()[int(y), int(x), 1], "the front is red"
        browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        assert browser.run(f"getComputedStyle({front}).animationName") == "turn"
        shown = "[...document.querySelectorAll('.card:not([hidden]) h3')].map(e => e.textContent)"
        choose = ("((id, to) => {{let e = document.getElementById(id); e.value = to; e.dispatchEvent(new Event('input'))}})"
                  "('{}', '{}');")
        assert browser.run(choose.format("show", "failed") + shown)[:2] == ["eva.mp4", "gone.mp4"]
        assert "ada.mp4" not in browser.run(shown)
        by_name = browser.run(choose.format("show", "") + choose.format("sort", "clip") + shown)
        assert by_name[:3] == ["ada.mp4", "bob.mp4", "eva.mp4"]
        assert not browser.errors and {address.partition(":")[0] for address in browser.requests} <= {"file", "data"}
    finally:
        browser.close()

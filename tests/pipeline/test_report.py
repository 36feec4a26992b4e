"""report.html: whole, partial and failed runs; nothing outside the page; nothing of the user's text taken for HTML."""

import base64
import errno
import json
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from urllib.parse import unquote

import cv2
import numpy as np
import pytest

from gsac.avatar.artifacts import Clip, write_arrays
from gsac.avatar.body import LOST, Body, BodyParams
from gsac.avatar.frame_files import read_frame, write_alpha, write_frame
from gsac.avatar.network_files import OWN_LICENCE
from gsac.avatar.wholebody import HANDS, INDEX
from gsac.avatar.zbuffer import silhouette
from gsac.benchmarks.viewer import browser as chromium
from gsac.pipeline.cli import execute
from gsac.pipeline.report.advice import Advice, give_advice
from gsac.pipeline.report.charts import curve_chart
from gsac.pipeline.report.compare import write_comparison
from gsac.pipeline.report.drawing import FILLED_COLOUR, MISSING_COLOUR, SIDE_COLOURS, draw_keypoints, over_magenta
from gsac.pipeline.report.page import draw_sections, seconds, size, write_report
from gsac.pipeline.report.pictures import MOST_BYTES, make_picture
from gsac.pipeline.report.quality import weaknesses
from gsac.pipeline.report.verdict import Grade, give_verdict
from gsac.stages.findings import Code, Finding

T, WIDTH, HEIGHT = 6, 90, 160
STAGES = ("split", "keypoints", "handgap", "segment", "face", "smplx", "train", "export")
FILLED_FRAME, MISSING_FRAME = 2, 4
LIKE = {"body": {"psnr": 31.0, "structure": 0.95, "worst": 0.92, "px": 420}, "hands": None,
        "face": {"psnr": 30.0, "structure": 0.94, "worst": 0.92, "px": 50}}
GOOD_FACE = LIKE | {"face": LIKE["face"] | {"worst": 0.97}}
"""Body good, face fair (good), hands in no held-out frame."""
PICTURES = ("clip", "keypoints", "alpha", "body", "heldout", "faces", "views")


def stage_row(name, **changes):
    return {"name": name, "status": "ran", "seconds": 10.0, "cpu_seconds": 8.0, "peak_rss_mb": 250.0, "key": "ab" * 32,
            "reason": "", "warnings": [], "params": {}} | changes


def write_run(out, rows, clip="/somewhere/private/turn.mp4"):
    (out / "run.json").write_text(json.dumps({"clip": clip, "stages": rows, "outputs": {}, "metrics": {}}))


def write_artifacts(out):
    """A body that turns once, its exact keypoints and mask, one hand filled in one frame and missing in another."""
    for port in ("split/frames", "keypoints", "handgap", "segment/alpha", "face", "smplx", "train/heldout", "export"):
        (out / port).mkdir(parents=True)
    body = Body.load()
    pose = np.zeros((T, 55, 3), np.float32)
    for t, angle in enumerate(np.linspace(0, 2 * np.pi, T, endpoint=False)):
        turned = cv2.Rodrigues(np.array([np.pi, 0, 0]))[0] @ cv2.Rodrigues(np.array([0, angle, 0]))[0]
        pose[t, 0] = cv2.Rodrigues(turned)[0][:, 0]
    zeros = np.zeros((T, body.exprdirs.shape[2]))
    params = BodyParams.from_pose(pose, np.tile((0, 0, 4.0), (T, 1)), np.zeros(body.num_betas), zeros, 200,
                                  (WIDTH / 2, HEIGHT / 2), model=body.digest)
    vertices, params.joints = body.posed(params)
    camera = params.camera(WIDTH, HEIGHT)
    params.write(out / "smplx/body.npz")
    params.write(out / "train/body.npz")
    noise = np.random.default_rng(0)
    for t in range(T):
        mask = silhouette(vertices[t], body.faces, camera)
        write_frame(out / f"split/frames/{t:06d}.png", np.uint8(noise.integers(60, 90, (HEIGHT, WIDTH, 3)) + 80 * mask[..., None]))
        write_alpha(out / f"segment/alpha/{t:06d}.exr", mask.astype(np.float32))
    Clip(30.0, [t / 30 for t in range(T)], WIDTH, HEIGHT, None, "0" * 64).write(out / "split/clip.json")
    xy = camera.project(body.keypoints(vertices)).astype(np.float32)
    score = np.isfinite(xy).all(2).astype(np.float32)
    keypoints = {"xy": np.nan_to_num(xy), "world": np.full((T, 133, 3), np.nan, np.float32), "detector": np.array("toy")}
    write_arrays(out / "keypoints/keypoints.npz", score=score, pose33=np.zeros((T, 33, 3), np.float32),
                 face_mesh=np.full((T, 468, 3), np.nan, np.float32), **keypoints)
    filled, missing = np.zeros((T, 133), bool), np.zeros((T, 2), bool)
    filled[FILLED_FRAME, HANDS["left"]] = True
    missing[[FILLED_FRAME, MISSING_FRAME], 0] = True
    score = score.copy()
    score[MISSING_FRAME, HANDS["left"]] = 0
    write_arrays(out / "handgap/keypoints.npz", score=score, filled=filled, missing=missing,
                 sigma=np.ones((T, 133), np.float32), **keypoints)
    write_arrays(out / "face/face.npz", valid=np.array([True, True, False, False, False, True]))
    for kind, value in (("truth", 200), ("render", 190), ("error", 10)):
        image = np.full((80, 45, 3), 255, np.uint8)
        image[20:60, 10:30] = value
        for frame in (1, 4):
            write_frame(out / f"train/heldout/{frame:06d}_{kind}.png", image)
    write_frame(out / "train/heldout/views.png", np.full((96, 144, 3), 220, np.uint8))
    (out / "train/metrics.json").write_text(json.dumps({
        "psnr_fg": 26.54, "psnr_fg_ttpo": 28.91, "psnr_fg_fit": 24.0, "psnr_fg_train": 27.0, "ssim": 0.98, "lpips": None,
        "image_size": [45, 80], "trained_frames": 4, "heldout_frames": [1, 4],
        "n_gaussians": 12345, "unseen_gaussians": 10, "alpha_iou": 0.97, "likeness": LIKE, "seen_area": 0.97,
        "stray_alpha": 0.0005, "torn_alpha": 0.001,
        "heldout": [{"frame": 1, "psnr_fg": 27.5, "psnr_fg_ttpo": 29.0, "psnr_face": 25.5, "face_box": [12, 22, 22, 32]},
                    {"frame": 4, "psnr_fg": 21.25, "psnr_fg_ttpo": None, "psnr_face": None, "face_box": None}],
        "at_540": {"psnr_fg": 26.0, "psnr_fg_ttpo": 28.44},
        "curve": [{"step": i, "seconds": 3.0 * i, "loss": 0.1 / i, "psnr_fg": 20.0 + i} for i in range(1, 8)],
    }))
    for name, length in (("avatar.gsac", 3000), ("viewer.html", 5000), ("avatar.ply", 700), ("avatar.glb", 90)):
        (out / "export" / name).write_bytes(b"x" * length)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a run with everything in it."""
    out = tmp_path_factory.mktemp("whole")
    write_artifacts(out)
    rows = [stage_row(name) for name in STAGES]
    rows[0] |= {"status": "cached", "seconds": 75.0}
    rows[4] |= {"warnings": ["The face is seen in 3 frames only."]}
    rows[6] |= {"params": {"steps": 77, "seed": 0}}
    write_run(out, rows)
    write_report(out)
    return out


@pytest.fixture
def copied(whole, tmp_path):
    """The same, to be spoilt."""
    return shutil.copytree(whole, tmp_path / "run", ignore=shutil.ignore_patterns("report.html"))


class Page(HTMLParser):
    """Tags, addresses and texts as a browser would see them."""

    def __init__(self, path):
        super().__init__()
        self.html = path.read_text()
        self.tags, self.texts, self.section, self.where = [], [], "head", {}
        self.feed(self.html)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag in ("section", "footer"):
            self.section = dict(attrs).get("id", tag)
        if tag == "img":
            self.where.setdefault(self.section, []).append(dict(attrs))

    def handle_data(self, data):
        if self.tags and self.tags[-1][0] not in ("style", "script"):
            self.texts.append((self.section, data))

    def text(self, section=None):
        return " ".join(" ".join(t for s, t in self.texts if section in (None, s)).split())

    def images(self, section):
        return self.where.get(section, [])


def page_of(out):
    return Page(write_report(out))


def test_a_whole_run_shows_every_section(whole):
    page = Page(whole / "report.html")
    assert all(page.images(section) for section in PICTURES)
    assert "absent" not in {attrs.get("class") for _, attrs in page.tags}
    head = page.text("head")
    for words in ("turn.mp4", "26.54 dB", "28.91 dB", "12,345", "2 min 25 s"):
        assert words in head
    assert "The face is seen in 3 frames only." in page.text("warnings")
    assert "75.0 s" not in page.text("stages") and "1 min 15 s then" in page.text("stages")
    assert len([t for t, a in page.tags if t == "polyline"]) == 2


def test_sections_drawn_while_the_last_stage_runs_are_those_of_the_stages_before_and_give_the_same_page(copied, whole):
    early = draw_sections(copied, ["train", "export"])
    assert sorted(early) == ["alpha", "body", "clip", "keypoints"]
    shutil.rmtree(copied / "segment" / "alpha")
    page = Page(write_report(copied, early))
    assert all(page.images(section) == Page(whole / "report.html").images(section) for section in PICTURES)


def test_sections_that_are_drawn_already_are_not_drawn_again(copied):
    early = draw_sections(copied, ["train", "export"])
    later = draw_sections(copied, ["export"], early)
    assert all(later[name] is section for name, section in early.items())
    assert {"avatar", "heldout"} <= later.keys() - early.keys()


def test_a_section_that_was_drawn_early_is_shown_only_if_its_stage_is_of_this_folder(copied):
    early = draw_sections(copied, ["train", "export"])
    write_run(copied, [stage_row("split"), stage_row("keypoints")])
    page = Page(write_report(copied, early))
    assert page.images("clip") and not page.images("body") and not page.images("alpha")


def test_names_that_are_not_utf8_give_a_page_with_all_its_pictures(copied):
    write_run(copied, [stage_row(name) for name in STAGES], clip="/somewhere/t\udcffrn.mp4")
    odd = copied.rename(copied.with_name("b\udcffd ü"))
    page = page_of(odd)
    assert [section for section in PICTURES if not page.images(section)] == [] and "t?rn.mp4" in page.text("head")
    write_comparison(odd, odd, odd.parent / "compare.html")


def test_a_folder_whose_dvc_yaml_is_torn_gives_a_page(copied):
    (copied / "dvc.yaml").write_text("stages: [")
    assert page_of(copied).images("clip")


def test_a_section_of_a_stale_result_says_what_it_was_made_from(copied):
    rows = [stage_row(name) for name in STAGES]
    rows[5] |= {"stale": True, "stale_reason": "made from an earlier split/frames; run again"}
    rows[6] = stage_row("train", status="failed", error="no room", earlier=stage_row("train"))
    write_run(copied, rows)
    page = page_of(copied)
    assert "This result was made from an earlier split/frames; run again." in page.text("body") and page.images("body")
    assert "Stage train failed in the last run: this is an earlier result." in page.text("heldout") and page.images("heldout")
    assert "Not of the last run's inputs: smplx." in page.text("head") and "failed" in page.text("stages")


def test_the_page_asks_for_nothing_outside_itself(whole):
    page = Page(whole / "report.html")
    addresses = [a[name] for _, a in page.tags for name in ("src", "href", "srcset", "poster", "data") if a.get(name)]
    pictures = [a["src"] for t, a in page.tags if t == "img"]
    assert len(pictures) > 20 and all(p.startswith("data:image/webp;base64,") for p in pictures)
    for address in set(addresses) - set(pictures):
        assert address.startswith("#") or (whole / unquote(address)).exists()
    assert not re.search(r"url\(|@import|https?://|//[a-z]+\.", re.sub(r"base64,[^\"]*", "", page.html))
    assert "/somewhere/private" not in page.html


def test_an_exact_body_lies_on_the_person(whole):
    text = Page(whole / "report.html").text("body")
    assert float(re.search(r"Joint reprojection, median of the frames shown ([\d.]+) px", text)[1]) < 0.2
    assert float(re.search(r"Outline IoU, mean of the frames shown ([\d.]+)", text)[1]) > 0.9


def test_hands_are_said_to_be_found_filled_or_missing_frame_by_frame(whole):
    text = Page(whole / "report.html").text("keypoints")
    assert f"frame {FILLED_FRAME} · 0.07 s: left hand filled, right hand found" in text
    assert f"frame {MISSING_FRAME} · 0.13 s: left hand missing, right hand found" in text
    assert "Left hand found 67 %" in text and "Right hand found 100 %" in text and "Left hand filled 17 %" in text


@pytest.fixture
def half_empty(copied):
    """Nobody is in its last three frames: no points but a hand that was filled, empty masks."""
    path = copied / "handgap/keypoints.npz"
    k = dict(np.load(path))
    k["score"][3:] = 0
    k["missing"][3:] = True
    for part in (INDEX["left_wrist"], HANDS["left"]):
        k["score"][3:, part], k["filled"][3:, part] = 0.4, True
    write_arrays(path, **k)
    for t in range(3, T):
        write_alpha(copied / f"segment/alpha/{t:06d}.exr", np.zeros((HEIGHT, WIDTH), np.float32))
    return copied


def test_frames_without_a_person_count_neither_for_the_turn_nor_for_hands_and_outline(half_empty):
    page = page_of(half_empty)
    head, points, body = (page.text(section) for section in ("head", "keypoints", "body"))
    assert "seen over 120 of 360 degrees" in head and "Only 120 of 360 degrees" in head and Advice.TURN.value in head
    assert "A person was found in only 50% of the frames." in head and "Person found 50 %" in points
    assert "Left hand found 67 % of the frames with a person Left hand filled 33 % of the frames with a person" in points
    assert "hand was seen" not in head and Advice.HANDS.value not in head
    assert float(re.search(r"Outline IoU, mean of the frames shown ([\d.]+)", body)[1]) > 0.9
    assert "0.13 s: no person was found" in body
    assert Advice.ONE_PERSON.value in head and "Some masks are empty" not in head
    assert not any(advice.value in head for advice in (Advice.WHOLE, Advice.BACKGROUND, Advice.CLOTHES))


def test_the_turn_is_that_of_the_frames_that_training_used_and_a_part_of_one_is_not_seen_from_all_sides(copied):
    metrics = json.loads((copied / "train/metrics.json").read_text())
    (copied / "train/metrics.json").write_text(json.dumps(metrics | {"turn_degrees": 198.0}))
    head = page_of(copied).text("head")
    assert "seen over 198 of 360 degrees" in head and Advice.TURN.value in head and "seen from all sides fair" in head
    assert "The frames show 97% of the body's surface, from 198 of 360 degrees." in head


def test_a_frame_whose_fit_failed_adds_nothing_to_the_turn(copied):
    params = BodyParams.read(copied / "smplx/body.npz")
    params.sigma_joints[3:] = LOST
    params.write(copied / "smplx/body.npz")
    page = page_of(copied)
    assert "seen over 120 of 360 degrees" in page.text("head") and "0.13 s: not fitted" in page.text("body")


def test_a_frame_without_a_mask_costs_its_own_picture_and_is_named(copied):
    (copied / "segment/alpha/000002.exr").unlink()
    page = page_of(copied)
    assert len(page.images("alpha")) == T - 1 and "No mask, and not shown frame 2" in page.text("alpha")
    for path in (copied / "segment/alpha").iterdir():
        path.unlink()
    assert "segment/alpha has no mask for any frame." in page_of(copied).text("alpha")


def test_a_torn_mask_costs_its_own_picture_and_is_named(copied):
    masks = sorted((copied / "segment/alpha").iterdir())
    masks[2].write_bytes(masks[2].read_bytes()[:11])
    page = page_of(copied)
    assert len(page.images("alpha")) == T - 1 and "Mask cannot be read, and not shown frame 2" in page.text("alpha")
    assert len(page.images("body")) == T
    for mask in masks:
        mask.write_bytes(b"torn")
    assert "No mask of segment/alpha can be read." in page_of(copied).text("alpha")


def test_the_worst_held_out_frame_is_named(whole):
    page = Page(whole / "report.html")
    assert "frame 4, 21.25 dB on the person (the worst frame)" in page.text("heldout")
    assert "Size judged 45 x 80 px Light even Trained on 4 frames Held out 2 frames LPIPS not measured" in page.text("heldout")
    assert "Held-out frame 4 is much worse than the others (21.2 dB)." in page.text("head")
    assert "Aligning the pose to a held-out frame gains 2.4 dB" in page.text("head")


def test_a_held_out_face_is_shown_a_pixel_for_a_pixel_truth_beside_render(whole):
    page = Page(whole / "report.html")
    face, = page.images("faces")
    data = np.frombuffer(base64.b64decode(face["src"].partition(",")[2]), np.uint8)
    shown = cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    truth, render = (read_frame(whole / f"train/heldout/000001_{kind}.png")[18:36, 8:26] for kind in ("truth", "render"))
    half = shown.shape[1] // 2
    assert shown.shape == (18, 2 * half, 3) and (int(face["width"]), int(face["height"])) == (2 * half, 18)
    assert (shown[:, :18] == truth).all() and (shown[:, half:half + 18] == render).all()
    assert face["alt"] == "The face in held-out frame 1, as filmed on the left, as drawn on the right"
    assert "frame 1: truth and render, 25.50 dB in the face's box" in page.text("faces") and 'id="faces-1"' in page.html


def test_the_worst_and_the_best_of_many_faces_are_shown_and_an_older_run_says_that_it_has_none(copied):
    metrics, folder = json.loads((copied / "train/metrics.json").read_text()), copied / "train/heldout"
    rows = [{"frame": t, "psnr_fg": 25.0, "psnr_face": 20.0 + t, "face_box": [12, 22, 22, 32]} for t in range(9)]
    for t in set(range(9)) - {1}:
        for kind in ("truth", "render", "error"):
            shutil.copy(folder / f"000001_{kind}.png", folder / f"{t:06d}_{kind}.png")
    (copied / "train/metrics.json").write_text(json.dumps(metrics | {"heldout": rows}))
    page = page_of(copied)
    assert [re.search(r"frame (\d)", image["alt"])[1] for image in page.images("faces")] == ["8", "4", "0"]
    assert "20.00 dB in the face's box (the worst of them)" in page.text("faces")
    for row in rows:
        del row["face_box"]
    (copied / "train/metrics.json").write_text(json.dumps(metrics | {"heldout": rows}))
    page = page_of(copied)
    assert "No held-out frame shows the face, or an older version" in page.text("faces") and page.images("heldout")


def test_figures_at_540_px_stand_beside_those_of_the_frames_as_filmed(whole):
    text = Page(whole / "report.html").text("head")
    assert "28.91 dB on the held-out frame, avatar frozen, at 45 x 80 px" in text and "Held-out PSNR at 540 px 28.44 dB" in text


@pytest.mark.parametrize(("held", "shown"), [(8, 8), (20, 8)])
def test_every_held_out_frame_is_shown_where_eight_are_enough(copied, held, shown):
    folder = copied / "train/heldout"
    for frame in range(held):
        for kind in ("truth", "render", "error"):
            if frame != 4:
                shutil.copy(folder / f"000004_{kind}.png", folder / f"{frame:06d}_{kind}.png")
    assert len(page_of(copied).images("heldout")) == shown


def test_files_are_linked_with_their_sizes(whole):
    page = Page(whole / "report.html")
    links = {a["href"] for t, a in page.tags if t == "a" and not a["href"].startswith("#")}
    assert links == {f"export/{name}" for name in ("avatar.gsac", "viewer.html", "avatar.ply", "avatar.glb")}
    assert "3.0 kB" in page.text("files") and "90 B" in page.text("files")


def test_a_parameter_that_is_not_at_its_default_shows_both(whole):
    text = Page(whole / "report.html").text("parameters")
    assert re.search(r"train\.steps 77 \(default \w+\)", text)
    assert "train.seed 0 (default" not in text


def test_models_are_named_with_digest_and_licence(copied):
    text = page_of(copied).text("footer")
    assert Body.load().digest in text and "CC0-1.0" in text and "gsac 0" in text
    assert re.search(r"pose_landmark\w* Apache-2.0 [0-9a-f]{64}", text)


@pytest.mark.parametrize(("params", "name"), [({"lpips": "vgg-hed"}, "vgg-hed"), ({"lpips": "loss"}, "lpips-vgg")])
def test_a_networks_terms_are_those_that_the_list_of_models_tells(copied, monkeypatch, tmp_path, capsys, params, name):
    monkeypatch.setenv("GSAC_CACHE", str(tmp_path / "cache"))
    execute(["models", "ls", "--json"])
    licence, = (row["licence"] for row in json.loads(capsys.readouterr().out.splitlines()[-1])["models"] if row["name"] == name)
    write_run(copied, [stage_row("train", params=params)])
    text = page_of(copied).text("footer")
    assert f"{name} {licence}" in text and ("brought by the user" in text) == (licence == OWN_LICENCE)


def test_a_partial_run_says_what_was_not_part_of_it(copied):
    write_run(copied, [stage_row("split"), stage_row("keypoints")])
    page = page_of(copied)
    assert page.images("clip") and page.images("keypoints")
    for section in ("alpha", "body", "heldout", "views"):
        assert not page.images(section)
        assert "was not part of this run. What lies in its folder is of an earlier run and is not shown." in page.text(section)
    assert "This run ended before handgap, segment, face, smplx, train, export" in page.text("head")
    assert "No avatar in this run" in page.text("head")


def test_a_failed_run_says_which_stage_and_why(copied):
    why = "smplx: no frame shows four body points; the clip needs one whole person in view"
    write_run(copied, [stage_row(name) for name in STAGES[:5]] + [stage_row("smplx", status="failed", error=why)])
    page = page_of(copied)
    assert "The run failed in stage smplx." in page.text("head") and why in page.text("head")
    assert why in page.text("body") and why in page.text("stages")
    assert "Stage train was not reached: stage smplx failed." in page.text("heldout")
    assert page.images("alpha") and not page.images("body")


def test_a_run_that_fails_leaves_its_report(toy):
    assert toy.run().code == 0
    assert "failed" not in Page(toy.out / "report.html").text("head")
    assert toy.run("--set", "join.trouble=stage", "--set", "left.trouble=warning").code == 1
    page = Page(toy.out / "report.html")
    assert "The run failed in stage join. join: frame 3 has no person; record again" in page.text("head")
    assert "word 2 is short" in page.text("warnings")


def test_an_empty_folder_gives_a_page(tmp_path):
    page = page_of(tmp_path)
    assert "There is no readable run.json here" in page.text("head")
    assert "split/frames is absent" in page.text("clip")


@pytest.mark.parametrize("run", ["", "[]", '{"stages": 3}', '{"stages": [7, {"status": "ran"}, {"name": "split"}]}'])
def test_a_torn_run_json_gives_a_page(tmp_path, run):
    (tmp_path / "run.json").write_text(run)
    assert "Warnings" in page_of(tmp_path).text()


@pytest.mark.parametrize(("port", "section"), [
    ("split/clip.json", "clip"), ("split/frames/000000.png", "clip"), ("handgap/keypoints.npz", "keypoints"),
    ("segment/alpha/000000.exr", "alpha"), ("smplx/body.npz", "body"), ("train/heldout/000001_truth.png", "heldout"),
    ("train/heldout/views.png", "views"), ("train/metrics.json", "training"),
])
@pytest.mark.parametrize("damage", ["gone", "torn"])
def test_a_missing_or_torn_artifact_costs_its_own_section_only(copied, port, section, damage):
    path = copied / port
    if damage == "gone":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:11])
    page = page_of(copied)
    if (port, damage) not in (("split/frames/000000.png", "gone"), ("handgap/keypoints.npz", "gone")):
        assert any(words in page.text(section) for words in ("absent", "cannot be read", "could not be drawn", "No mask"))
    if section != "views":
        assert page.images("views")
    if section not in ("heldout", "training"):
        assert page.images("heldout")


def test_text_of_the_user_is_never_taken_for_html(copied):
    hostile = "<script>alert(1)</script><img src=x onerror=alert(2)>\"'{{ 7*7 }}"
    rows = [stage_row(name, warnings=[hostile], params={hostile: hostile}) for name in STAGES[:7]]
    write_run(copied, [*rows, stage_row("export", status="failed", error=hostile)], clip=f"/clips/{hostile.replace('/', '_')}.mp4")
    page = page_of(copied)
    assert sum(tag == "script" for tag, _ in page.tags) == 1
    assert not any(name.startswith("on") for _, attrs in page.tags for name in attrs)
    assert page.text("warnings").count(hostile) == 7
    assert hostile in page.text("head") and hostile.replace("/", "_") in page.text("head")


def test_a_picture_never_passes_its_bound():
    noise = np.random.default_rng(0).integers(0, 256, (640, 520, 3), dtype=np.uint8)
    shown = make_picture(noise, "", "")
    assert len(shown.uri) * 3 / 4 <= MOST_BYTES + 100
    assert shown.width > 150


def test_the_page_is_small(whole):
    assert (whole / "report.html").stat().st_size < 4e6
    assert (12 + 3 * 8) * MOST_BYTES * 4 / 3 + 8 * 70_000 * 4 / 3 + 160_000 * 4 / 3 < 4e6


def test_left_and_right_hands_differ_and_filled_and_missing_are_marked():
    xy = np.zeros((133, 2)) + (20, 20)
    score = np.zeros(133)
    left, right, wrist = HANDS["left"].start + 4, HANDS["right"].start + 4, INDEX["right_wrist"]
    xy[left], xy[right], xy[wrist], xy[left + 4] = (100.5, 100.5), (200.5, 100.5), (200.5, 200.5), (100.5, 200.5)
    score[[left, right, wrist]] = 1
    filled = np.zeros(133, bool)
    filled[left + 4] = True

    def drawn(missing):
        image = np.zeros((640, 300, 3), np.uint8)
        draw_keypoints(image, xy, score, 0.2, filled, np.array(missing))
        return image

    image = drawn([False, False])
    assert tuple(image[100, 100]) == SIDE_COLOURS["left"] and tuple(image[100, 200]) == SIDE_COLOURS["right"]
    ring = image[194:208, 94:108].reshape(-1, 3).astype(float)
    assert tuple(image[200, 100]) == (0, 0, 0)
    brightest = ring[ring.sum(1).argmax()]
    assert np.allclose(brightest / brightest.max(), np.array(FILLED_COLOUR) / 255, atol=0.1) and brightest.max() > 100
    assert (drawn([False, True]) == MISSING_COLOUR).all(2)[190:211, 190:211].any()
    assert not (drawn([True, False]) == MISSING_COLOUR).all(2).any()


def test_alpha_mixes_frame_and_magenta():
    mixed = over_magenta(np.full((1, 3, 3), 100, np.uint8), np.array([[0.0, 0.5, 1.0]]))
    assert mixed[0].tolist() == [[255, 0, 255], [178, 50, 178], [100, 100, 100]]


@pytest.mark.parametrize(("metrics", "facts", "words"), [
    ({"psnr_fg": 25.0, "psnr_fg_train": 28.0}, {}, "better by 3.0 dB"),
    ({"psnr_fg": 25.0, "alpha_iou": 0.9}, {}, "alpha IoU 0.90"),
    ({}, {"left_hand_share": 0.0}, "left hand was never seen"),
    ({}, {"right_hand_share": 0.25, "right_hand_filled": 0.5}, "right hand was seen in 25%"),
    ({}, {"turn_degrees": 90.0}, "Only 90 of 360"),
    ({}, {"outline_iou": 0.5}, "badly"),
    ({}, {"face_share": 0.0}, "face was never seen"),
])
def test_each_weakness_has_its_sentence(metrics, facts, words):
    assert sum(words in sentence for sentence in weaknesses(metrics, facts)) == 1


def test_good_figures_have_no_weakness():
    good = {"psnr_fg": 31.0, "psnr_fg_train": 31.5, "psnr_fg_ttpo": 31.2, "alpha_iou": 0.99}
    assert weaknesses(good, {"turn_degrees": 360}) == []


def verdict(facts=None, **changes):
    """Grade of the whole and, by name, of the parts."""
    given = give_verdict({"likeness": LIKE, "seen_area": 0.97, "stray_alpha": 0.0, "torn_alpha": 0.001} | changes, facts or {})
    return given.grade, {part.name: part.grade for part in given.parts}


def test_the_verdict_has_parts_that_a_person_knows_each_with_a_grade_and_a_sentence(whole):
    assert verdict() == (Grade.FAIR, {"Body and clothes": Grade.GOOD, "Face": Grade.FAIR, "Hands": Grade.UNKNOWN,
                                      "Seen from all sides": Grade.GOOD, "In new poses": Grade.GOOD})
    text = Page(whole / "report.html").text("head")
    assert "~ Fair likeness Body good, face fair, seen from all sides good, in new poses good" in text
    assert "~ Fair Face Recognised from a few steps away" in text and "The frames show 97% of the body's surface." in text


def test_a_disfigured_face_or_an_unseen_side_is_never_called_good():
    assert verdict(likeness=GOOD_FACE)[0] is Grade.GOOD
    smeared = LIKE | {"face": LIKE["face"] | {"worst": 0.8}}
    assert verdict(likeness=smeared)[0] is Grade.FAIR
    assert verdict(likeness=GOOD_FACE, seen_area=0.45)[0] is Grade.FAIR
    assert verdict(torn_alpha=0.05)[1]["In new poses"] is Grade.POOR


def test_an_avatar_without_a_part_of_the_person_is_not_seen_from_all_sides_and_without_a_face_never_good():
    grade, parts = verdict(likeness=GOOD_FACE, unseen_parts=["left foot"])
    assert grade is Grade.GOOD and parts["Seen from all sides"] is Grade.FAIR
    grade, parts = verdict(likeness=GOOD_FACE | {"face": None}, unseen_parts=["head", "left foot"])
    assert grade is Grade.FAIR and parts["Seen from all sides"] is Grade.FAIR
    given = give_verdict({"seen_area": 0.93, "unseen_parts": ["head", "left foot"]}, {})
    assert ("The frames show 93% of the body's surface, but not the head, the left foot. The rest has the colours of what lies "
            "around it.") in [part.sentence for part in given.parts]


def test_decibel_of_the_mask_the_pose_or_the_size_and_the_number_of_gaussians_do_not_touch_the_verdict():
    low = {"psnr_fg": 19.8, "psnr_fg_ttpo": 21.0, "ssim": 0.8, "alpha_iou": 0.85, "image_size": [608, 1080]}
    assert verdict(**low, n_gaussians=100, unseen_gaussians=51) == verdict()


def test_footage_that_is_blurred_or_too_small_to_judge_by_is_not_called_good():
    assert verdict({"sharpness": 0.35})[0] is Grade.POOR
    assert verdict(likeness=GOOD_FACE | {"body": LIKE["body"] | {"px": 90}})[0] is Grade.FAIR


def test_without_held_out_frames_nothing_is_called_good():
    assert verdict(likeness=dict.fromkeys(LIKE))[0] is Grade.UNKNOWN
    assert give_verdict({}, {}).grade is Grade.UNKNOWN


@pytest.mark.parametrize(("metrics", "facts", "advice"), [
    ({}, {"turn_degrees": 18.0}, Advice.TURN), ({}, {"photos": 4.0, "turn_degrees": 90.0}, Advice.PHOTOS),
    ({}, {"feet_share": 0.0}, Advice.WHOLE), ({}, {"top_share": 0.4}, Advice.WHOLE), ({}, {"moved_frames": 5.0}, Advice.STILL),
    ({}, {"left_hand_share": 0.2}, Advice.HANDS), ({}, {"brightness": 0.05}, Advice.LIGHT),
    ({}, {"sharpness": 0.3}, Advice.SHARP), ({}, {"face_used": 0.0}, Advice.FACE), ({}, {"empty_masks": 1.0}, Advice.BACKGROUND),
    ({}, {"outline_iou": 0.6}, Advice.CLOTHES), ({}, {"person_share": 0.5}, Advice.ONE_PERSON),
    ({"likeness": {"face": {"px": 14.0}}}, {}, Advice.CLOSER),
])
def test_each_cause_has_one_instruction_for_the_next_clip(metrics, facts, advice):
    assert give_advice(metrics, facts) == [advice]
    assert give_advice({"likeness": LIKE}, {"turn_degrees": 360.0, "sharpness": 2.0}) == []


def test_who_is_to_step_back_is_not_told_to_come_closer():
    assert give_advice({"likeness": {"face": {"px": 14.0}}}, {"feet_share": 0.0}) == [Advice.WHOLE]


def test_a_camera_that_sways_and_a_person_cut_off_above_are_seen_in_the_pictures_and_told_to_mend(copied):
    noise = cv2.GaussianBlur(np.random.default_rng(2).normal(size=(HEIGHT + 40, WIDTH + 40)).astype(np.float32), (0, 0), 2)
    room = np.repeat(np.clip(128 + 45 * noise / noise.std(), 0, 255)[..., None], 3, 2).astype(np.uint8)
    for t in range(T):
        mask = np.zeros((HEIGHT, WIDTH), np.float32)
        mask[:120, 35:50] = 1
        frame = room[:HEIGHT, 3 * (t % 3):][:, :WIDTH]
        write_frame(copied / f"split/frames/{t:06d}.png", np.where(mask[..., None] > 0, np.uint8(90), frame))
        write_alpha(copied / f"segment/alpha/{t:06d}.exr", mask)
    write_run(copied, [stage_row(name) for name in STAGES])
    page = page_of(copied)
    assert Advice.STILL.value in page.text("head") and Advice.WHOLE.value in page.text("head")
    assert "Camera moved, among the frames shown 3 px" in page.text("alpha") and "top in 6 of 6" in page.text("alpha")


def test_before_a_plain_background_nothing_is_said_of_the_camera(whole):
    page = Page(whole / "report.html")
    assert Advice.STILL.value not in page.text() and Advice.WHOLE.value not in page.text()
    assert "Camera moved, among the frames shown not known: too plain a background" in page.text("alpha")


def test_what_stands_under_every_clip_is_a_note_and_no_warning(copied):
    rows = [stage_row(name) for name in STAGES]
    rows[5]["warnings"] = ["Frame 3 is odd."]
    rows[5]["notes"] = ["The clip carries no focal length; estimated 1246 px (set smplx.focal_px to fix it)."]
    write_run(copied, rows)
    text = page_of(copied).text("warnings")
    assert text.startswith("Warnings smplx Frame 3 is odd. Notes: true of every clip of one camera smplx The clip carries no focal")


def test_what_is_wrong_in_the_clip_stands_before_what_is_only_poorer(copied):
    rows = [stage_row(name) for name in STAGES]
    rows[1] |= {"warnings": ["A hand is unseen.", "An old warning."],
                "findings": [Finding.of(Code.HAND_NEVER_DETECTED, side="left").to_json()]}
    rows[3] |= {"warnings": ["The camera moves."], "findings": [Finding.of(Code.CAMERA_MOVES, np.ones(6, bool), 9.0).to_json()]}
    write_run(copied, rows)
    page = page_of(copied)
    assert page.text("warnings").startswith("Warnings segment The camera moves. keypoints A hand is unseen. keypoints An old")
    assert '<li class="wrong">' in page.html and '<li class="poorer">' in page.html


def test_the_avatar_stands_first_beside_the_verdict(whole):
    page = Page(whole / "report.html")
    assert [picture["alt"] for picture in page.images("head")] == ["The avatar in an A-pose, turning once"]
    assert page.html.index("The avatar in an A-pose") < page.html.index("Body and clothes") < page.html.index("Figures behind this")


def test_a_frame_s_number_leads_to_its_picture(copied):
    rows = [stage_row(name) for name in STAGES]
    rows[3]["warnings"] = ["No person is in 3 of 6 frames (0, 2-3); <b>."]
    write_run(copied, rows)
    html = page_of(copied).html
    assert 'frames (<a href="#alpha-0" title="picture of frame 0">0</a>, <a href="#alpha-2"' in html and "&lt;b&gt;" in html
    assert 'Held-out frame <a href="#heldout-4"' in html
    links = set(re.findall(r'href="#([a-z]+-\d+)"', html))
    assert links <= set(re.findall(r'<figure id="([a-z]+-\d+)"', html))


def test_no_picture_waits_to_be_loaded(whole):
    assert "lazy" not in Page(whole / "report.html").html


def test_a_curve_leaves_out_what_is_not_a_number():
    rows = [{"seconds": s, "loss": v} for s, v in ((1, 0.5), (2, float("nan")), (3, None), (4, 0.1), (5, 0.0))]
    assert curve_chart(rows, "loss", "Loss", "", log=True).count("<circle") == 2
    assert curve_chart(rows[:2], "loss", "Loss", "") is None


def test_times_and_sizes_read_well():
    assert [seconds(x) for x in (0.04, 59.96, 185.2, 3725, None)] == ["0.0 s", "1 min 00 s", "3 min 05 s", "1 h 02 min", "–"]
    assert [size(x) for x in (90, 1234, 123_456, 48_200_000, None)] == ["90 B", "1.2 kB", "123 kB", "48.2 MB", "–"]


def test_importing_the_report_loads_no_heavy_package():
    script = "import sys, gsac.pipeline.report; print([m for m in ('cv2', 'numba', 'torch', 'jinja2') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.strip() == "[]"


@pytest.mark.slow
@pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")
def test_nothing_overflows_on_a_phone_and_a_browser_finds_no_fault(whole):
    browser = chromium.Browser(360, 800)
    try:
        browser.resize(360, 800, mobile=True)
        browser.open((whole / "report.html").as_uri())
        browser.run("document.querySelectorAll('details').forEach(d => d.open = true)")
        assert browser.run("document.documentElement.scrollWidth") == 360
        assert browser.run("Promise.all([...document.images].map(i => i.decode().then(() => 1)))"
                           ".then(all => all.length)") > 20
        assert browser.run("document.querySelector('figure button').click(), document.querySelector('dialog').open")
        assert not browser.errors
        assert {address.partition(":")[0] for address in browser.requests} <= {"file", "data"}
    finally:
        browser.close()


@pytest.mark.slow
@pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_everybody_can_read_the_page_and_the_keyboard_alone_reaches_its_pictures(whole, axe, width, scheme):
    browser = chromium.Browser(width, 900)
    try:
        browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme},
                                                             {"name": "prefers-reduced-motion", "value": "reduce"}])
        browser.resize(width, 900, mobile=width < 500)
        browser.open((whole / "report.html").as_uri())
        browser.run("document.querySelectorAll('details').forEach(d => d.open = true)")
        assert browser.run("document.documentElement.scrollWidth") == width
        assert axe(browser) == []
        browser.run("document.querySelector('figure button[data-parts]').focus(), document.activeElement.click()")
        assert browser.run("document.querySelector('dialog').open && !document.querySelector('dialog label').hidden")
        assert browser.run("document.querySelectorAll('dialog img').length") == 2, "truth and render, one over the other"
        assert axe(browser) == []
        before = browser.run("document.querySelector('dialog .words').textContent")
        for kind in ("keyDown", "keyUp"):
            browser.call("Input.dispatchKeyEvent", type=kind, key="ArrowRight", code="ArrowRight", windowsVirtualKeyCode=39)
        assert browser.run("document.querySelector('dialog .words').textContent") != before
        for kind in ("keyDown", "keyUp"):
            browser.call("Input.dispatchKeyEvent", type=kind, key="Escape", code="Escape", windowsVirtualKeyCode=27)
        browser.until("!document.querySelector('dialog').open")
        assert browser.run("document.activeElement.matches('figure button')")
        assert not browser.errors
    finally:
        browser.close()


def test_two_runs_stand_side_by_side_with_the_parameters_that_differ(whole, copied, tmp_path):
    rows = [stage_row(name) for name in STAGES]
    rows[6] |= {"params": {"steps": 99, "seed": 0}}
    write_run(copied, rows, clip="/somewhere/private/<other>.mp4")
    out = tmp_path / "both.html"
    assert execute(["compare", str(whole), str(copied), "--out", str(out)]) == 0
    page = Page(out)
    assert "Parameters that differ" in page.text() and "train.steps 77 99" in page.text() and "train.seed" not in page.text()
    assert "turn.mp4" in page.text() and "<other>.mp4" in page.text() and "private" not in page.html
    assert page.text().count("~ Fair Face") == 2 and "26.54 dB 26.54 dB" in page.text()
    assert len(page.images("head")) == 2 * (1 + 2 + 1)


def test_compare_says_what_is_wrong_before_it_draws_and_writes_all_or_nothing(whole, copied, tmp_path, capsys, monkeypatch):
    def refused(*words):
        assert execute(["compare", str(whole), *map(str, words)]) == 2
        said = capsys.readouterr().err
        assert "draws the charts" not in said
        return said

    out = tmp_path / "both.html"
    out.write_text("mine")
    assert f"{out} is there already; give another --out, or --force" in refused(copied, "--out", out)
    assert "is a folder; give the name of a file" in refused(copied, "--out", tmp_path)
    assert "expected a file in a folder that exists" in refused(copied, "--out", tmp_path / "no" / "both.html")
    assert "nowhere: not the folder of a run" in refused(tmp_path / "nowhere")
    monkeypatch.setattr(os, "replace", full_disk)
    assert execute(["compare", str(whole), str(copied), "--out", str(out), "--force"]) != 0
    assert out.read_text() == "mine" and [path.name for path in tmp_path.glob("*both*")] == ["both.html"]


def full_disk(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_compare_names_the_command_that_brings_back_what_a_cache_has_lost(whole, copied, tmp_path, capsys):
    body = copied / "smplx" / "body.npz"
    body.unlink()
    body.symlink_to(tmp_path / "gone" / "objects" / "ab" / f"{'ab' * 32}.npz")
    assert execute(["compare", str(whole), str(copied), "--out", str(tmp_path / "both.html")]) == 2
    said = capsys.readouterr().err
    assert "brings them back" in said and "gsac run" in said and not (tmp_path / "both.html").exists()

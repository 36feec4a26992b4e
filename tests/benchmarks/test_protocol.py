"""Published protocols: what they fix is what is scored, and the command works on data that were imported."""

import json

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.pose_files.read import read_start
from gsac.benchmarks.protocol import table
from gsac.benchmarks.protocol.bench import main, number_test, parser, read_split, settings, take_poses
from gsac.benchmarks.protocol.protocols import PROTOCOLS
from gsac.cache.store import Store
from gsac.pipeline.data_sets.read import read_data_set
from gsac.pipeline.data_sets.write import write_clip
from gsac.pipeline.model_store import ModelStore
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.stages.contract import BadInput
from support import data_sets


def metrics(*psnr):
    shown = [{"psnr_full_black": p, "psnr_full": p + 1, "ssim": 0.9, "ssim_black": 0.95, "lpips_alex_black": 0.05,
              "psnr_full_ttpo": p + 3, "ssim_ttpo": 0.97, "lpips_alex_unscaled_ttpo": None} for p in psnr]
    return {"heldout": shown, "heldout_frames": list(range(len(psnr))), "recipe": "fast", "image_size": [1080, 1080]}


def test_ground_pose_and_pooling_are_the_protocols():
    found = metrics(20.0, 30.0, 20.0, 30.0, 40.0)
    pooled = -10 * np.log10((1e-2 + 1e-3) / 2)
    assert table.figures(found, PROTOCOLS["gsac"]) == pytest.approx(((pooled + 40) / 2, 0.95, 0.05))
    psnr, ssim, lpips = table.figures(found, PROTOCOLS["instant-avatar"])
    assert (psnr, ssim, lpips) == (pytest.approx(31.0), pytest.approx(0.97), None)
    assert table.mean_of_batches([20.0, 30.0], None) == pytest.approx(pooled)


def test_lpips_is_of_the_network_that_the_published_scorer_takes():
    # 3DGS-Avatar's own scorer for PeopleSnapshot takes Alex; that with VGG is for ZJU-MoCap.
    assert {name: protocol.lpips for name, protocol in PROTOCOLS.items()} == {
        "gsac": "lpips_alex_black", "haha": "lpips_alex_black", "instant-avatar": "lpips_alex_unscaled",
        "3dgs-avatar": "lpips_alex_black", "exavatar-xhumans": "lpips_alex", "exavatar-neuman": "lpips_alex"}


def test_our_row_stands_beside_the_published_ones_with_their_source():
    words = table.text({"female-4-casual": [metrics(28.0, 29.0), metrics(29.0, 30.0)]}, PROTOCOLS["gsac"])
    ours = next(line for line in words.splitlines() if "ours, recipe" in line)
    assert "2 seeds, 2 test frames" in ours and "+-" in ours
    assert any("28.950" in line and "GSAC's own table" in line for line in words.splitlines())
    assert "1080 px" in words and "on black" in words and "batches of 4" in words
    assert "Nothing was published of me" in table.text({"me": [metrics(28.0)]}, PROTOCOLS["gsac"])


def test_every_protocol_is_settings_that_the_stages_take(tmp_path):
    (tmp_path / "cameras.json").write_text(json.dumps({"width": 1080, "height": 1080, "focal": [2000, 2200]}))
    for protocol in PROTOCOLS.values():
        configs = resolve(Project.at_hand(), sets=settings(tmp_path, {"fps": 25.0}, protocol))
        assert (configs["split"].max_height, configs["split"].count) == (protocol.height, None)
        assert configs["smplx"].focal_px == pytest.approx(2100 * (protocol.height or 1080) / 1080)
        assert configs["segment"].method == "brought" and configs["split"].photo_fps == 25


def test_test_frames_are_numbered_as_split_numbers_them_and_a_folder_without_a_split_is_named(tmp_path):
    assert number_test({"train": ["000000", "000004", "000012"], "test": ["000008", "000016"]}) == "2,4"
    assert number_test({"train": ["999999", "1000001"], "test": ["1000000"]}) == "1"
    with pytest.raises(BadInput, match=r"split.json: is missing"):
        read_split(tmp_path)
    (tmp_path / "split.json").write_text(json.dumps({"fps": 30, "train": ["000000"], "test": []}))
    with pytest.raises(BadInput, match="names no frames to test"):
        read_split(tmp_path)
    assert parser().parse_args(["gsac", str(tmp_path)]).repeats == 5


@pytest.mark.parametrize("name", ["peoplesnapshot", "xhumans"])
def test_poses_that_came_with_the_data_take_the_place_of_the_body_fit_frame_by_frame(tmp_path, monkeypatch, name):
    pytest.importorskip("h5py")
    monkeypatch.setenv("GSAC_CACHE", str(tmp_path / "cache"))
    clip, = read_data_set(name, getattr(data_sets, name)(tmp_path / "in"))
    write_clip(clip, tmp_path / clip.name)
    configs = resolve(Project.at_hand(), sets=take_poses(tmp_path / clip.name))
    start = read_start(ModelStore(Store.open()).path(configs["smplx"].start), len(clip.numbers))
    given = np.load(tmp_path / clip.name / "poses.npz")
    root = given["pose"][:, :3] if name == "peoplesnapshot" else given["global_orient"]
    np.testing.assert_allclose(start.rotations[:, 0], rotation.exp(root), atol=1e-6)
    assert configs["smplx"].method == "brought" and start.given.all() and np.isfinite(start.rotations[:, :22]).all()


def test_data_without_poses_are_named(tmp_path):
    with pytest.raises(BadInput, match=r"poses.npz: is missing; no poses came with these data, use --poses fitted"):
        take_poses(tmp_path)


@pytest.mark.parametrize(("content", "said"), [("{", "not readable as JSON"), ("[]", "not what .* expected fps, train, test"),
                                                ('{"train": ["000000"]}', "not what .* expected fps, train, test")])
def test_a_damaged_split_is_named_before_a_training(tmp_path, content, said):
    (tmp_path / "split.json").write_text(content)
    with pytest.raises(BadInput, match=rf"split.json: is {said}"):
        main(["gsac", str(tmp_path)])


def test_no_repeats_and_two_subjects_of_one_name_are_refused(tmp_path):
    with pytest.raises(BadInput, match="--repeats 0: expected 1 or more"):
        main(["gsac", str(tmp_path), "--repeats", "0"])
    with pytest.raises(BadInput, match="two folders are called me"):
        main(["gsac", str(tmp_path / "a/me"), str(tmp_path / "b/me")])


@pytest.mark.slow
def test_a_miniature_data_set_goes_from_import_to_the_table(tmp_path, capsys):
    import av
    import cv2

    from gsac.pipeline.cli import execute
    from gsac.turntable.clip import make_clip

    make_clip(tmp_path / "truth", seed=1, frames=6, height=240)
    source = tmp_path / "in" / "female-4-casual"
    for part in "images", "masks":
        (source / part).mkdir(parents=True)
    with av.open(str(tmp_path / "truth/clip.mp4")) as film:
        for t, frame in enumerate(film.decode(video=0)):
            cv2.imwrite(str(source / f"images/{t:05d}.png"), frame.to_ndarray(format="bgr24"))
            (tmp_path / f"truth/mask/{t:06d}.png").rename(source / f"masks/{t:05d}.png")
    (source / "test_split.txt").write_text("00005.png\n")
    assert execute(["data", "import", "folder", str(source), "--out", str(tmp_path / "data")]) == 0
    assert main(["gsac", str(tmp_path / "data/female-4-casual"), "--steps", "20", "--gaussians", "300", "--repeats", "1",
                 "--out", str(tmp_path / "out")]) == 0
    words = capsys.readouterr().out
    assert "1 test frames at 240 px" in words and "28.950" in words
    found = json.loads((tmp_path / "out/trainings/female-4-casual_gsac_0/metrics.json").read_text())
    assert found["heldout_frames"] == [5] and found["trained_frames"] == 5
    clip = json.loads((tmp_path / "out/runs/female-4-casual_gsac/split/clip.json").read_text())
    assert clip["timestamps_s"] == pytest.approx([t / 30 for t in range(6)], abs=1e-6)

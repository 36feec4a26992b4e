"""Data sets in their own layouts become folders that a run takes, and a missing or misnamed file is named."""

import sys

import cv2
import numpy as np
import pytest

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.frame_files import read_alpha, read_frame
from gsac.pipeline.cli import execute
from gsac.pipeline.data_sets.read import read_data_set
from gsac.pipeline.data_sets.write import write_clip
from gsac.stages.contract import BadInput, Job
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.stage import run
from support import data_sets
from support.data_sets import CENTER, FOCAL, picture, read_json


def brought(name, path, out):
    """Folder of the one clip."""
    clip, = read_data_set(name, path)
    write_clip(clip, out / clip.name)
    return out / clip.name


def same_frame(folder, name, t):
    rgb, mask = picture(t)
    np.testing.assert_allclose(read_frame(folder / f"{name}.png"), rgb, atol=2)  # as a video holds it
    np.testing.assert_array_equal(cv2.imread(str(folder / "masks" / f"{name}.png"), -1), mask * np.uint8(255))


@pytest.mark.parametrize("protocol", [2, 4, 5])
def test_peoplesnapshot_comes_with_masks_camera_poses_and_the_published_split(tmp_path, protocol):
    pytest.importorskip("h5py")
    folder = brought("peoplesnapshot", data_sets.peoplesnapshot(tmp_path / "in", protocol=protocol), tmp_path / "out")
    split = read_json(folder / "split.json")
    assert split["train"] == [f"{t:06d}" for t in range(0, 336, 4)] and len(split["train"]) == 84
    assert split["test"] == [f"{t:06d}" for t in range(335, 350, 4)]
    assert split["fps"] == 30
    assert len(frame_paths(folder)) == len(list((folder / "masks").iterdir())) == 84 + 4
    same_frame(folder, "000008", 8)
    same_frame(folder, "000339", 339)
    camera = read_json(folder / "cameras.json")
    assert camera["focal"] == [FOCAL, FOCAL] and camera["center"] == list(CENTER) and camera["width"] == 48
    poses = np.load(folder / "poses.npz")
    assert poses["pose"].shape == (88, 72) and poses["pose"][1, 0] == 4 and poses["pose"][-1, 0] == 347
    assert "Alldieck" in (folder / "NOTICE.txt").read_text()


def test_xhumans_keeps_its_takes_apart_and_turns_poses_into_the_camera(tmp_path):
    folder = brought("xhumans", data_sets.xhumans(tmp_path / "in"), tmp_path / "out")
    split = read_json(folder / "split.json")
    assert split["train"] == ["000001", "000002", "000003", "001004", "001005"] and split["test"] == ["002006", "002007"]
    assert split["sources"]["001004"] == "train/Take2/render/image/color_000001.png"
    same_frame(folder, "001005", 2)
    poses = np.load(folder / "poses.npz")
    np.testing.assert_allclose(poses["global_orient"][3], [0, 0.3, 0], atol=1e-9)
    assert poses["body_pose"][:, 0].tolist() == [1, 2, 3, 1, 2, 1, 2] and "transl" not in poses
    assert read_json(folder / "cameras.json")["extrinsics"]["000002"][2][3] == 3


def test_of_the_subjects_of_haha_the_two_takes_that_it_names_are_read(tmp_path):
    takes = [("train", "Take4", 1), ("train", "Take5", 1), ("test", "Take6", 1), ("test", "Take9", 1)]
    folder = brought("xhumans", data_sets.xhumans(tmp_path / "in", "00016", takes), tmp_path / "out")
    assert sorted(read_json(folder / "split.json")["sources"].values()) == [
        "test/Take6/render/image/color_000001.png", "train/Take4/render/image/color_000001.png"]


def test_neuman_comes_with_colmaps_cameras_and_its_split_without_the_validation_frames(tmp_path):
    folder = brought("neuman", data_sets.neuman(tmp_path / "in"), tmp_path / "out")
    split = read_json(folder / "split.json")
    assert split["train"] == ["000000", "000001", "000002", "000003"] and split["test"] == ["000004"]
    same_frame(folder, "000003", 3)
    turn = np.array(read_json(folder / "cameras.json")["extrinsics"]["000002"])
    np.testing.assert_allclose(turn, [[0, 0, 1, 0.5], [0, 1, 0, 0], [-1, 0, 0, 2]], atol=1e-8)


def test_what_was_imported_goes_through_split_with_its_masks_and_times(tmp_path):
    folder = brought("xhumans", data_sets.xhumans(tmp_path / "in"), tmp_path / "out")
    (tmp_path / "split").mkdir()
    run(Job({"clip": folder}, tmp_path / "split", SplitConfig(count=None, photo_fps=30)))
    for t, of in enumerate((1, 2, 3, 1, 2, 1, 2)):
        alpha = read_alpha(tmp_path / f"split/frames/masks/{t:06d}.exr")
        np.testing.assert_array_equal(alpha, picture(of)[1])
    times = np.array(Clip.read(tmp_path / "split/clip.json").timestamps_s)
    np.testing.assert_allclose(np.diff(times) * 30, [1, 1, 1001, 1, 1001, 1], atol=1e-3)


def test_a_folder_of_images_and_masks_is_taken_with_its_split(tmp_path):
    folder = brought("folder", data_sets.plain_folder(tmp_path / "in"), tmp_path / "out")
    assert read_json(folder / "split.json")["test"] == ["000004"]
    same_frame(folder, "000002", 2)


@pytest.mark.parametrize("masked", [True, False])
def test_a_plain_folder_of_frames_is_taken_with_or_without_masks_and_the_command_says_which(tmp_path, capsys, masked):
    source = data_sets.plain_folder(tmp_path / "in")
    for image in (source / "images").iterdir():
        image.rename(source / image.name)
    (source / "images").rmdir()
    if not masked:
        (source / "masks").rename(tmp_path / "elsewhere")
    assert execute(["data", "import", "folder", str(source), "--out", str(tmp_path / "out")]) == 0
    said, folder = "".join(capsys.readouterr()), tmp_path / "out" / "mine"
    assert ("5 frames with masks, 1" in said) == ("segment.method=brought" in said) == masked
    assert ("5 frames without masks, which stage segment will make, 1 of them to test" in said) is not masked
    assert len(frame_paths(folder)) == 5 and (folder / "masks").is_dir() == masked
    if masked:
        same_frame(folder, "000002", 2)
    np.testing.assert_allclose(read_frame(folder / "000003.png"), picture(3)[0], atol=2)


def test_the_command_imports_every_subject_of_a_folder_and_tells_how_to_run_it(tmp_path, capsys):
    for scene in "bike", "lab":
        data_sets.neuman(tmp_path / "in", scene)
    assert execute(["data", "import", "neuman", str(tmp_path / "in"), "--out", str(tmp_path / "out")]) == 0
    said = "".join(capsys.readouterr())
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["bike", "lab"]
    assert "5 frames with masks, 1 of them to test" in said and "split.photo_fps=30" in said
    assert execute(["data", "import", "neuman", str(tmp_path / "in"), "--out", str(tmp_path / "out")]) != 0
    assert "there already" in "".join(capsys.readouterr())


def test_an_import_that_broke_off_goes_on_with_the_subjects_that_lack(tmp_path, capsys):
    for scene in "bike", "my lab":
        data_sets.neuman(tmp_path / "in", scene)
    typed = ["data", "import", "neuman", str(tmp_path / "in"), "--out", str(tmp_path / "out")]
    (tmp_path / "in/my lab/images").rename(tmp_path / "in/my lab/misnamed")
    assert execute(typed) == 0  # of the one scene that is whole
    (tmp_path / "in/my lab/misnamed").rename(tmp_path / "in/my lab/images")
    assert execute(typed) == 0
    said = "".join(capsys.readouterr())
    assert "bike is there already and left as it is" in said and f"gsac run '{tmp_path}/out/my lab' --set" in said
    assert read_json(tmp_path / "out/my lab/split.json")["test"] == ["000004"]


MISSING = {
    "neuman": ["images", "segmentations/00002.png", "sparse/images.txt", "test_split.txt"],
    "xhumans": ["test", "train/Take1/render/depth/depth_000002.tiff", "train/Take2/render/cameras.npz",
                "test/Take3/SMPLX/mesh-f00001_smplx.pkl"],
    "plain_folder": ["images", "masks/frame_0003.png"],
    "peoplesnapshot": ["masks.hdf5", "camera.pkl", "female-4-casual.mp4"],
}


@pytest.mark.parametrize("name, file", [(name, file) for name, files in MISSING.items() for file in files])
def test_a_missing_or_misnamed_file_is_named_and_nothing_is_left(tmp_path, name, file):
    if name == "peoplesnapshot":
        pytest.importorskip("h5py")
    folder = getattr(data_sets, name)(tmp_path / "in", **({"frames": 6} if name == "peoplesnapshot" else {}))
    (folder / file).rename((folder / file).with_name("misnamed"))
    with pytest.raises(BadInput, match=rf"(?s){(folder / file).name}.*expected.*misnamed"):
        brought(name.removeprefix("plain_"), folder, tmp_path / "out")
    assert not list((tmp_path / "out").glob("*")) if (tmp_path / "out").exists() else True


def test_masks_of_another_subject_are_refused(tmp_path):
    h5py = pytest.importorskip("h5py")
    folder = data_sets.peoplesnapshot(tmp_path / "in", frames=8)
    for name in "masks.hdf5", "reconstructed_poses.hdf5":
        (folder / name).unlink()
    with h5py.File(folder / "masks.hdf5", "w") as file:
        file["masks"] = np.ones((5, 64, 48), np.uint8)
    with pytest.raises(BadInput, match=r"8 frames, masks.hdf5 5"):
        brought("peoplesnapshot", folder, tmp_path / "out")


def test_without_h5py_its_package_is_named(tmp_path, monkeypatch):
    from gsac.pipeline.data_sets.hdf5 import read_hdf5

    (tmp_path / "masks.hdf5").write_bytes(b"")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(BadInput, match=r"h5py.*gsac\[data\]"):
        read_hdf5(tmp_path / "masks.hdf5", "masks")


@pytest.mark.parametrize("how", ["link", "storage", "group"])
def test_hdf5_that_reaches_into_another_file_is_refused(tmp_path, how):
    h5py = pytest.importorskip("h5py")
    from gsac.pipeline.data_sets.hdf5 import read_hdf5

    (tmp_path / "secret").write_bytes(b"secret" * 4)
    with h5py.File(tmp_path / "other.hdf5", "w") as other:
        other["masks"] = np.ones(3)
    with h5py.File(tmp_path / "masks.hdf5", "w") as file:
        if how == "link":
            file["masks"] = h5py.ExternalLink(str(tmp_path / "other.hdf5"), "masks")
        elif how == "storage":
            file.create_dataset("masks", (6,), "u1", external=[(str(tmp_path / "secret"), 0, 6)])
        else:
            file.create_group("masks")
    with pytest.raises(BadInput, match=r"masks.hdf5: masks is no array of this file"):
        read_hdf5(tmp_path / "masks.hdf5", "masks")


def test_frames_without_leading_zeros_keep_their_order(tmp_path):
    source = data_sets.plain_folder(tmp_path / "in", frames=12, test=())
    (source / "test_split.txt").unlink()
    for file in [*source.rglob("*.png")]:
        file.rename(file.with_name(f"{int(file.stem[-4:])}.png"))
    folder = brought("folder", source, tmp_path / "out")
    assert read_json(folder / "split.json")["sources"]["000002"] == "2.png"
    for t in range(12):
        same_frame(folder, f"{t:06d}", t)


def test_a_split_names_a_frame_a_line_spaces_in_the_name_and_all(tmp_path):
    source = data_sets.plain_folder(tmp_path / "in", test=())
    for part in "images", "masks":
        (source / part / "frame_0004.png").rename(source / part / "my frame 0004.png")
    (source / "test_split.txt").write_text("my frame 0004.png\r\nmy frame 0004.png\r\n", "utf-8-sig")  # as Windows saves it
    assert read_json(brought("folder", source, tmp_path / "out") / "split.json")["test"] == ["000004"]


@pytest.mark.parametrize("content, said", [(b"", "names no frame"), (b"\xff\xfe0\x00", "no text in UTF-8"),
                                           (b"00009.png\n", "names 00009.png, which is not in images")])
@pytest.mark.parametrize("name", ["neuman", "plain_folder"])
def test_a_damaged_split_is_named(tmp_path, name, content, said):
    source = getattr(data_sets, name)(tmp_path / "in")
    (source / "test_split.txt").write_bytes(content)
    with pytest.raises(BadInput, match=rf"test_split.txt: .*{said}"):
        brought(name.removeprefix("plain_"), source, tmp_path / "out")


def test_a_folders_masks_are_read_as_masks_of_ones_own_are(tmp_path):
    source = data_sets.plain_folder(tmp_path / "in")
    mask = picture(2)[1]
    cv2.imwrite(str(source / "masks/frame_0002.png"), mask.astype(np.uint16) * 65535)
    cv2.imwrite(str(source / "masks/frame_0001.png"), np.dstack([np.zeros((*mask.shape, 3)), picture(1)[1] * 255]).astype(np.uint8))
    folder = brought("folder", source, tmp_path / "out")
    same_frame(folder, "000001", 1)
    same_frame(folder, "000002", 2)
    cv2.imwrite(str(source / "masks/frame_0003.png"), np.dstack([mask * 0, mask * 0, mask * 255]).astype(np.uint8))
    with pytest.raises(BadInput, match=r"mine/masks/frame_0003.png: is coloured"):
        brought("folder", source, tmp_path / "again")


def test_a_mask_of_neuman_that_has_16_bits_is_refused(tmp_path):
    source = data_sets.neuman(tmp_path / "in")
    cv2.imwrite(str(source / "segmentations/00002.png"), np.zeros((64, 48), np.uint16))
    with pytest.raises(BadInput, match=r"segmentations/00002.png: has 16 bits a pixel; expected 8, 0 where the person is"):
        brought("neuman", source, tmp_path / "out")


def test_a_camera_that_is_not_finite_is_named(tmp_path):
    scene = data_sets.neuman(tmp_path / "in")
    images = (scene / "sparse/images.txt").read_text()
    (scene / "sparse/images.txt").write_text(images.replace("0.5 0 3 1 00003.png", "nan 0 3 1 00003.png"))
    with pytest.raises(BadInput, match=r"images.txt: the camera of 00003.png has a number that is not finite"):
        brought("neuman", scene, tmp_path / "out")
    (scene / "sparse/images.txt").write_text(images)
    (scene / "sparse/cameras.txt").write_text("1 PINHOLE 48 64 inf 90 24 32\n")
    with pytest.raises(BadInput, match=r"cameras.txt: has focal lengths \(inf, 90.0\)"):
        brought("neuman", scene, tmp_path / "out")
    take = data_sets.xhumans(tmp_path / "in") / "train/Take1/render/cameras.npz"
    with np.load(take) as arrays:
        known = dict(arrays)
    np.savez(take, **known | {"extrinsic": known["extrinsic"] * np.nan})
    with pytest.raises(BadInput, match=r"Take1/render/cameras.npz: extrinsic has a number that is not finite"):
        brought("xhumans", tmp_path / "in/00099", tmp_path / "out")

"""gsac render by its command line, on the small figure of the export's tests."""

import json
import sys

import numpy as np
import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.pipeline.cli import execute
from support import dances
from support.figure import make_figure


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run's folder with avatar.gsac, and in it a walk to the left as Mixamo would name and measure it, z up."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "export").mkdir()
    figure = make_figure()
    (folder / "export" / "avatar.gsac").write_bytes(avatar_bytes(figure))
    clip = figure.clips["walk"]
    rotation = np.zeros((len(clip.rotation), len(figure.joints), 3), np.float32)
    rotation[:, [figure.joint_names.index(name) for name in clip.joints]] = clip.rotation
    skeleton = dances.Skeleton(figure.joint_names, figure.parents, figure.joints)
    walk = dances.Motion(clip.fps, rotation, clip.transl)
    names = [dances.mixamo(n) for n in figure.joint_names]
    (folder / "walk.bvh").write_text(dances.bvh_text(skeleton, walk, names, unit=100, world=dances.Z_UP))
    rotation = np.zeros((5, len(figure.joints), 3), np.float32)
    spread = dances.Motion(clip.fps, rotation, np.zeros((5, 3), np.float32))
    (folder / "spread.bvh").write_text(dances.bvh_text(skeleton, spread, names, unit=100, world=dances.Z_UP))
    return folder


def film(path):
    av = pytest.importorskip("av")
    with av.open(str(path)) as file:
        return np.stack([f.to_ndarray(format="rgb24") for f in file.decode(video=0)]).astype(float)


def render(capsys, *words):
    code = execute(["render", *map(str, words)])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_without_a_motion_the_avatar_turns_once(run, tmp_path, capsys):
    code, out, _ = render(capsys, run, "--out", tmp_path / "turn.mp4", "--size", "96x128", "--seconds", 1, "--fps", 8, "--json")
    answer = json.loads(out.splitlines()[-1])
    assert code == 0 and answer["outputs"] == {"video": str(tmp_path / "turn.mp4")} and answer["metrics"]["frames"] == 8
    seen = film(tmp_path / "turn.mp4")
    assert seen.shape == (8, 128, 96, 3) and np.abs(seen[0] - seen[4]).mean() > 2


def test_a_walk_from_another_tool_is_the_walk_that_the_avatar_carries(run, tmp_path, capsys):
    for name, asked in (("own", "walk"), ("bvh", run / "walk.bvh")):
        code, out, _ = render(capsys, run / "export" / "avatar.gsac", "--motion", asked, "--out", tmp_path / f"{name}.mp4",
                              "--size", "96x128", "--fps", 20, "--background", "000000")
        assert (code, out) == (0, f"{tmp_path / name}.mp4\n")
    own, other = film(tmp_path / "own.mp4"), film(tmp_path / "bvh.mp4")
    assert len(own) == len(other) + 1, "its own clip closes its loop"
    difference = np.abs(own[:-1] - other).mean()
    assert difference < 2.5, "the first frame of a motion faces us, the own clip's is turned by 4 degrees"
    assert difference < 0.4 * np.abs(own[:-1, :, ::-1] - other).mean(), "not mirrored"
    assert difference < 0.5 * np.abs(np.roll(own[:-1], 11, 0) - other).mean(), "the same foot goes first"


@pytest.mark.parametrize(("words", "named"), [
    (["--size", "97x128"], "--size 97x128"), (["--size", "big"], "--size big"), (["--fps", "0"], "--fps 0"),
    (["--seconds", "-1"], "--seconds -1"), (["--background", "blue"], "--background blue"),
    (["--floor", "wood"], "--floor wood"), (["--yaw", "nan"], "--yaw nan"),
    (["--yaw", "90"], "--yaw 90: goes with --motion alone"),
    (["--out", "clip.avi"], "clip.avi"), (["--motion", "jump"], "jump: no such file, and the avatar's clips are: wave, walk"),
    (["--motion", "wlk"], "wlk: no such file (did you mean walk?)")])
def test_a_wrong_word_is_named_and_what_is_expected(run, tmp_path, capsys, monkeypatch, words, named):
    monkeypatch.chdir(tmp_path)
    code, _, err = render(capsys, run, *words)
    assert code == 2 and named in err
    assert list(tmp_path.iterdir()) == []


def last_frame(path):
    """(H, W, 4) of a file with transparency, by a reader that is not ours."""
    from PIL import Image, ImageSequence

    if path.suffix == ".gif":
        with Image.open(path) as image:
            return np.asarray([frame.convert("RGBA") for frame in ImageSequence.Iterator(image)][-1])
    av = pytest.importorskip("av")
    with av.open(str(path)) as file:
        decoder = av.CodecContext.create("libvpx-vp9", "r") if path.suffix == ".webm" else file.streams.video[0]
        frames = [f for packet in file.demux(video=0) if packet.size for f in decoder.decode(packet)]
        return frames[-1].to_ndarray(format="rgba")


@pytest.mark.parametrize("name", ["turn.webm", "turn.mov", "turn.gif"])
def test_a_film_without_a_background_is_transparent_round_the_figure(run, tmp_path, capsys, name):
    code, _, _ = render(capsys, run, "--out", tmp_path / name, "--size", "96x128", "--seconds", 0.5, "--fps", 8, "--background",
                        "none", "--no-shadow")
    image = last_frame(tmp_path / name)
    assert code == 0 and image.shape == (128, 96, 4)
    assert image[:3, :, 3].max() < 12 and (image[..., 3] > 240).mean() > 0.05


def test_unless_told_the_picture_is_as_wide_as_the_motion_needs(run, tmp_path, capsys):
    for words, wide in ((["--seconds", 0.1], False), (["--motion", run / "spread.bvh"], True)):
        code, out, _ = render(capsys, run, *words, "--fps", 4, "--out", tmp_path / str(wide), "--json")
        made = json.loads(out.splitlines()[-1])["metrics"]
        assert code == 0 and made["height"] == 960 and (720 < made["width"] <= 1280 if wide else made["width"] == 720)


def test_a_floor_is_drawn_where_it_is_asked_for(run, tmp_path, capsys):
    from PIL import Image

    code, _, _ = render(capsys, run, "--out", tmp_path / "frames", "--size", "96x128", "--seconds", 0.1, "--fps", 8, "--floor",
                        "ff0000")
    image = np.asarray(Image.open(tmp_path / "frames" / "000000.png")).astype(int)
    assert code == 0 and image[-1, 2, 0] > 200 > 60 > image[-1, 2, 2] and tuple(image[0, 2]) == (0x2B, 0x30, 0x3B)


def test_pictures_go_to_a_new_folder_and_never_over_what_is_there(run, tmp_path, capsys):
    words = ("--size", "96x128", "--seconds", 0.5, "--fps", 8, "--background", "none")
    code, out, _ = render(capsys, run, "--out", tmp_path / "frames", *words)
    assert (code, out) == (0, f"{tmp_path / 'frames'}\n")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["frames"]
    assert sorted(p.name for p in (tmp_path / "frames").iterdir()) == [f"{k:06d}.png" for k in range(4)]
    from PIL import Image

    image = np.asarray(Image.open(tmp_path / "frames" / "000000.png"))
    soft = image[..., 3][(image[..., :3] < 8).all(-1)]
    assert image.shape == (128, 96, 4) and ((soft > 20) & (soft < 110)).sum() > 50, "the shadow is black and half there"
    code, _, err = render(capsys, run, "--out", tmp_path / "frames", *words)
    assert code == 2 and "new or empty folder" in err


def test_a_film_that_cannot_be_transparent_says_which_can(run, tmp_path, capsys):
    code, _, err = render(capsys, run, "--out", tmp_path / "a.mp4", "--background", "none")
    assert code == 2 and ".webm or .mov or .gif, or a folder" in err and list(tmp_path.iterdir()) == []


def test_a_damaged_motion_names_its_line_and_leaves_no_video(run, tmp_path, capsys):
    lines = (run / "walk.bvh").read_text().splitlines()
    lines[-2] = "1 2 x"
    (tmp_path / "odd.bvh").write_text("\n".join(lines))
    code, out, err = render(capsys, run, "--motion", tmp_path / "odd.bvh", "--out", tmp_path / "a.mp4", "--json")
    assert code == 2 and f"odd.bvh, line {len(lines) - 1}: 3 numbers" in err
    assert "odd.bvh" in json.loads(out.splitlines()[-1])["error"] and not (tmp_path / "a.mp4").exists()


def test_a_motion_that_cannot_be_read_is_refused_before_what_draws_is_loaded(run, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "gsac.avatar.film", None)
    (tmp_path / "junk.bvh").write_text("junk")
    for name, words in (("gone.bvh", "gone.bvh: no such file"), ("junk.bvh", "junk.bvh, line 1: 'junk'")):
        code, _, err = render(capsys, run, "--motion", tmp_path / name, "--out", tmp_path / "a.mp4")
        assert code == 2 and words in err and "starts" not in err


SMALL = ("--size", "16x16", "--seconds", 0.1, "--fps", 10)


@pytest.fixture
def footage(run, tmp_path, monkeypatch):
    """The figure as the avatar of a run on clip.mp4, all in the current folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "clip-avatar" / "export").mkdir(parents=True)
    (tmp_path / "clip-avatar" / "export" / "avatar.gsac").symlink_to(run / "export" / "avatar.gsac")
    (tmp_path / "clip.mp4").write_text("my footage")
    (tmp_path / "clip-avatar" / "clip").symlink_to(tmp_path / "clip.mp4")
    return tmp_path


def test_without_out_the_video_is_named_after_avatar_and_motion(run, footage, capsys):
    (footage / "me.gsac").symlink_to(run / "export" / "avatar.gsac")
    for words, name in ((["clip-avatar"], "clip-avatar-turn"), (["clip-avatar", "--motion", "wave"], "clip-avatar-wave"),
                        (["clip-avatar/export", "--motion", run / "walk.bvh"], "clip-avatar-walk"), (["me.gsac"], "me-turn")):
        assert render(capsys, *words, *SMALL)[:2] == (0, f"{footage / name}.mp4\n")
    assert (footage / "clip.mp4").read_text() == "my footage"


def test_a_file_that_is_there_is_written_over_only_by_force(footage, capsys):
    (footage / "clip-avatar-turn.mp4").write_text("mine")
    code, _, err = render(capsys, "clip-avatar", *SMALL)
    assert code == 2 and "clip-avatar-turn.mp4 is there already" in err and "--force" in err
    assert (footage / "clip-avatar-turn.mp4").read_text() == "mine"
    assert render(capsys, "clip-avatar", *SMALL, "--force")[0] == 0
    assert len(film(footage / "clip-avatar-turn.mp4")) == 1


def test_the_clip_of_the_run_is_never_written_over_by_any_name_nor_by_force(footage, capsys):
    (footage / "other name.mp4").symlink_to("clip.mp4")
    (footage / "hard.mp4").hardlink_to(footage / "clip.mp4")
    for name in ("clip.mp4", "clip-avatar/../clip.mp4", "other name.mp4", "hard.mp4"):
        code, _, err = render(capsys, "clip-avatar", "--out", name, "--force", *SMALL)
        assert code == 2 and "the clip that" in err and "never written over" in err, name
    assert (footage / "clip.mp4").read_text() == (footage / "hard.mp4").read_text() == "my footage"


def test_a_folder_without_an_avatar_and_a_damaged_one_are_named(run, tmp_path, capsys):
    code, _, err = render(capsys, tmp_path)
    assert code == 2 and str(tmp_path) in err and "avatar.gsac" in err
    (tmp_path / "avatar.gsac").write_bytes((run / "export" / "avatar.gsac").read_bytes()[:999])
    code, _, err = render(capsys, tmp_path, "--out", tmp_path / "a.mp4")
    assert code == 2 and "truncated" in err

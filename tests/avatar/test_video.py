import numpy as np
import pytest

from gsac.avatar.video import Video, VideoError


def frame(k):
    """A bar that moves to the right over blue."""
    image = np.full((48, 64, 3), (20, 40, 200), np.uint8)
    image[:, 8 * k:8 * k + 8] = (240, 200, 30)
    return image


def test_another_program_reads_back_every_frame_with_its_colours_and_rate(tmp_path):
    av = pytest.importorskip("av")
    with Video(tmp_path / "a.mp4", 64, 48, 12.5) as video:
        for k in range(6):
            video.add(frame(k))
    with av.open(str(tmp_path / "a.mp4")) as file:
        assert float(file.streams.video[0].average_rate) == pytest.approx(12.5)
        read = [f.to_ndarray(format="rgb24").astype(float) for f in file.decode(video=0)]
    assert len(read) == 6
    for k, image in enumerate(read):
        assert np.abs(image - frame(k)).mean() < 6, k


def test_a_mov_is_prores_4444_and_keeps_colours_and_transparency_almost_as_they_are(tmp_path):
    av = pytest.importorskip("av")
    image = np.dstack([frame(2), np.linspace(0, 255, 64 * 48).reshape(48, 64).astype(np.uint8)])
    for alpha in (True, False):
        with Video(tmp_path / "a.mov", 64, 48, 25, alpha) as video:
            video.add(image[..., :4 if alpha else 3])
        with av.open(str(tmp_path / "a.mov")) as file:
            assert (file.streams.video[0].codec_context.codec_tag, file.streams.video[0].format.name[:7]) == (
                "ap4h", "yuva444" if alpha else "yuv444p")
            (read,) = (f.to_ndarray(format="rgba").astype(float) for f in file.decode(video=0))
        assert np.abs(read[..., :3] - image[..., :3]).mean() < 3
        assert np.abs(read[..., 3] - (image[..., 3] if alpha else 255)).max() <= 1


@pytest.mark.parametrize("suffix", ["mp4", "mov"])
def test_the_same_frames_give_the_same_bytes(tmp_path, suffix):
    for name in ("a", "b"):
        with Video(tmp_path / f"{name}.{suffix}", 64, 48, 10) as video:
            video.add(frame(0))
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()


def test_an_error_in_between_leaves_the_old_file_and_no_other(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"old")
    with pytest.raises(KeyError), Video(tmp_path / "a.mp4", 64, 48, 10) as video:
        video.add(frame(0))
        raise KeyError
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"] and (tmp_path / "a.mp4").read_bytes() == b"old"


def test_what_cannot_be_written_is_named(tmp_path):
    with pytest.raises(VideoError, match=r"gone.a\.mp4"), Video(tmp_path / "gone" / "a.mp4", 64, 48, 10) as video:
        for k in range(7):
            video.add(frame(k))

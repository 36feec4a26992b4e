"""split on videos: made here with the ffmpeg program, and the odd ones of the footage."""

import filecmp
import subprocess
import zlib
from pathlib import Path

import av
import cv2
import imageio_ffmpeg
import numpy as np
import pillow_heif
import pytest
from PIL import Image

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.frame_files import read_frame
from gsac.stages.contract import BadInput, Job
from gsac.stages.split import writing
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.stage import run

FOOTAGE = Path(__file__).parents[4] / "shared" / "footage"


def ffmpeg(*arguments):
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error", *map(str, arguments)], check=True)


def make_clip(path, *encode, size="160x120", rate=30, seconds=1.0, filters=None):
    more = ["-vf", filters] if filters else []
    ffmpeg("-f", "lavfi", "-i", f"testsrc=size={size}:rate={rate}:duration={seconds}", *more, *encode, path)
    return path


def split(source, out, **config):
    warnings = []
    out.mkdir()
    run(Job({"clip": source}, out, SplitConfig(**config), warn=lambda finding: warnings.append(finding.message)))
    clip = Clip.read(out / "clip.json")
    frames = frame_paths(out / "frames")
    assert [p.stem for p in frames] == [f"{i:06d}" for i in range(len(frames))]
    assert {read_frame(p).shape for p in frames} == {(clip.height, clip.width, 3)}
    assert clip.timestamps_s is None or len(clip.timestamps_s) == len(frames)
    return clip, [read_frame(p) for p in frames], warnings


def footage(name):
    path = FOOTAGE / name
    if not path.exists():
        pytest.skip(f"footage {name} is not here")
    return path


@pytest.mark.footage
def test_a_rotation_tag_turns_the_picture(tmp_path):
    source = footage("odd-video/rot90.mp4")
    clip, frames, warnings = split(source, tmp_path / "out", fps=None)
    assert (clip.width, clip.height, len(frames), warnings) == (180, 320, 60, [])
    reader = cv2.VideoCapture(str(source))
    reader.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
    upright = cv2.cvtColor(reader.read()[1], cv2.COLOR_BGR2RGB)
    assert np.abs(frames[0].astype(int) - upright).mean() < 3


@pytest.mark.footage
def test_variable_rate_keeps_true_timestamps(tmp_path):
    source = footage("odd-video/vfr.mp4")
    clip, frames, _ = split(source, tmp_path / "out", fps=None)
    with av.open(str(source)) as container:
        truth = [float(frame.pts * frame.time_base) for frame in container.decode(video=0)]
    assert len(set(np.round(np.diff(truth), 3))) > 1
    assert clip.timestamps_s == pytest.approx(np.array(truth) - truth[0], abs=1e-9)


def test_target_rate_and_count_choose_frames_evenly_in_time(tmp_path):
    source = make_clip(tmp_path / "a.mp4", seconds=2)
    clip, frames, _ = split(source, tmp_path / "rate", fps=10)
    assert len(frames) == 20 and clip.timestamps_s == pytest.approx(np.arange(20) / 10, abs=1e-6)
    assert clip.fps == pytest.approx(30)
    clip, frames, _ = split(source, tmp_path / "count", count=5)
    assert len(frames) == 5 and clip.timestamps_s[-1] == pytest.approx(59 / 30)
    _, every, _ = split(source, tmp_path / "every", fps=None, count=None)
    assert len(every) == 60 and np.array_equal(every[-1], frames[-1]) and np.array_equal(every[0], frames[0])


def test_same_input_gives_same_bytes(tmp_path):
    source = make_clip(tmp_path / "a.mp4")
    renamed = tmp_path / "b.mp4"
    renamed.write_bytes(source.read_bytes())
    split(source, tmp_path / "1")
    split(renamed, tmp_path / "2")
    files = sorted(str(p.relative_to(tmp_path / "1")) for p in (tmp_path / "1").rglob("*") if p.is_file())
    assert filecmp.cmpfiles(tmp_path / "1", tmp_path / "2", files, shallow=False) == (files, [], [])


@pytest.mark.parametrize("transfer", ["arib-std-b67", "smpte2084"])
def test_ten_bit_hdr_is_tone_mapped_to_what_sdr_shows(tmp_path, transfer):
    below_the_knee = "hue=s=0.4,format=rgb24,lutrgb=r=val*0.8:g=val*0.8:b=val*0.8"
    plain = make_clip(tmp_path / "sdr.png", "-frames:v", "1", filters=below_the_knee)
    to_hdr = (f"{below_the_knee},format=gbrp,setparams=color_trc=bt709:color_primaries=bt709:colorspace=gbr:range=pc,"
              "zscale=t=linear:npl=203,format=gbrpf32le,zscale=p=bt2020,"
              f"zscale=t={transfer}:m=bt2020nc:r=limited:npl=203,format=yuv420p10le")
    hdr = make_clip(tmp_path / "hdr.mp4", "-c:v", "libx265", "-x265-params", "log-level=error:crf=8", "-tag:v", "hvc1",
                  filters=to_hdr, seconds=0.2)
    clip, frames, _ = split(hdr, tmp_path / "out")
    truth = cv2.resize(read_frame(plain), None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA).astype(int)
    got = cv2.resize(frames[0], None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA).astype(int)
    assert transfer in clip.notes[0]
    assert np.abs(got - truth).mean() < 4
    assert got.max() > 190 and got.min() < 10


def make_camcorder_clip(path, *encode):
    """A bright bar that crosses the picture, filmed as 50 half pictures a second, two in each frame."""
    ffmpeg("-f", "lavfi", "-i", "color=black:size=320x240:rate=50:duration=2", "-f", "lavfi", "-i",
           "color=white:size=40x240:rate=50:duration=2", "-filter_complex",
           "[0][1]overlay=x=20+120*t:y=0,tinterlace=mode=interleave_top,setfield=tff", *encode, path)
    return path


def combing(frame):
    """Mean difference of a row from those above and below it. frame: (H, W, 3) uint8."""
    rows = frame.astype(float)
    return np.abs(rows[1:-1] - (rows[:-2] + rows[2:]) / 2).mean()


@pytest.mark.parametrize("encode", [("-c:v", "libx264", "-flags", "+ilme+ildct", "-bf", "2", "-crf", "10"),
                                    ("-c:v", "mpeg2video", "-flags", "+ilme+ildct", "-q:v", "2", "-f", "mpegts")])
@pytest.mark.parametrize("quick", [False, True])
def test_frames_of_two_half_pictures_come_without_combs_at_their_own_times(tmp_path, encode, quick):
    source = make_camcorder_clip(tmp_path / "clip.mts", *encode)
    clip, frames, warnings = split(source, tmp_path / "out", count=10, quick=quick)
    assert len(frames) == 10 and clip.notes == ["deinterlaced"] and not any("damaged" in warning for warning in warnings)
    assert max(map(combing, frames)) < 0.5
    middle = [float((frame[100, :, 0] * np.arange(320.0)).sum() / frame[100, :, 0].sum()) for frame in frames]
    assert middle == pytest.approx([40 + 120 * time for time in clip.timestamps_s], abs=4)


def test_a_progressive_video_is_not_deinterlaced(tmp_path, monkeypatch):
    graphs = []
    run_ffmpeg = writing.run_ffmpeg
    monkeypatch.setattr(writing, "run_ffmpeg", lambda path, video, output, *rest: graphs.append(output[1]) or run_ffmpeg(
        path, video, output, *rest))
    assert split(make_clip(tmp_path / "a.mp4", seconds=0.2), tmp_path / "out")[0].notes == []
    assert graphs and not any("dif" in graph for graph in graphs)


def test_odd_sizes_and_tall_frames_keep_their_aspect(tmp_path):
    source = make_clip(tmp_path / "a.mkv", "-c:v", "libx264", "-pix_fmt", "yuv444p", size="161x243", seconds=0.2)
    clip, _, _ = split(source, tmp_path / "1")
    assert (clip.width, clip.height) == (161, 243)
    clip, _, _ = split(source, tmp_path / "2", max_height=100)
    assert (clip.width, clip.height) == (66, 100)


def test_pixels_become_square(tmp_path):
    source = make_clip(tmp_path / "a.mp4", seconds=0.2, filters="setsar=2")
    clip, _, _ = split(source, tmp_path / "out")
    assert (clip.width, clip.height) == (320, 120)


@pytest.mark.parametrize(("name", "encode"), [
    ("a.webm", ["-c:v", "libvpx-vp9", "-pix_fmt", "yuva420p", "-crf", "10", "-b:v", "0"]),
    ("a.mov", ["-c:v", "png", "-pix_fmt", "rgba"]),
])
def test_transparency_is_composited_over_black(tmp_path, name, encode):
    source = tmp_path / name
    # White that is transparent on the left and opaque on the right.
    ffmpeg("-f", "lavfi", "-i", "color=white:size=64x48:rate=10:duration=0.3", "-vf",
           "format=rgba,geq=r=255:g=255:b=255:a='255*gte(X,32)'", *encode, source)
    clip, frames, _ = split(source, tmp_path / "out")
    assert frames[0][:, :24].max() < 20 and frames[0][:, 40:].min() > 235
    assert "black" in clip.notes[0]


def test_a_truncated_video_keeps_what_decodes_and_says_how_many(tmp_path):
    whole = make_clip(tmp_path / "a.mp4", "-g", "5", "-movflags", "+faststart", seconds=2, size="320x240")
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(whole.read_bytes()[: int(whole.stat().st_size * 0.6)])
    clip, frames, warnings = split(cut, tmp_path / "out", fps=None)
    assert 10 < len(frames) < 59 and clip.timestamps_s == pytest.approx(np.arange(len(frames)) / 30, abs=1e-6)
    assert "60 frames" in warnings[0] and str(len(frames)) in warnings[0]


AVI = {
    "copied": ("-c:v", "libx264", "-bf", "2", "-g", "5"), "copied at odd times": ("-c:v", "libx264", "-g", "5", "-fps_mode", "vfr"),
    "encoded": ("-c:v", "mpeg4", "-g", "5"), "encoded with sound": ("-c:v", "mpeg4", "-g", "5", "-c:a", "libmp3lame", "-shortest"),
}


@pytest.mark.parametrize("kind", AVI)
def test_an_avi_is_whole_where_slots_of_time_are_empty_and_truncated_where_frames_are_missing(tmp_path, kind):
    sound = ["-f", "lavfi", "-i", "sine=duration=2"] if "sound" in kind else []
    filters = "select='not(eq(mod(n,4),2))'" if "odd" in kind else None
    copied, frames = kind.startswith("copied"), 45 if filters else 60
    source = make_clip(tmp_path / f"source.{'mp4' if copied else 'avi'}", *sound, *AVI[kind], seconds=2, filters=filters)
    whole, cut = tmp_path / "whole.avi", tmp_path / "cut.avi"
    ffmpeg("-i", source, "-c", "copy", whole) if copied else source.rename(whole)
    with av.open(str(whole)) as container:
        assert (container.streams.video[0].frames > frames) == (kind != "encoded")
    assert split(whole, tmp_path / "whole", fps=None)[2] == []
    for quick in (False, True):
        _, kept, warnings = split(whole, tmp_path / f"few{quick}", count=8, quick=quick)
        assert (len(kept), warnings) == (8, [])
    content = whole.read_bytes()
    cut.write_bytes(content[:content.index(b"movi") + (len(content) - content.index(b"movi")) // 2])
    _, there, warnings = split(cut, tmp_path / "cut", fps=None)
    assert frames // 4 < len(there) < frames - 2
    said = next(warning for warning in warnings if "cut.avi is truncated" in warning)
    assert abs(int(said.split(" promises ")[1].split(" frames")[0]) - frames) <= 2


def test_a_clip_that_was_trimmed_without_loss_is_whole_unless_it_is_cut_off(tmp_path):
    whole = make_clip(tmp_path / "a.mp4", "-g", "10", size="320x240")
    trimmed, shorter, cut = (tmp_path / name for name in ("trimmed.mp4", "shorter.mp4", "cut.mp4"))
    ffmpeg("-ss", 0.5, "-i", whole, "-c", "copy", "-movflags", "+faststart", "-movie_timescale", "1000", trimmed)
    content = bytearray(trimmed.read_bytes())
    cut.write_bytes(content[: int(len(content) * 0.6)])
    length = content.index(b"elst") + 12  # of the part that is shown, ms
    content[length:length + 4] = (300).to_bytes(4, "big")
    shorter.write_bytes(content)
    for source, shown in ((trimmed, 15), (shorter, 9)):
        _, frames, warnings = split(source, tmp_path / source.stem, fps=None)
        assert (len(frames), warnings) == (shown, [])
    _, _, warnings = split(cut, tmp_path / "cut", fps=None)
    assert "cut.mp4 is truncated: its header promises 20 frames" in warnings[0]


OPEN = {"h264": ("-c:v", "libx264", "-x264-params", "keyint=10:scenecut=0"),
        "hevc": ("-c:v", "libx265", "-x265-params", "log-level=error:keyint=10:open-gop=1:scenecut=0")}


@pytest.mark.parametrize(("name", "codec", "cut"), [
    ("a.ts", "hevc", ("-ss", 0.5)), ("a.mp4", "hevc", ("-ss", 0.5, "-use_editlist", 0)),
    ("a.mkv", "h264", ("-copyinkf", "-copypriorss", 0, "-ss", 0.5)), ("a.ts", "h264", ("-copyinkf", "-copypriorss", 0, "-ss", 0.5)),
])
def test_a_clip_that_begins_with_frames_which_need_earlier_ones_begins_with_the_first_that_does_not(tmp_path, name, codec, cut):
    whole, trimmed = make_clip(tmp_path / "whole.mp4", *OPEN[codec], size="320x240"), tmp_path / name
    seeks = "-copyinkf" not in cut
    ffmpeg(*(cut[:2] if seeks else ()), "-i", whole, "-c", "copy", *(cut[2:] if seeks else cut), trimmed)
    _, every, _ = split(whole, tmp_path / "whole", fps=None)
    clip, frames, warnings = split(trimmed, tmp_path / "out", fps=None)
    first = len(every) - len(frames)
    assert first in (10, 20) and all(map(np.array_equal, frames, every[first:])) and "damaged" not in " ".join(warnings)
    assert np.diff(clip.timestamps_s) == pytest.approx(1 / 30, abs=2e-3) and clip.timestamps_s[0] == 0
    assert len(split(trimmed, tmp_path / "quick", quick=True, count=3)[1]) == 3


def test_a_first_frame_that_is_damaged_is_said_to_be(tmp_path):
    source = make_clip(tmp_path / "a.mov", "-c:v", "png", size="64x48", rate=10)
    start, first, *frames = source.read_bytes().split(b"IDAT")
    source.write_bytes(b"IDAT".join([start, b"\xff" * 40 + first[40:], *frames]))
    _, frames, warnings = split(source, tmp_path / "out", fps=None)
    assert len(frames) == 9 and "a.mov is damaged: 1 of the 10 frames to keep do not decode" in warnings[0]


def test_a_clip_most_of_whose_frames_are_damaged_gives_the_others_and_says_so(tmp_path):
    source = make_clip(tmp_path / "a.mov", "-c:v", "png", size="64x48", rate=10)
    start, *frames = source.read_bytes().split(b"IDAT")
    assert len(frames) == 10
    source.write_bytes(b"IDAT".join([start, *frames[:2], *(b"\xff" * 40 + frame[40:] for frame in frames[2:])]))
    _, frames, warnings = split(source, tmp_path / "out", fps=None)
    assert len(frames) == 2 and "a.mov is damaged: 8 of the 10 frames to keep do not decode" in warnings[0]


def test_a_video_without_its_index_is_bad_input(tmp_path):
    whole = make_clip(tmp_path / "a.mp4")
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(whole.read_bytes()[:3000])
    with pytest.raises(BadInput, match="cut.mp4"):
        split(cut, tmp_path / "out")


@pytest.mark.parametrize("content", [b"", b"hello, this is no video\n" * 50, bytes(range(256)) * 40])
def test_what_is_not_a_video_is_bad_input(tmp_path, content):
    source = tmp_path / "notes.mp4"
    source.write_bytes(content)
    with pytest.raises(BadInput, match="notes.mp4"):
        split(source, tmp_path / "out")


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP", "BMP", "TIFF", "HEIF"])
def test_a_photo_under_a_videos_name_is_said_to_be_a_picture(tmp_path, kind):
    pillow_heif.register_heif_opener()
    Image.new("RGB", (90, 160)).save(tmp_path / "clip.mp4", format=kind)
    with pytest.raises(BadInput, match=r"clip.mp4: is a picture \(.*\) under a video's name. Give .* name it clip\.\w+"):
        split(tmp_path / "clip.mp4", tmp_path / "out")


PLAYLISTS = {
    "list.m3u8": "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\n{0}\n#EXT-X-ENDLIST\n", "list.m3u": "#EXTM3U\n{0}\n",
    "list.mp4": "ffconcat version 1.0\nfile '{0}'\n", "list.ffconcat": "ffconcat version 1.0\nfile '{0}'\n",
    "call.sdp": "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=video 9 RTP/AVP 96\na=rtpmap:96 H264/90000\n",
    "list.mpd": "<?xml version='1.0'?><MPD xmlns='urn:mpeg:dash:schema:mpd:2011'><BaseURL>{0}</BaseURL></MPD>",
    "drawn.svg": "<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'/>",
}


@pytest.mark.parametrize("name", PLAYLISTS)
def test_a_playlist_that_names_other_files_is_not_followed(tmp_path, name):
    secret = make_clip(tmp_path / "secret.mp4", seconds=0.2)
    (tmp_path / name).write_text(PLAYLISTS[name].format(secret))
    with pytest.raises(BadInput, match=rf"{name}: is text, no video; a playlist"):
        split(tmp_path / name, tmp_path / "out")


def test_a_name_is_no_pattern_for_the_files_beside_it(tmp_path):
    for i in range(5):
        make_clip(tmp_path / f"y{i:03d}.jp2", "-frames:v", "1", size="32x32")
    (tmp_path / "y%03d.jp2").write_text("no picture")
    with pytest.raises(BadInput, match="y%03d.jp2"):
        split(tmp_path / "y%03d.jp2", tmp_path / "out")


@pytest.mark.parametrize("name", ["-i", "concat:a.mp4", "a\udcff.mp4", "subfile,,start,0,end,9,,:b.mp4", "pipe:0"])
def test_an_odd_name_is_only_a_name(tmp_path, monkeypatch, name):
    whole = make_clip(tmp_path / "whole.mp4", seconds=0.2)
    monkeypatch.chdir(tmp_path)
    Path(name).write_bytes(whole.read_bytes())
    _, frames, _ = split(Path(name), tmp_path / "out")
    assert len(frames) == 6


def test_frames_beyond_8k_are_refused_before_one_is_decoded(tmp_path):
    source = make_clip(tmp_path / "a.mov", "-c:v", "png", "-frames:v", "1", size="64x48")
    data = bytearray(source.read_bytes())
    entry = data.index(b"png ", data.index(b"stsd")) + 28
    assert data[entry:entry + 4] == bytes([0, 64, 0, 48])
    data[entry:entry + 4] = (20000).to_bytes(2, "big") * 2
    header = data.index(b"IHDR") + 4
    data[header:header + 8] = (20000).to_bytes(4, "big") * 2
    data[header + 13:header + 17] = zlib.crc32(data[header - 4:header + 13]).to_bytes(4, "big")
    source.write_bytes(data)
    with pytest.raises(BadInput, match=r"a\.mov: (has frames of 20000x20000 pixels; at most 35389440|no frame can be decoded)"):
        split(source, tmp_path / "out")


def test_a_stretched_pixel_makes_no_huge_frame(tmp_path):
    source = make_clip(tmp_path / "a.mov", "-c:v", "png", "-frames:v", "1", size="64x1200", filters="setsar=900:max=1000")
    with pytest.raises(BadInput, match=r"a\.mov: has frames of \d+x1200 pixels; at most 35389440"):
        split(source, tmp_path / "out")


def test_a_codec_that_ffmpeg_does_not_know_is_bad_input(tmp_path):
    source = make_clip(tmp_path / "a.mp4", seconds=0.2)
    source.write_bytes(source.read_bytes().replace(b"avc1", b"zzzz").replace(b"avcC", b"zzzC"))
    with pytest.raises(BadInput, match="a.mp4"):
        split(source, tmp_path / "out")


def test_no_variable_of_the_environment_chooses_the_program(tmp_path, monkeypatch):
    own = tmp_path / "ffmpeg"
    own.write_text("#!/bin/sh\nexit 7\n")
    own.chmod(0o755)
    source = make_clip(tmp_path / "a.mp4", seconds=0.2)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(own))
    _, frames, _ = split(source, tmp_path / "out")
    assert len(frames) == 6


def test_sound_alone_is_bad_input(tmp_path):
    ffmpeg("-f", "lavfi", "-i", "sine=duration=0.3", tmp_path / "a.m4a")
    with pytest.raises(BadInput, match="no video stream"):
        split(tmp_path / "a.m4a", tmp_path / "out")


def test_a_missing_file_is_bad_input(tmp_path):
    with pytest.raises(BadInput, match="no such file"):
        split(tmp_path / "gone.mp4", tmp_path / "out")


def test_one_frame_works_with_a_warning(tmp_path):
    source = make_clip(tmp_path / "a.mp4", "-frames:v", "1")
    clip, frames, warnings = split(source, tmp_path / "out")
    assert len(frames) == 1 and clip.timestamps_s == [0.0] and "one frame" in warnings[0]


def test_a_container_without_timestamps_still_gives_rising_ones(tmp_path):
    source = make_clip(tmp_path / "a.avi", "-c:v", "mpeg4", "-bf", "2")
    clip, frames, _ = split(source, tmp_path / "out", fps=None)
    assert len(frames) >= 29 and np.diff(clip.timestamps_s) == pytest.approx(1 / 30, abs=1e-3)


def test_odd_paths_are_only_names(tmp_path):
    folder = tmp_path / "100% a:b %06d"
    folder.mkdir()
    source = make_clip(tmp_path / "a.mp4", seconds=0.2)
    (folder / "c'l p.mp4").write_bytes(source.read_bytes())
    _, frames, _ = split(folder / "c'l p.mp4", folder / "out")
    assert len(frames) == 6


def test_the_focal_length_a_phone_writes_is_used(tmp_path):
    source = make_clip(tmp_path / "a.mov", "-movflags", "use_metadata_tags", "-metadata",
                     "com.apple.quicktime.camera.focal_length.35mm_equivalent=26", size="300x400", seconds=0.2)
    clip, _, _ = split(source, tmp_path / "out")
    assert clip.focal_px == pytest.approx(26 / np.hypot(36, 24) * 500)


@pytest.mark.slow
def test_ten_thousand_frames_are_capped(tmp_path):
    source = make_clip(tmp_path / "long.mp4", "-preset", "ultrafast", size="64x48", rate=50, seconds=200)
    clip, frames, _ = split(source, tmp_path / "capped")
    assert len(frames) == 120 and clip.timestamps_s[-1] == pytest.approx(9999 / 50)
    clip, frames, _ = split(source, tmp_path / "most", fps=20, count=None)
    assert len(frames) == 4000


def test_progress_counts_up_to_the_kept_frames(tmp_path):
    source = make_clip(tmp_path / "a.mp4")
    seen = []
    (tmp_path / "out").mkdir()
    run(Job({"clip": source}, tmp_path / "out", SplitConfig(fps=10), progress=lambda *step: seen.append(step)))
    assert seen == [(i + 1, 10, "frames") for i in range(10)]

"""A quick look decodes no more than its frames need, and its frames are what decoding the whole video gives."""

import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import imageio_ffmpeg
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.frame_files import read_frame
from gsac.stages.contract import Job
from gsac.stages.split import ffmpeg_run, writing
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.decoding import NEAR, Chains, find_alone
from gsac.stages.split.pick import pick_by_time
from gsac.stages.split.probe import Video, probe
from gsac.stages.split.stage import run

ENCODERS = {
    "plain": ("-c:v", "libx264", "-g", "30", "-bf", "0"),
    "reordered": ("-c:v", "libx264", "-g", "30", "-bf", "3"),
    "open": ("-c:v", "libx264", "-bf", "3", "-x264-params", "open-gop=1:keyint=30:scenecut=0"),
    "hevc": ("-c:v", "libx265", "-bf", "4", "-x265-params", "log-level=error:keyint=30:open-gop=1:scenecut=0"),
}


def make_clip(path: Path, *encode: str) -> Path:
    """4 s, 120 frames."""
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error", "-f", "lavfi", "-i",
                    "testsrc2=size=160x120:rate=30:duration=4", *encode, str(path)], check=True)
    return path


def split(source: Path, out: Path, **config) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Times (K,) s, frames (K, H, W, 3) and what was said."""
    said = []
    out.mkdir()
    run(Job({"clip": source}, out, SplitConfig(**config), warn=lambda finding: said.append(finding.message)))
    frames = np.stack([read_frame(path) for path in frame_paths(out / "frames")])
    return np.array(Clip.read(out / "clip.json").timestamps_s), frames, said


@pytest.fixture
def decoded(monkeypatch) -> list[int]:
    """How many frames ffmpeg was told to decode, run by run; 0: all."""
    counts, real = [], writing.run_ffmpeg

    def spy(path, video, output, folder, on_frame, read, how):
        counts.append(0 if how.needed is None else int(how.needed.sum()))
        return real(path, video, output, folder, on_frame, read, how)

    monkeypatch.setattr(writing, "run_ffmpeg", spy)
    return counts


@pytest.mark.parametrize("kind", list(ENCODERS))
def test_what_is_not_decoded_changes_no_frame(tmp_path, decoded, kind):
    clip = make_clip(tmp_path / "clip.mp4", *ENCODERS[kind])
    times, frames, said = split(clip, tmp_path / "quick", quick=True, count=7)
    _, every, _ = split(clip, tmp_path / "all", count=None)
    assert said == [] and 0 < decoded[0] < 0.75 * 120
    assert np.array_equal(frames, every[np.round(times * 30).astype(int)])


def test_a_run_decodes_every_frame(tmp_path, decoded):
    split(make_clip(tmp_path / "clip.mp4", *ENCODERS["plain"]), tmp_path / "run", count=7)
    assert decoded == [0]


def test_a_program_that_cannot_leave_frames_out_decodes_all(tmp_path, decoded, monkeypatch):
    clip = make_clip(tmp_path / "clip.mp4", *ENCODERS["plain"])
    times, frames, _ = split(clip, tmp_path / "quick", quick=True, count=7)
    monkeypatch.setattr(ffmpeg_run, "_leave_out", lambda sent, needed: ["-no_such_option", "1"])
    same_times, same, said = split(clip, tmp_path / "old", quick=True, count=7)
    assert decoded[1:] == [decoded[0], 0] and said == []
    assert np.array_equal(frames, same) and np.array_equal(times, same_times)


def damaged(folder: Path) -> Path:
    clip = make_clip(folder / "clip.mp4", *ENCODERS["plain"])
    content = bytearray(clip.read_bytes())
    content[len(content) // 4:len(content) // 4 + 3000] = bytes(3000)
    clip.write_bytes(content)
    return clip


def test_a_damaged_video_is_told_as_if_all_of_it_were_decoded(tmp_path):
    clip = damaged(tmp_path)
    times, frames, said = split(clip, tmp_path / "quick", quick=True, count=40)
    whole = {round(time * 30): frame for time, frame in zip(*split(clip, tmp_path / "run", count=120)[:2], strict=True)}
    assert said == split(clip, tmp_path / "again", quick=True, count=40)[2] != []
    assert all(np.array_equal(frame, whole[round(time * 30)]) for time, frame in zip(times, frames, strict=True))


def test_a_damaged_video_gives_the_same_frames_each_time(tmp_path):
    """Several threads make another picture of what is damaged in one decode of eight."""
    clip = damaged(tmp_path)
    frames = [split(clip, tmp_path / f"run{k}", count=20)[1] for k in range(12)]
    assert all(np.array_equal(one, frames[0]) for one in frames)


def phone(frames: int, every: int, referred: int = 1) -> Chains:
    """Of a clip with a key frame `every` so many; to one frame of so many `referred` others refer."""
    ticks = np.arange(frames)
    chains = chains_of(ticks, ticks, ticks[::every], ticks % every % referred > 0)
    assert chains is not None
    return chains


def chains_of(ticks: np.ndarray, sent: np.ndarray, keys: np.ndarray, alone: np.ndarray | None = None) -> Chains | None:
    """As of a video of these times. alone: (N,) bool, frames to which no other refers; None: none."""
    alone = np.zeros(len(ticks), bool) if alone is None else alone
    return Chains.of(cast(Video, SimpleNamespace(ticks=ticks, sent=sent, key_ticks=keys)), alone)


@pytest.mark.parametrize("kind", ["reordered", "hevc"])
def test_frames_to_which_no_other_refers_are_not_decoded(tmp_path, decoded, kind):
    clip = make_clip(tmp_path / "clip.mp4", *ENCODERS[kind])
    video = probe(clip)
    alone = find_alone(clip, video)
    assert 0.3 < alone.mean() < 0.8 and not alone[np.isin(video.ticks, video.key_ticks)].any()
    split(clip, tmp_path / "quick", quick=True, count=7)
    assert 0 < decoded[0] <= (~alone).sum() + 2, "of those alone the first and the last that are kept at most"


def test_of_a_codec_that_the_program_does_not_read_every_frame_may_be_referred_to(tmp_path):
    clip = make_clip(tmp_path / "clip.avi", "-c:v", "ffv1")
    assert find_alone(clip, probe(clip)).tolist() == [False] * 120


@settings(deadline=None)
@given(st.integers(1, 700), st.integers(1, 90), st.integers(1, 40), st.integers(1, 4))
def test_moved_frames_stay_near_their_places_and_cost_no_more(frames, every, count, referred):
    chains, times = phone(frames, every, referred), np.arange(frames) / 30
    picks = pick_by_time(times, None, count)
    moved = chains.move_picks(picks, times)
    assert moved[0] == picks[0] and moved[-1] == picks[-1] and (np.diff(moved) > 0).all()
    assert len(moved) == len(picks)
    assert (np.abs(times[moved] - times[picks]) <= NEAR * times[picks[-1]] / max(1, len(picks) - 1) + 1e-9).all()
    assert chains.needed(moved).sum() <= chains.needed(picks).sum()


def test_twenty_seconds_of_a_phone_are_seen_evenly_by_three_fifths_of_their_frames():
    chains, times = phone(600, 30), np.arange(600) / 30
    picks = chains.move_picks(pick_by_time(times, None, 32), times)
    assert len(picks) == 32 and chains.needed(picks).mean() < 0.6
    assert np.diff(times[picks]).max() < 1.25 * 20 / 31


def test_without_times_of_decoding_all_is_decoded():
    ticks = np.arange(9)
    assert chains_of(ticks, ticks[:0], ticks[:1]) is None
    assert chains_of(ticks, ticks, ticks[3:4]) is None

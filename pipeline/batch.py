"""Runs many clips over one store: finds them, gives each a folder, collects their results."""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Callable, Iterable
from pathlib import Path

from gsac.pipeline.executors.executor import ClipJob, ClipResult, Executor
from gsac.pipeline.run_folder import avatar_name
from gsac.pipeline.text_lines import read_lines
from gsac.stages.contract import BadInput
from gsac.stages.split.film import MASKS, PHOTO_SUFFIXES, VIDEO_SUFFIXES, find_film


def find_clips(source: Path) -> list[Path]:
    """Clips of a folder (videos, and folders of photos) or of a list with one path a line, relative to the list.

    A path that a list names and that is not there stays in: its run says so. BadInput where there is no clip at all.
    """
    if source.is_dir():
        clips = sorted(path for path in source.iterdir() if not path.name.startswith(".") and is_clip(path))
        if not clips:
            raise BadInput(f"{source}: no clips here; expected videos ({', '.join(sorted(VIDEO_SUFFIXES))}) or folders of photos")
        return clips
    if source.suffix.lower() in VIDEO_SUFFIXES and source.is_file():
        raise BadInput(f"{source} is one video: `{shlex.join(['gsac', 'run', str(source)])}` makes its avatar; "
                       "give a folder of clips or a list of paths")
    try:
        lines = read_lines(source)
    except FileNotFoundError as e:
        raise BadInput(f"{source}: no such file or folder; give a folder of clips or a list of paths") from e
    except (OSError, UnicodeDecodeError) as e:
        raise BadInput(f"{source}: not a list of clips ({e}); one path a line, in UTF-8") from e
    clips = [source.parent / line for line in lines if not line.startswith("#")]
    if not clips:
        raise BadInput(f"{source}: the list is empty; one path a line")
    return clips


def is_clip(path: Path) -> bool:
    """A video by its ending, or a folder with photos in it, or with one video and its masks or plate: one alone may be a result."""
    if path.is_dir():
        return (any(photo.suffix.lower() in PHOTO_SUFFIXES for photo in path.iterdir())
                or find_film(path) is not None and (path / MASKS).is_dir())
    return path.suffix.lower() in VIDEO_SUFFIXES


def make_jobs(clips: list[Path], out: Path, arguments: tuple[str, ...]) -> list[ClipJob]:
    """One folder a clip, `<out>/<clip>-avatar`; clips of equal name get a number. A clip named twice runs once."""
    clips = list(dict.fromkeys(path.absolute() for path in clips))
    return [ClipJob(clip, out.absolute() / name, arguments) for clip, name in zip(clips, name_folders(clips), strict=True)]


def name_folders(clips: list[Path]) -> list[str]:
    """Name of each clip's folder, all different. The first clip of a name has it to itself; the others get the next free number."""
    first = {avatar_name(clip): clip for clip in reversed(clips)}
    taken, names = set(first), []
    for clip in clips:
        name = avatar_name(clip)
        if first[name] != clip:
            name = next(free for number in itertools.count(2) if (free := avatar_name(clip, number)) not in taken)
            taken.add(name)
        names.append(name)
    return names


def run_batch(jobs: list[ClipJob], executor: Executor, on_result: Callable[[ClipResult], None],
              others: Iterable[ClipResult] = ()) -> list[ClipResult]:
    """Runs every job, also after one that fails; results as they came. others: results that are made here meanwhile."""
    results: list[ClipResult] = []
    with executor:
        for job in jobs:
            executor.submit(job)
        for result in itertools.chain(others, executor.collect()):
            results.append(result)
            on_result(result)
    return results

"""python -m gsac.benchmarks.unity: times each pass of the Unity package's frame on this machine's GPU."""

from __future__ import annotations

import argparse
import tempfile
from importlib.metadata import version
from pathlib import Path

import numpy as np

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.benchmarks.unity.frame import Crowd, Frame
from gsac.benchmarks.unity.gpu import Gpu, Painting
from gsac.benchmarks.unity.shaders import compile_frame, missing_packages, read_frame
from gsac.benchmarks.unity.spirv import Program
from gsac.benchmarks.unity.timing import Clock, draw_times, pass_times

LIMITS = {"vertices": 1e-6, "means": 1e-6, "order": 0}
"""Largest error allowed, m: eight steps of float32 at a metre, where kernel and trainer differ by one; order: 0 if the gaussians
are sorted, else 1."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.unity", description=__doc__)
    parser.add_argument("--avatar", type=Path, help="a .gsac file; without one the open body with --count gaussians")
    parser.add_argument("--count", type=int, default=25000)
    parser.add_argument("--people", type=int, default=1, help="so many of the person, joined and sorted together")
    parser.add_argument("--shaders", type=Path, help="folder of compiled shaders: written with --compile, otherwise read")
    parser.add_argument("--compile", action="store_true", help="compile into --shaders and exit: for a machine without glslang")
    parser.add_argument("--software", action="store_true", help="on lavapipe instead of a graphics card")
    parser.add_argument("--size", type=int, default=2000, help="px, height and width of an eye's picture")
    parser.add_argument("--distances", type=float, nargs="*", default=[2.0, 0.7], help="m from the eyes to the person")
    parser.add_argument("--repeats", type=int, default=400)
    parser.add_argument("--picture", type=Path, help="write the left eye's picture there (.png)")
    options = parser.parse_args()
    if (options.compile or not options.shaders) and (missing := missing_packages()):
        raise SystemExit(f"benchmarks.unity: compiling needs the Debian packages {', '.join(missing)}")
    if options.compile:
        options.shaders.mkdir(parents=True, exist_ok=True)
        compile_frame(options.shaders)
        return
    with tempfile.TemporaryDirectory() as folder:
        if not options.shaders:
            compile_frame(Path(folder))
        programs = read_frame(options.shaders or Path(folder))
    report(options, programs)


def report(options: argparse.Namespace, programs: dict[str, Program]) -> None:
    """Prints the check and the table. programs: entry point -> compiled shader."""
    gpu = Gpu(options.software)
    if not gpu.timed:
        raise SystemExit(f"benchmarks.unity: {gpu.summary} has no timestamps")
    if options.avatar:
        avatar = RiggedAvatar.read(options.avatar)
    else:
        from gsac.benchmarks.viewer.avatar import make_avatar

        # as a file keeps it: weights of the skin in 16 bits, as the kernel takes them
        avatar = RiggedAvatar.from_bytes(avatar_bytes(make_avatar(options.count)))
    clock, frame = Clock(gpu), Frame(gpu, programs, avatar)
    print(f"{gpu.summary}; wgpu {version('wgpu')}; {frame.count} gaussians, {len(avatar.vertices)} vertices, "
          f"{len(avatar.expression_vertex)} moves of expressions", flush=True)
    times = pass_times(clock, frame, options.repeats)
    errors = frame.errors()
    print("check against the trainer: " + ", ".join(f"{k} {v:.1e}" for k, v in errors.items())
          + (" ok" if all(v <= LIMITS[k] for k, v in errors.items()) else " MISSED"))
    print(f"{'pass':28s} {'dispatches':>10s} {'median us':>10s} {'p95 us':>8s} {'moved MB':>9s} {'GB/s':>7s}")
    for p in frame.passes:
        print_row(p.name, len(p.jobs), times[p.name], p.moved)
    print_row("frame: all of them, once", len(frame.order), times["frame"], sum(p.moved for p in frame.passes))
    if options.people > 1:
        crowd = Crowd(frame, programs, options.people)
        times = pass_times(clock, crowd, options.repeats)
        print(f"{options.people} people together, {crowd.count} gaussians:" + ("" if crowd.is_sorted() else " order MISSED"))
        for p in crowd.passes:
            print_row(p.name, len(p.jobs), times[p.name], p.moved)
        print_row("join and sort, once", len(crowd.order), times["frame"], sum(p.moved for p in crowd.passes))
    vertex, fragment = programs["Vertex"], programs["Fragment"]
    paintings = tuple(Painting(gpu, vertex, fragment, options.size, options.size, frame.count) for _ in range(2))
    for distance in options.distances:
        draws = draw_times(clock, paintings, frame.eyes(options.size, distance), options.repeats)
        left = paintings[0].read()
        print_row(f"draw, 2 x {options.size}x{options.size}, {distance:g} m", 2, draws, 2 * options.size ** 2 * 8)
        print(f"    {(left[..., 3] > .5).mean() * 100:.0f} % of a picture covered")
        if options.picture:
            from PIL import Image

            shown = np.uint8(np.clip(left[..., :3] + 1 - left[..., 3:], 0, 1) * 255)
            Image.fromarray(shown).save(options.picture.with_stem(f"{options.picture.stem}-{distance:g}m"))


def print_row(name: str, dispatches: int, us: np.ndarray, moved: int) -> None:
    """Prints a row of the table. us: (repeats,) of the whole pass; moved: bytes."""
    middle = np.median(us)
    print(f"{name:28s} {dispatches:10d} {middle:10.1f} {np.quantile(us, .95):8.1f} {moved / 1e6:9.2f} {moved / middle / 1e3:7.0f}",
          flush=True)


if __name__ == "__main__":
    main()

"""python -m gsac.benchmarks.gpu.published: how gaussians grow by the published rule in plain torch, and in recipe `paper`.

    export RUN SCENE       writes what recipe `paper` starts from on a finished `gsac run` into one file
    train SCENE ...        trains by the published definition; needs torch, Triton and numpy alone
    ours SCENE ...         trains recipe `paper`
    step SCENE             compares a step of both on the CPU; wants a small --height of `export`
    kernels                compares the drawing on the GPU with its plain reference
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

STEPS = 2311
"""Of 3000: the last event is after step 2310."""
EVENT = "| after step | gaussians | at the threshold | cloned | split | a face, then | loss | median, 90, 99, 99.9 % | s |"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.gpu.published", description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(do: Callable[[argparse.Namespace], None], scenes: str | None = None) -> argparse.ArgumentParser:
        made = commands.add_parser(do.__name__, help=do.__doc__, description=do.__doc__)
        made.set_defaults(do=do)
        if scenes:
            made.add_argument("scenes", type=Path, nargs=scenes, metavar="SCENE")
        return made

    exporter = command(export)
    exporter.add_argument("run", type=Path, metavar="RUN")
    exporter.add_argument("scene", type=Path, metavar="SCENE")
    exporter.add_argument("--height", type=int, default=1080, help="px that frames are scaled to (default: 1080)")
    trainer, recipe = command(train, "+"), command(ours, "+")
    trainer.add_argument("--unmasked", action="store_true", help="L2 and SSIM as in HAHA, without alpha times mask")
    trainer.add_argument("--steps", type=int, default=STEPS, help=f"default: {STEPS}")
    for each in (trainer, recipe):
        each.add_argument("--device", default="cuda", choices=("cuda", "cpu"))
        each.add_argument("--seed", type=int, default=0, help="of the samples of splits (ours: and of all else)")
    for each in (trainer, command(step, "+"), command(kernels)):
        each.add_argument("--exact", action="store_true", help="the gradient in the place of the published backward pass")
    options = parser.parse_args()
    options.do(options)


def export(options: argparse.Namespace) -> None:
    """Writes the scene of a run."""
    from gsac.benchmarks.gpu.published.scene import scene_of, task_of_run

    scene = scene_of(task_of_run(options.run, options.height))
    scene.write(options.scene)
    print(f"{options.scene}: {len(scene.pixels)} frames, {scene.pixels.shape[2]}x{scene.pixels.shape[1]} px of a square of "
          f"{scene.side} px, {options.scene.stat().st_size / 2**20:.1f} MB")


def train(options: argparse.Namespace) -> None:
    """Trains by the published definition and prints its events."""
    import torch

    from gsac.benchmarks.gpu.published.scene import Scene
    from gsac.benchmarks.gpu.published.trainer import Trainer

    torch.backends.cudnn.allow_tf32 = False
    kind = f"{'unmasked' if options.unmasked else 'masked'}, {'gradient' if options.exact else 'published backward pass'}"
    for path in options.scenes:
        scene = Scene.read(path)
        trainer = Trainer(scene, options.device, not options.unmasked, options.exact, options.seed)
        faces, began, losses = len(scene.faces), time.monotonic(), []
        print(f"\n{path.stem}, {kind}; percentiles of the mean lengths that are not zero, in thresholds\n\n{EVENT}\n"
              f"{'| --- ' * (EVENT.count('|') - 1)}|", flush=True)
        for number in range(options.steps):
            losses.append(trainer.step(number))
            if event := trainer.grow(number):
                loss, losses = float(torch.stack(losses).mean()), []
                cells = [event.step, event.before, event.above, event.cloned, event.split, f"{len(trainer.face) / faces:.3f}",
                         f"{loss:.5f}", ", ".join(f"{s:.3f}" for s in event.shares), f"{time.monotonic() - began:.0f}"]
                print(f"| {' | '.join(map(str, cells))} |", flush=True)
        took = time.monotonic() - began
        print(f"\n{path.stem}, {kind}: {len(trainer.face) / faces:.3f} gaussians a face ({len(trainer.face)}) after "
              f"{options.steps} steps of {1e3 * took / options.steps:.0f} ms", flush=True)


def ours(options: argparse.Namespace) -> None:
    """Trains recipe `paper` and prints its events."""
    from gsac.benchmarks.gpu.published.formulas import due
    from gsac.benchmarks.gpu.published.scene import Scene, task_of
    from gsac.stages.train.recipes import RECIPES

    after = [number + 2 for number in range(3000) if due(number)]
    for path in options.scenes:
        task = task_of(Scene.read(path), options.seed)
        faces = len(task.poses.body.faces)
        print(f"\n{path.stem}, recipe paper on {options.device}\n\n| after step | gaussians | a face |\n| --- | --- | --- |")

        def look(number: int, steps: int, loss: float, gaussians: Callable, gpu_seconds: float | None = None,
                 faces: int = faces) -> None:
            if number in after:
                count = len(gaussians())
                print(f"| {number - 2} | {count} | {count / faces:.3f} |", flush=True)

        RECIPES["paper", options.device](replace(task, checkpoint=look, marks=lambda steps: after))


def step(options: argparse.Namespace) -> None:
    """Compares a step of both on the CPU."""
    from gsac.benchmarks.gpu.published.compare import compare_step
    from gsac.benchmarks.gpu.published.scene import Scene

    for path in options.scenes:
        show(path.stem, compare_step(Scene.read(path), options.exact))


def kernels(options: argparse.Namespace) -> None:
    """Compares the drawing on the GPU with its plain reference."""
    from gsac.benchmarks.gpu.published.compare import compare_kernels

    show("kernels", compare_kernels(options.exact))


def show(title: str, apart: dict[str, float]) -> None:
    """Prints figures by name."""
    print(title, *(f"{name}: {figure:.2e}" for name, figure in apart.items()), sep="\n    ")


if __name__ == "__main__":
    main()

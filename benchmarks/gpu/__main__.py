"""python -m gsac.benchmarks.gpu [--quick]: checks the CUDA trainer and measures times, memory and distance to the ceilings."""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from gsac.avatar.cuda import why_not

if TYPE_CHECKING:
    from gsac.avatar.cuda.device import Device
    from gsac.avatar.cuda.recipe import Recipe
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import Figure


def make_bench_recipe(count: int = 25000, **more: Any) -> Recipe:
    """Recipe `fast` with the paper's Sobel term and without the displaced surface. more: fields of the recipe."""
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.fast.cuda import make_recipe

    return make_recipe(TrainConfig(sobel=0.1), count, **({"offset_rate": 0.0} | more))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.gpu", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer frames, no long training")
    quick = parser.parse_args().quick
    if why := why_not():
        raise SystemExit(f"benchmarks.gpu: {why}")
    from gsac.avatar.cuda.device import Device
    from gsac.benchmarks.gpu import perceptual
    from gsac.benchmarks.gpu.check import LIMIT, errors
    from gsac.benchmarks.gpu.synthetic_clip import figure, start
    from gsac.benchmarks.gpu.timing import copy_bandwidth, float_rate

    began = time.perf_counter()
    device = Device()
    driver = device._driver.cuDriverGetVersion()[1]
    print(f"device {device.name}, {device.processors} multiprocessors, driver for CUDA {driver // 1000}.{driver % 1000 // 10}; "
          f"kernels ready after {time.perf_counter() - began:.1f} s", flush=True)

    def done(what: str) -> None:
        print(f"[{time.perf_counter() - began:6.1f} s] {what}", flush=True)

    small = figure(3, 101, 67, 4000)
    done("small figure")
    recipe = make_bench_recipe(steps=5)
    for count in (1, 17, 1000, 12000, 100000):
        report(f"101x67, {count}", errors(small, start(small.body, count), recipe, device, 1024 if count < 2000 else None), LIMIT)
    inside = figure(3, 101, 67, 100)
    inside.transl[:, 2] = 0.1
    report("camera in the body", errors(inside, start(inside.body, 3000), recipe, device), LIMIT)
    big = figure(12 if quick else 100, 1080, 1080)
    done("figure of 1080x1080")
    for count in (10000, 25000):
        report(f"1080x1080, {count}", errors(big, start(big.body, count), recipe, device), LIMIT)
    done("checks")
    ceilings = copy_bandwidth(device), float_rate(device)
    print(f"ceilings: copy {ceilings[0] / 1e12:.2f} TB/s, float32 {ceilings[1] / 1e12:.1f} T operations/s")
    measure(device, big, quick, ceilings)
    done("times")
    measure_paper(device, big, ceilings)
    measure_rounds(device, big)
    done("times of recipe paper and of the rounds of poses")
    measure_body(device, big, ceilings)
    measure_tails(device, big)
    perceptual.measure(device)
    done("times of parameters not learned by default, of long lists, of LPIPS")
    compare(big)
    done("all")


def report(name: str, found: tuple[dict, dict], limit: float) -> None:
    """Prints a check. found: of `check.errors`."""
    settled, everything = found
    verdict = "ok" if max(settled.values()) <= limit else "MISSED"
    print(f"check {name:18s} {verdict}  " + " ".join(f"{k} {v:.1e}" for k, v in settled.items())
          + f"; with swaps of depth order {max(everything.values()):.1e}", flush=True)


def compare(figure: Figure) -> None:
    """Times the same loop in torch + gsplat if these are installed."""
    from importlib.util import find_spec

    from gsac.benchmarks.gpu.synthetic_clip import start

    if find_spec("torch") is None or find_spec("gsplat") is None:
        print("torch + gsplat: not installed, not measured")
        return
    from gsac.benchmarks.gpu.baseline import seconds_per_step

    for compiled in (False, True):
        took = seconds_per_step(figure, start(figure.body, 25000), make_bench_recipe(), compiled)
        print(f"torch + gsplat, {'torch.compile' if compiled else 'eager'}: {took * 1e3:.2f} ms a step, "
              f"{took * 3000:.1f} s for 3000 steps of one frame", flush=True)


def measure_paper(device: Device, figure: Figure, ceilings: tuple[float, float]) -> None:
    """Times recipe `paper` kernel by kernel: one gaussian a face, four frames a step, poses, expressions and betas learned.

    ceilings: bytes and float32 operations a second.
    """
    from types import SimpleNamespace

    from gsac.avatar.body import Body
    from gsac.avatar.cuda.paper import PaperTrainer
    from gsac.benchmarks.gpu.timing import evaluations, kernel_microseconds, nearest_milliseconds
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.paper import cuda as paper_cuda
    from gsac.stages.train.task import Task

    model = Body.load()
    body = figure.body._replace(shape=model.shapedirs, joint_shape=np.tensordot(model.J_regressor, model.shapedirs, 1),
                                expression=model.exprdirs)
    views = [SimpleNamespace(camera=shot.camera, frame=shot.camera) for shot in figure.shots]
    task = SimpleNamespace(config=TrainConfig(recipe="paper"), trained=views, views=views, poses=SimpleNamespace(body=model))
    recipe = paper_cuda.make_recipe(cast(Task, task))
    start = paper_cuda.init_gaussians(len(body.faces), np.random.default_rng(0))
    trainer = PaperTrainer(body, [figure.shots], figure.pose, figure.transl, start, recipe, device)
    trainer.train(200)
    print(f"recipe paper, {trainer.count} gaussians, batch {trainer.batch}; neighbours searched in "
          f"{nearest_milliseconds(trainer):.2f} ms, of all pairs at the ceiling of operations in "
          f"{8 * trainer.batch * trainer.count**2 / ceilings[1] * 1e3:.2f} ms")
    kernels = kernel_microseconds(trainer)
    print_kernels(trainer, kernels, trainer.batch * evaluations(figure, trainer.gaussians()), ceilings)
    trainer.close()


def measure_rounds(device: Device, figure: Figure) -> None:
    """Times a step of the rounds that move the poses: 3000 gaussians at an eighth of the size, displaced surface learned."""
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import start
    from gsac.benchmarks.gpu.timing import kernel_microseconds, step_milliseconds
    from gsac.stages.train.fast import prealign
    from gsac.stages.train.fast.schedule import OFFSET_RATE

    recipe = make_bench_recipe(prealign.COUNT, steps=600, sobel=0.0, pose_rate=0.0, offset_rate=OFFSET_RATE, offset_share=1.0)
    trainer = CudaTrainer(figure.body, [figure.scaled(8)], figure.pose, figure.transl, start(figure.body, prealign.COUNT), recipe,
                          device)
    steps = step_milliseconds(trainer)
    trainer.scene.offset_every = 1
    print(f"rounds of poses: a step {np.median(steps) * 1e3:.0f} us; kernels in us, one that moves the surface: "
          + ", ".join(f"{name} {us:.1f}" for name, us in kernel_microseconds(trainer).items()), flush=True)
    trainer.close()


def measure_body(device: Device, figure: Figure, ceilings: tuple[float, float]) -> None:
    """Times the kernels that learn expression and joints at rest."""
    from gsac.avatar.body import Body
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import start
    from gsac.benchmarks.gpu.timing import kernel_microseconds, least_bytes

    recipe = make_bench_recipe(steps=600, expression_rate=1e-3, joint_rate=1e-4)
    body = figure.body._replace(expression=Body.load().exprdirs)
    trainer = CudaTrainer(body, [figure.shots], figure.pose, figure.transl, start(body, 25000), recipe, device)
    trainer.train(60)
    kernels, least = kernel_microseconds(trainer), least_bytes(trainer)
    print("expression and joints at rest learned: " + ", ".join(
        f"{name} {kernels[name]:.1f} us" + (f" ({least[name] / ceilings[0] * 1e6:.1f} at the ceiling)" if name != "skin" else "")
        for name in ("skin", "expression_step", "place_joints")), flush=True)
    trainer.close()


def measure_tails(device: Device, figure: Figure) -> None:
    """Times `blend` with long lists of gaussians, see `long_lists`."""
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu import long_lists
    from gsac.benchmarks.gpu.synthetic_clip import start

    for count, batch, smaller in ((25000, 1, 1), (25000, 4, 1), (12000, 1, 2)):
        shots = figure.shots if smaller == 1 else figure.scaled(smaller)
        trainer = CudaTrainer(figure.body, [shots], figure.pose, figure.transl, start(figure.body, count),
                              make_bench_recipe(count, steps=900, batch=batch), device)
        trainer.train(300)
        long_lists.measure(trainer, device)
        trainer.close()


def print_kernels(trainer: CudaTrainer, kernels: dict[str, float], pairs: float, ceilings: tuple[float, float]) -> None:
    """Prints each kernel's time beside its lower bounds. kernels: us; pairs: (gaussian, pixel) composited in the batch."""
    from gsac.benchmarks.gpu.timing import least_bytes, useful_operations

    least, useful = least_bytes(trainer), useful_operations(trainer, pairs)
    for name, us in kernels.items():
        floors = f"{least[name] / 1e6:7.2f} MB = {least[name] / ceilings[0] * 1e6:5.1f} us"
        if name in useful:
            floors += f", {useful[name] / 1e9:6.3f} G operations = {useful[name] / ceilings[1] * 1e6:5.1f} us"
        print(f"    {name:16s} {us:7.1f} us; at the ceilings {floors}", flush=True)


def measure(device: Device, figure: Figure, quick: bool, ceilings: tuple[float, float]) -> None:
    """Times steps, kernels and, unless quick, whole trainings of recipe `fast`, each twice."""
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import start
    from gsac.benchmarks.gpu.timing import (
        evaluations,
        kernel_microseconds,
        run_milliseconds,
        step_milliseconds,
    )

    for count, batch in ((25000, 1), (25000, 4), (25000, 8), (10000, 1), (100000, 1)):
        recipe = make_bench_recipe(count, steps=3000, batch=batch)
        trainer = CudaTrainer(figure.body, [figure.shots], figure.pose, figure.transl, start(figure.body, count), recipe,
                              device)
        steps = step_milliseconds(trainer)
        kernels, state = kernel_microseconds(trainer), trainer.state()
        print(f"step {count} gaussians, batch {batch}: median {np.median(steps) * 1e3:.0f} us ({min(steps) * 1e3:.0f}-"
              f"{max(steps) * 1e3:.0f}), {np.median(steps) / batch * 1e3:.0f} us a frame; {trainer.memory() / 1e9:.2f} GB; "
              f"{state.pairs} pairs, {state.heavy}+{state.light} tiles, {state.segments} segments")
        print_kernels(trainer, kernels, batch * evaluations(figure, trainer.gaussians()), ceilings)
        trainer.close()
    if quick:
        return
    for batch, steps in ((1, 3000), (4, 750)):
        recipe = make_bench_recipe(steps=steps, batch=batch)
        results = []
        for _ in range(2):
            trainer = CudaTrainer(figure.body, [figure.shots], figure.pose, figure.transl, start(figure.body, 25000), recipe,
                                  device)
            ms = run_milliseconds(trainer, steps)
            results.append((trainer.gaussians(), trainer.poses(), trainer.losses()))
            error = np.abs(trainer.poses()[0] - figure.true_pose)[:, :22].mean()
            trainer.close()
        same = all(np.array_equal(getattr(results[0][0], k), getattr(results[1][0], k)) for k in ("mu", "quat", "rgb", "opacity"))
        loss = results[0][2].mean(1)
        print(f"training {steps} steps of {batch}: {ms / 1e3:.3f} s; loss {loss[:20].mean():.5f} -> {loss[-100:].mean():.5f}; "
              f"pose error {np.abs(figure.pose - figure.true_pose)[:, :22].mean():.5f} -> {error:.5f} rad; "
              f"twice the same: {'yes' if same else 'NO'}; finite: {bool(np.isfinite(loss).all())}", flush=True)


if __name__ == "__main__":
    main()

"""One step of the CUDA trainer against torch and gsplat: image, loss, every gradient. gsplat compiles itself at its first use."""

from importlib.util import find_spec

import numpy as np
import pytest

from gsac.avatar.cuda import why_not

pytestmark = [
    pytest.mark.skipif(why_not() is not None, reason=f"CUDA path: {why_not()}"),
    pytest.mark.skipif(find_spec("torch") is None or find_spec("gsplat") is None, reason="torch or gsplat is not installed"),
]


@pytest.mark.parametrize("size, count", [((101, 67), 17), ((101, 67), 3000), ((333, 500), 20000)])
def test_image_loss_and_gradients_are_those_of_gsplat(size, count):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.baseline import TorchTrainer, on_device, tensor
    from gsac.benchmarks.gpu.check import LIMIT, PER_GAUSSIAN, SWAPS, cuda_step, relative
    from gsac.benchmarks.gpu.synthetic_clip import figure, start
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.fast.cuda import make_recipe

    made = figure(3, *size, 3000)
    gaussians, recipe = start(made.body, count), make_recipe(TrainConfig(sobel=0.1), count, steps=1, offset_rate=0.0)
    gaussians.light = np.float32([[0.7, 0.8, 0.7], [0.5, 0.3, 0.3], [-0.2, 0, 0.1], [0.3, 0.2, 0.2]])
    trainer = CudaTrainer(made.body, [made.shots], made.pose, made.transl, gaussians, recipe)
    shown, t, background = trainer.gaussians(), int(trainer.order[0, 0]), trainer.buffers["background"].read()[0, 0]
    got = cuda_step(trainer)
    trainer.close()

    loop = TorchTrainer(made.body, made.pose, made.transl, shown, recipe)
    placed = loop.fitted[t].clone().requires_grad_()
    loss, rgb, alpha = loop.evaluate(placed, on_device([made.shots[t]])[0], tensor(background))
    loss.backward()
    expected = {name: value.grad.cpu().numpy() for name, value in zip(PER_GAUSSIAN, loop.values, strict=True)}
    expected |= {"pose": placed.grad[:55].cpu().numpy(), "transl": placed.grad[55].cpu().numpy(), "loss": loss.item(),
                 "image": np.concatenate([rgb.detach().cpu().numpy(), alpha.detach().cpu().numpy()], 2)}
    found = {name: relative(got[name], value, int(SWAPS * count) * (name in PER_GAUSSIAN)) for name, value in expected.items()}
    assert max(found.values()) < LIMIT, found

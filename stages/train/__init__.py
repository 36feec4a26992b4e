"""train: gaussians bound to the body's faces, fitted to the frames; poses are refined on the way.

takes  split/frames, split/clip.json, segment/alpha, smplx/body.npz
gives  avatar.npz (the gaussians, with coarser levels), body.npz (the refined poses), metrics.json, heldout/ (renders beside truth)
"""

from gsac.avatar.artifacts import check_avatar, check_body, check_folder, check_json
from gsac.stages.contract import Output, Stage
from gsac.stages.train.config import TrainConfig

STAGE = Stage(
    name="train",
    inputs=("split/frames", "split/clip.json", "segment/alpha", "smplx/body.npz"),
    outputs=(
        Output("avatar.npz", check_avatar),
        Output("body.npz", check_body),
        Output("metrics.json", check_json),
        Output("heldout", check_folder),
    ),
    config=TrainConfig,
    uses_device=lambda config: True,
    packages=("numpy", "numba", "llvmlite", "scipy", "threadpoolctl", "opencv-contrib-python-headless", "OpenEXR", "torch"),
    packages_on=lambda device: ("cuda-bindings", "nvidia-cuda-nvrtc") if device == "cuda" else (),
    models=lambda config: config.models(),
    wishes=lambda config: config.wishes(),
    any_of=lambda config: config.any_of(),
    check_on=lambda config, device: config.check_on(device),
)

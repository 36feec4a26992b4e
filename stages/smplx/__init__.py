"""smplx: fits the body model to all frames of a clip at once.

takes  split/clip.json, handgap/keypoints.npz, face/face.npz, segment/alpha; split/frames for a start from a network
gives  body.npz: betas, poses, translation, focal length, joints and their sigma
`smplx.height_m` fixes the scale, which one camera cannot see; otherwise the shape prior does, with a warning.

stage.py runs the method: lm/ or paper/. Files beside them are terms and data that both use.
"""

from gsac.avatar.artifacts import check_body
from gsac.stages.contract import Output, Stage
from gsac.stages.smplx.config import SmplxConfig

STAGE = Stage(
    name="smplx",
    inputs=("split/clip.json", "split/frames", "handgap/keypoints.npz", "face/face.npz", "segment/alpha"),
    outputs=(Output("body.npz", check_body),),
    config=SmplxConfig,
    packages=("numpy", "scipy", "numba", "llvmlite", "threadpoolctl", "opencv-contrib-python-headless", "OpenEXR", "onnxruntime",
              "torch"),
    models=lambda config: config.models(),
    uses_device=lambda config: config.uses_device(),
)

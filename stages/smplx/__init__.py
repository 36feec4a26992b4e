"""smplx: fits the body model to all frames of a clip at once.

takes  split/clip.json, handgap/keypoints.npz, face/face.npz, segment/alpha
gives  body.npz: betas, poses, translation, focal length, joints and how sure each joint is
One camera cannot see scale: `smplx.height_m` fixes it, otherwise the shape prior does and the report says so.
"""

from gsac.avatar.artifacts import check_body
from gsac.stages.contract import Output, Stage
from gsac.stages.smplx.config import SmplxConfig

STAGE = Stage(
    name="smplx",
    inputs=("split/clip.json", "handgap/keypoints.npz", "face/face.npz", "segment/alpha"),
    outputs=(Output("body.npz", check_body),),
    config=SmplxConfig,
    packages=("numpy", "scipy", "numba", "torch"),
    models=lambda config: config.models(),
)

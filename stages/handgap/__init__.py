"""handgap: finds hands that were not seen or were seen in the wrong place, and fills short gaps.

takes  keypoints/keypoints.npz, split/clip.json
gives  keypoints.npz: the same arrays, plus missing (T,2) bool left/right, filled (T,133) bool, sigma (T,133) px
"""

from gsac.avatar.artifacts import check_filled_keypoints
from gsac.stages.contract import Output, Stage
from gsac.stages.handgap.config import HandgapConfig

STAGE = Stage(
    name="handgap",
    inputs=("keypoints/keypoints.npz", "split/clip.json"),
    outputs=(Output("keypoints.npz", check_filled_keypoints),),
    config=HandgapConfig,
    packages=("numpy", "scipy", "threadpoolctl"),
)

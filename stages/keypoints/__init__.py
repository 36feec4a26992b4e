"""keypoints: where the person's body, feet, face and hands are in each frame.

takes  split/frames
gives  keypoints.npz: xy (T,133,2) px in COCO-WholeBody order, score (T,133) in 0..1, world (T,133,3) m or NaN, detector,
       pose33 (T,33,3) x, y px and visibility of BlazePose's own points, face_mesh (T,468,3) px or NaN
"""

from gsac.avatar.artifacts import check_keypoints
from gsac.stages.contract import Output, Stage
from gsac.stages.keypoints.config import KeypointsConfig

STAGE = Stage(
    name="keypoints",
    inputs=("split/frames",),
    outputs=(Output("keypoints.npz", check_keypoints),),
    config=KeypointsConfig,
    packages=("numpy", "opencv-contrib-python-headless", "ai-edge-litert", "onnxruntime"),
    models=lambda config: config.models(),
    uses_device=lambda config: config.uses_device(),
)

"""segment: which part of each pixel is the person.

takes  split/frames (frames/plate.png where photos came with the empty scene), split/clip.json, keypoints/keypoints.npz
gives  alpha/%06d.exr (H, W) half, 0..1

A person network says roughly where (`network.py`), GrabCut at half size finds the outline (`grabcut.py`), the colours
on both sides of the outline give the soft edge (`edge.py`). A plate joins in at each step (`plate.py`);
a still camera's video teaches its own (`still.py`).
"""

from gsac.avatar.artifacts import check_image_folder
from gsac.stages.contract import Output, Stage
from gsac.stages.segment.config import SegmentConfig

STAGE = Stage(
    name="segment",
    inputs=("split/frames", "split/clip.json", "keypoints/keypoints.npz"),
    outputs=(Output("alpha", check_image_folder),),
    config=SegmentConfig,
    packages=("numpy", "opencv-contrib-python-headless", "ai-edge-litert", "OpenEXR"),
    models=lambda config: config.models(),
)

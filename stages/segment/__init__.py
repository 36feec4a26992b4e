"""segment: how much of each pixel is the person.

takes  split/frames (frames/plate.png where photos came with the empty scene, frames/masks where the footage came with masks),
       split/clip.json, keypoints/keypoints.npz
gives  alpha/%06d.exr (H, W) half, 0..1; with method sapiens also alpha/labels/%06d.png (H, W) 8 bit, the part of the person that
       each pixel shows (`avatar/sapiens.py` lists them), 0 where it is none

A person network finds the rough region (`network.py`), GrabCut at half size its outline (`grabcut.py`), of which the parts that
are no person are dropped (`components.py`). At full size the outline is corrected by the empty scene (`correction.py`), where the
bones tell clothes that look like it from gaps (`bones.py`). A small network of our own, which sees frame, plate, outline and
region, gives the soft edge, and alpha where the outline has lost what lies beside a bone (`edge_network.py`); the colours' course
from pixel to pixel settles where it is not sure (`matting.py`, its loops in `matting_kernels.py`).
Each step uses a plate, the empty scene, where there is one (`plate.py`); from a video of a still camera it is computed, once from
the rough regions and again from the outlines (`plate_from_video.py`). The alpha of Sapiens, a network that the user brings, is soft
already and corrected by the plate only (`avatar/sapiens.py`). Masks that the user brought stay as they are (`brought.py`).
"""

from gsac.avatar.artifacts import check_image_folder
from gsac.stages.contract import Output, Stage
from gsac.stages.segment.config import SegmentConfig

STAGE = Stage(
    name="segment",
    inputs=("split/frames", "split/clip.json", "keypoints/keypoints.npz"),
    outputs=(Output("alpha", check_image_folder),),
    config=SegmentConfig,
    packages=("numpy", "scipy", "numba", "llvmlite", "opencv-contrib-python-headless", "ai-edge-litert", "OpenEXR", "onnxruntime",
              "torch"),
    models=lambda config: config.models(),
    uses_device=lambda config: config.uses_device(),
)

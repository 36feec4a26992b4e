"""split: a clip becomes frames with true timestamps.

takes  clip: a video file, or a folder of photos, HEIC among them (optional plate.jpg or plate.png: the empty scene), or a folder
       with one video; in a folder optional masks/: a mask for each photo, or for each frame of the video
gives  frames/%06d.png (8-bit RGB), frames/plate.png where there is a plate, frames/masks/%06d.exr where there are masks,
       clip.json (artifacts.Clip)

The rotation tag is applied, interlaced video is deinterlaced, HDR is tone-mapped to SDR BT.709, transparency is composited over
black and pixels are made square; the aspect is kept. Footage taller than split.max_height is cut to the person where that shows
them larger, if the networks that find people are there (split.crop). Of a video that is cut together of several scenes one is used,
the longest that shows a person. The same input gives the same bytes.
"""

from gsac.avatar.artifacts import check_image_folder
from gsac.avatar.ffmpeg import ffmpeg_program
from gsac.stages.contract import Output, Stage
from gsac.stages.split.check import check_clip
from gsac.stages.split.config import SplitConfig

STAGE = Stage(
    name="split",
    inputs=("clip",),
    outputs=(Output("frames", check_image_folder), Output("clip.json", check_clip)),
    config=SplitConfig,
    packages=("ai-edge-litert", "av", "imageio-ffmpeg", "numpy", "opencv-contrib-python-headless", "OpenEXR", "pillow",
              "pillow-heif"),
    wishes=lambda config: config.wishes(),
    programs=lambda: {"ffmpeg": ffmpeg_program()},
)

"""face: the expression in each frame in which the face is seen, as the open body's 52 facial actions.

Lips and lids are read by the network with attention, all else by the plain face network.

takes  split/frames, split/clip.json, keypoints/keypoints.npz
gives  face.npz: valid (T,) bool, expression (T,52) in 0..1 in the order of the body's expression_names, jaw (T,3) zeros
       (the open body opens its mouth by jawOpen), shape (1404,) m the person's resting points less the average ones,
       landmarks (T,468,3) px or NaN; where a face was seen rest_expression (52,) the actions of the person's resting face,
       head_template and head_vertices (N,3) m, the average and the person's head at rest, head_faces (F,3) and the template's
       head_eyes (2,3) m: the open body's head, or, where a FLAME file is given, FLAME's, then with flame_expression (T,50) and
       flame_jaw (T,3) rad
"""

from gsac.avatar.artifacts import check_face
from gsac.stages.contract import Output, Stage
from gsac.stages.face.config import FaceConfig

STAGE = Stage(
    name="face",
    inputs=("split/frames", "split/clip.json", "keypoints/keypoints.npz"),
    outputs=(Output("face.npz", check_face),),
    config=FaceConfig,
    packages=("numpy", "opencv-contrib-python-headless", "ai-edge-litert", "flatbuffers", "onnxruntime", "torch", "scipy", "numba",
              "llvmlite"),
    models=lambda config: config.models(),
    uses_device=lambda config: config.uses_device(),
)

"""export: the trained avatar as files that other tools open.

takes  split/clip.json, train/avatar.npz, train/body.npz
gives  avatar.gsac: everything in one container (docs/gsac-format.md)
       avatar.ply: the gaussians in one pose as a standard 3DGS file
       avatar.spz: the same, compressed
       avatar.glb: skinned, textured, animated mesh; not shown beside it the gaussians, with KHR_gaussian_splatting
       avatar.fbx: skinned, textured, animated mesh with expressions, without gaussians
       viewer.html: a page that opens from disk
       unity: the Unity package, as a folder and a tarball, and with this person as a .unitypackage
"""

from gsac.avatar.artifacts import check_file, check_folder
from gsac.stages.contract import Output, Stage
from gsac.stages.export.config import ExportConfig

STAGE = Stage(
    name="export",
    inputs=("split/clip.json", "train/avatar.npz", "train/body.npz"),
    outputs=(
        Output("avatar.gsac", check_file),
        Output("avatar.ply", check_file),
        Output("avatar.spz", check_file),
        Output("avatar.glb", check_file),
        Output("avatar.fbx", check_file),
        Output("viewer.html", check_file),
        Output("unity", check_folder),
    ),
    config=ExportConfig,
    packages=("gsac", "numpy", "scipy", "numba", "llvmlite", "pillow"),
    models=lambda config: config.models(),
)

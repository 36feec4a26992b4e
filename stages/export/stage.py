"""Entry of export: makes one avatar of body and gaussians, and writes each file from it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.artifacts import Clip
from gsac.avatar.binding import bind, face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.files import write_file
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.rotation import to_wxyz
from gsac.avatar.sparse_correctives import thin_out
from gsac.stages.body_choice import load_body
from gsac.stages.contract import BadInput, Job
from gsac.stages.export.animations import add_motion
from gsac.stages.export.fbx import avatar_fbx
from gsac.stages.export.glb import glb_bytes
from gsac.stages.export.levels import MEMBERS, merge_level
from gsac.stages.export.ply import ply_bytes
from gsac.stages.export.spz import spz_bytes
from gsac.stages.export.texture import paint_surface
from gsac.stages.export.warmup import rehearse
from gsac.unity.package import write_unity
from gsac.viewer.page import page_bytes

MOVED = 1e-4
"""Least way, m, of a vertex for it to be part of an expression."""

BODY_LICENCE = "the body model's own terms; the embedded open body is CC0-1.0"


def run(job: Job) -> None:
    params = BodyParams.read(job.inputs["train/body.npz"])
    body = load_body(job, "export", params.model)
    gaussians, *trained = Gaussians.read_levels(job.inputs["train/avatar.npz"])
    for level in (gaussians, *trained):
        if not len(level) or level.face.min() < 0 or level.face.max() >= len(body.faces):
            raise BadInput(f"{job.inputs['train/avatar.npz']}: its {len(level)} gaussians must be at least one and "
                           f"lie on the faces 0..{len(body.faces) - 1} of the body; run again from the stage train")
    clip = Clip.read(job.inputs["split/clip.json"])
    avatar = rig_avatar(body, params, gaussians)
    avatar.licence = {"avatar": job.config.licence, "body": BODY_LICENCE}
    avatar.provenance = {"gsac": version("gsac"), "body_model": body.digest, "clip_sha256": clip.source_sha256}
    add_motion(avatar, job.config.clip_names())
    avatar.coarser = trained or [merge_level(avatar, members) for members in MEMBERS]

    container = avatar_bytes(avatar)
    pose = avatar.pose(job.config.ply_pose.upper())
    splats = (*pose_gaussians(avatar, pose), avatar.gaussians.rgb, avatar.gaussians.opacity)
    rest = pose_gaussians(avatar, avatar.pose("T"))
    files = {
        "avatar.gsac": lambda: container,
        "avatar.ply": lambda: ply_bytes(*splats, job.config.ply_pad_sh),
        "avatar.spz": lambda: spz_bytes(*splats),
        "avatar.glb": lambda: glb_bytes(avatar, surface.result(), *rest),
        "avatar.fbx": lambda: avatar_fbx(avatar, surface.result()),
        "viewer.html": lambda: page_bytes(container),
    }

    def write(name: str) -> None:
        write_file(job.out / name, files[name]())

    def write_package() -> None:
        (job.out / "unity").mkdir()
        write_unity(job.out / "unity", container, version("gsac"))

    with ThreadPoolExecutor() as pool:  # zlib takes longest, and releases the interpreter's lock
        surface = pool.submit(paint_surface, avatar, *rest)
        tasks = [pool.submit(write_package), *(pool.submit(write, name) for name in files)]
        for done, task in enumerate(tasks):
            job.progress(done, len(tasks), "files")
            task.result()
    job.progress(len(tasks), len(tasks), "files")


def warm(device: str) -> None:
    """Called while a stage before is at work."""
    rehearse(run)


def rig_avatar(body: Body, params: BodyParams, gaussians: Gaussians) -> RiggedAvatar:
    """The avatar at rest, with betas, joint offsets and the person's resting face applied.

    An expression of weight 1 is the full action whatever the face at rest has of it: it moves the mesh by the part that is left.
    """
    vertices, joints = body.rest(params.betas, params.rest_expression, params.joint_offset)
    left = 1 - (np.zeros(body.exprdirs.shape[2]) if params.rest_expression is None else params.rest_expression)
    moves = [np.flatnonzero(np.linalg.norm(body.exprdirs[:, :, e], axis=1) > MOVED)
             for e in range(len(body.expression_names))]
    return RiggedAvatar(
        vertices=vertices, faces=body.faces.astype(np.int32), joints=joints, parents=body.parents.astype(np.int32),
        joint_names=list(body.joint_names), skin_index=body.skin_index, skin_weight=body.skin_weight,
        expression_names=list(body.expression_names),
        expression_start=np.cumsum([0, *map(len, moves)]).astype(np.int32),
        expression_vertex=np.concatenate([*moves, []]).astype(np.int32),
        expression_delta=np.concatenate([*(left[e] * body.exprdirs[v, :, e] for e, v in enumerate(moves)), np.empty((0, 3))]),
        jaw_actions=body.jaw_actions.astype(np.float32),
        gaussians=gaussians, correctives=None if body.posedirs is None else thin_out(body.posedirs),
    )


def pose_gaussians(avatar: RiggedAvatar, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """pose: (J, 3) axis-angle. Returns means (N, 3) m, quats (N, 4) wxyz, scales (N, 3) m in canonical axes, feet at y = 0."""
    vertices = avatar.posed(pose)
    vertices = vertices - np.array([0, avatar.ground, 0], np.float32)
    g = avatar.gaussians
    bound = bind(face_frames(vertices, avatar.faces), g.face, g.mu, g.quat, g.log_scale)
    xyzw = Rotation.from_matrix(bound.rotations).as_quat()
    return bound.means, to_wxyz(xyzw).astype(np.float32), bound.scales

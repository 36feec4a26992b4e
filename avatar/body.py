"""The body model: shape, pose and skin of a person. One loader and one file layout (SMPL-X's npz keys) for every body.

B betas, E expression size, J = 55 joints in SMPL-X's order, V vertices, F faces, T frames, K = 133 keypoints.
Canonical body: metres, right-handed, y up, facing +z, left = +x, T-pose at zero rotation. Linear blend skinning with
axis-angle joint rotations, of a surface that pose correctives bend where the file has them; `global_orient` turns the body about
its pelvis joint, then `transl` moves it.
Source: SMPL-X (Pavlakos et al. 2019), eq. 1-7; `tools/open_body/bake.py` bakes the open body.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from gsac.avatar.artifacts import BODY_SHAPES, OCCLUDER_SHAPE, REST_SHAPE, ArtifactError, check_arrays, write_arrays
from gsac.avatar.body_file import read_body_file
from gsac.avatar.camera import Camera
from gsac.avatar.correctives import move_rest
from gsac.avatar.joints import POSE_PARTS, J
from gsac.avatar.skinning import joint_transforms, skin

OPEN_BODY = Path(__file__).parent / "open_body" / "open_body.npz"
LOST = 0.5
"""m: sigma of the joints that marks a frame whose fit failed; that of fitted frames is far smaller."""


@dataclass
class BodyParams:
    """Everything that poses a body over T frames: the arrays of `body.npz`."""

    betas: np.ndarray  # (B,)
    expression: np.ndarray  # (T, E)
    global_orient: np.ndarray  # (T, 3) axis-angle
    body_pose: np.ndarray  # (T, 63)
    left_hand_pose: np.ndarray  # (T, 45)
    right_hand_pose: np.ndarray  # (T, 45)
    jaw_pose: np.ndarray  # (T, 3)
    leye_pose: np.ndarray  # (T, 3)
    reye_pose: np.ndarray  # (T, 3)
    transl: np.ndarray  # (T, 3) m
    joint_offset: np.ndarray  # (55, 3) m, canonical
    joints: np.ndarray  # (T, 55, 3) m, camera frame
    focal: np.ndarray  # (2,) px
    center: np.ndarray  # (2,) px
    sigma_joints: np.ndarray  # (T, 55) m
    model: str  # digest of the body file
    rest_expression: np.ndarray | None = None  # (E,) 0..1, the person's face at rest; None: the body's neutral face
    occluder: np.ndarray | None = None  # (h, w) 0 or 1, where in the frame something hides the person all along; None: nowhere

    @classmethod
    def read(cls, path: Path) -> BodyParams:
        """From body.npz; raises `ArtifactError` where an array is missing or has another shape."""
        arrays = check_arrays(path, BODY_SHAPES, REST_SHAPE, OCCLUDER_SHAPE)
        there = {f.name: arrays[f.name] for f in fields(cls) if f.name in arrays and f.name != "model"}
        return cls(**there, model=str(arrays["model"]))

    def write(self, path: Path) -> None:
        """To body.npz, float32."""
        arrays = {f.name: np.asarray(getattr(self, f.name), np.float32) for f in fields(self)
                  if f.name != "model" and getattr(self, f.name) is not None}
        write_arrays(path, **arrays, model=np.array(self.model))

    @classmethod
    def from_pose(cls, pose: np.ndarray, transl: np.ndarray, betas: np.ndarray, expression: np.ndarray,
                  focal: float | np.ndarray, center: tuple[float, float] | np.ndarray, joint_offset: np.ndarray | None = None,
                  model: str = "") -> BodyParams:
        """A body in T poses, its `joints` zero (`Body.posed` gives them) and every frame taken as fitted.

        pose: (T, 55, 3) axis-angle; transl: (T, 3) m; betas: (B,); expression: (T, E); focal: px, scalar or (2,);
        center: (2,) px; joint_offset: (55, 3) m, zero unless given.
        """
        t = len(pose)
        return cls(
            betas=np.asarray(betas, np.float32), expression=np.asarray(expression, np.float32), **split_pose(pose),
            transl=np.asarray(transl, np.float32),
            joint_offset=np.zeros((J, 3), np.float32) if joint_offset is None else np.asarray(joint_offset, np.float32),
            joints=np.zeros((t, J, 3), np.float32), focal=np.broadcast_to(np.asarray(focal, np.float32), (2,)).copy(),
            center=np.asarray(center, np.float32), sigma_joints=np.zeros((t, J), np.float32), model=model,
        )

    @property
    def frames(self) -> int:
        """T, the number of frames."""
        return len(self.transl)

    @property
    def lost(self) -> np.ndarray:
        """(T,) bool: frames whose fit failed; training skips them."""
        return self.sigma_joints[:, 0] >= LOST

    @property
    def pose(self) -> np.ndarray:
        """(T, 55, 3) axis-angle in joint order."""
        return np.concatenate([getattr(self, name) for name in POSE_PARTS], 1).reshape(-1, J, 3)

    def camera(self, width: int, height: int) -> Camera:
        """The clip's camera for images of width x height px."""
        return Camera(tuple(map(float, self.focal)), tuple(map(float, self.center)), width, height)


def split_pose(pose: np.ndarray) -> dict[str, np.ndarray]:
    """The parts of a pose (T, 55, 3), axis-angle, under SMPL-X's names: each (T, 3 * joints) float32."""
    flat = np.asarray(pose, np.float32).reshape(len(pose), J * 3)
    return {name: flat[:, 3 * part.start:3 * part.stop] for name, part in POSE_PARTS.items()}


@dataclass
class Body:
    """A body model as loaded, the same for every kind of file."""

    v_template: np.ndarray  # (V, 3) m
    faces: np.ndarray  # (F, 3) int32
    shapedirs: np.ndarray  # (V, 3, B) m
    exprdirs: np.ndarray  # (V, 3, E) m
    J_regressor: np.ndarray  # (55, V)
    weights: np.ndarray  # (V, 55), at most four a row
    parents: np.ndarray  # (55,) int, -1 for the pelvis
    joint_names: tuple[str, ...]
    expression_names: tuple[str, ...]
    clothes: tuple[str, ...]
    """Names of the last betas, which lift clothes off the skin; empty where all betas shape the figure."""
    jaw_actions: np.ndarray  # (E, 3) expression that a jaw rotation stands for; zeros where the jaw has skin of its own
    keypoint_matrix: csr_matrix  # (133, V); an all-zero row is a keypoint that this body does not carry
    vt: np.ndarray | None  # (U, 2)
    ft: np.ndarray | None  # (F, 3) int32
    digest: str
    """sha256 of the file."""
    posedirs: np.ndarray | None = None  # (V, 3, 486) m
    """Pose correctives, as correctives.py takes them; None: the file has none."""
    hand_means: np.ndarray | None = None  # (30, 3) rad
    """The mean fingers, left hand first, at which a hand rests; at zero rotation it is flat. None: the file has none."""
    hand_components: np.ndarray | None = None  # (2, 45, 45) rad
    """Principal components of the left and the right hand, a row each, that are added to the mean; None: the file has none."""

    @classmethod
    def load(cls, path: Path | str | None = None) -> Body:
        """The open body, or an official `SMPLX_*.npz`.

        Raises `ArtifactError` naming the array that is wrong.
        """
        path = Path(path) if path else OPEN_BODY
        if not path.is_file():
            raise ArtifactError(f"{path}: there is no body model file; give an SMPLX_*.npz or leave the parameter empty")
        return cls(**read_body_file(path), digest=hashlib.sha256(path.read_bytes()).hexdigest())

    @cached_property
    def skin_index(self) -> np.ndarray:
        """(V, 4) int32 joints of each vertex, heaviest first."""
        return np.argsort(-self.weights, 1, kind="stable")[:, :4].astype(np.int32)

    @cached_property
    def skin_weight(self) -> np.ndarray:
        """(V, 4) weights, rows sum to one."""
        w = np.take_along_axis(self.weights, self.skin_index.astype(np.int64), 1)
        return (w / w.sum(1, keepdims=True)).astype(np.float32)

    @property
    def num_betas(self) -> int:
        return self.shapedirs.shape[2]

    def leading(self, betas: int) -> Body:
        """The same body with no more than that many betas; one that has clothes among them stays as it is."""
        if self.clothes or self.num_betas <= betas:
            return self
        return replace(self, shapedirs=np.ascontiguousarray(self.shapedirs[:, :, :betas]))

    @property
    def has_actions(self) -> bool:
        """Whether expressions are facial actions, each from 0 to 1, the jaw's among them; others are components without limits."""
        return bool(self.jaw_actions.any())

    @property
    def num_figure(self) -> int:
        """How many betas shape the person; those after them are the clothes."""
        return self.num_betas - len(self.clothes)

    def rest(self, betas: np.ndarray, expression: np.ndarray | None = None,
             joint_offset: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """The shaped body in T-pose: vertices (V, 3) and joints (55, 3), m. Joints follow the betas, not the expression.

        betas: (up to B,); expression: (E,), neutral unless given; joint_offset: (55, 3) m, added to the joints.
        """
        vertices = self.v_template + self.shapedirs[:, :, : len(betas)] @ np.asarray(betas, np.float32)
        joints = self.J_regressor @ vertices
        if joint_offset is not None:
            joints = joints + joint_offset
        if expression is not None and np.any(expression):
            vertices = vertices + self.express(expression)
        return np.asarray(vertices, np.float32), np.asarray(joints, np.float32)

    @cached_property
    def expressive(self) -> tuple[np.ndarray, np.ndarray]:
        """Indices (M,) of the vertices that expressions move, a quarter of the open body's, and what moves them, (M, 3, E) m."""
        moved = np.flatnonzero(self.exprdirs.any((1, 2)))
        return moved, np.ascontiguousarray(self.exprdirs[moved])

    def express(self, expression: np.ndarray) -> np.ndarray:
        """(V, 3) float32 m by which an expression, (E,), moves the vertices at rest."""
        moved, directions = self.expressive
        out = np.zeros(self.v_template.shape, np.float32)
        out[moved] = directions @ np.asarray(expression, np.float32)
        return out

    def effective_expression(self, params: BodyParams, t: int) -> np.ndarray:
        """(E,) expression of frame t. Where the body opens its mouth by expressions, those of the jaw's rotation are added."""
        return params.expression[t] + self.jaw_actions @ params.jaw_pose[t]

    def posed(self, params: BodyParams, frames: list[int] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (T, V, 3) and joints (T, 55, 3), m, camera frame, of all or the named frames."""
        frames = list(range(params.frames)) if frames is None else list(frames)
        shaped, joints = self.rest(params.betas, None, params.joint_offset)
        pose = params.pose[frames]
        transforms = joint_transforms(pose, joints, self.parents)
        vertices = np.empty((len(frames), len(shaped), 3), np.float32)
        for i, t in enumerate(frames):
            expression = self.effective_expression(params, t)
            rest = shaped + self.express(expression) if expression.any() else shaped
            vertices[i] = skin(self.correct(rest, pose[i]), transforms[i], self.skin_index, self.skin_weight) + params.transl[t]
        return vertices, self._move_joints(transforms, joints) + params.transl[frames][:, None]

    def correct(self, rest: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Vertices at rest (V, 3) m with the correctives of a pose (55, 3), axis-angle; the same array where there are none."""
        return rest if self.posedirs is None else rest + move_rest(self.posedirs, pose)

    def bend(self, rest: np.ndarray, joints: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Vertices (V, 3) m, without transl, of those at rest (V, 3) m in a pose (55, 3), axis-angle about joints (55, 3) m."""
        transforms = joint_transforms(pose[None], joints, self.parents)[0].astype(np.float32)
        return skin(self.correct(rest, pose), transforms, self.skin_index, self.skin_weight)

    def posed_joints(self, params: BodyParams) -> np.ndarray:
        """Joints (T, 55, 3) of all frames, as `posed` gives them."""
        joints = self.rest(params.betas, None, params.joint_offset)[1]
        return self._move_joints(joint_transforms(params.pose, joints, self.parents), joints) + params.transl[:, None]

    @staticmethod
    def _move_joints(transforms: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """Joints (55, 3) at rest under transforms (T, 55, 3, 4). Returns (T, 55, 3)."""
        return np.stack([np.einsum("jab,jb->ja", each[:, :, :3], joints) + each[:, :, 3] for each in transforms]).astype(np.float32)

    def keypoints(self, vertices: np.ndarray) -> np.ndarray:
        """COCO-WholeBody points (..., 133, 3) of posed vertices (..., V, 3); NaN where the body has no such point."""
        flat = np.asarray(vertices).reshape(-1, len(self.v_template), 3)
        out = np.stack([self.keypoint_matrix @ v for v in flat])
        out[:, ~self.known_keypoints] = np.nan
        return out.reshape(*np.shape(vertices)[:-2], 133, 3)

    @cached_property
    def known_keypoints(self) -> np.ndarray:
        """(133,) bool, whether the body has the keypoint."""
        return np.diff(self.keypoint_matrix.indptr) > 0

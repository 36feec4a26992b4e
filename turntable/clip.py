"""Makes a truth clip: `clip.mp4` (`frames/` for novel and strong poses), `mask/%06d.png` and `truth.npz`."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from gsac.avatar import wholebody
from gsac.avatar.artifacts import BODY_SHAPES, write_arrays
from gsac.avatar.body import BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.frame_files import write_frame, write_image
from gsac.avatar.joints import INDEX, LEFT_HAND, RIGHT_HAND, WRISTS, J
from gsac.avatar.skinning import joint_transforms
from gsac.avatar.video import Video, h264
from gsac.avatar.zbuffer import visible_points
from gsac.turntable.appearance import make_appearance
from gsac.turntable.behaviour import behave
from gsac.turntable.motion import Motion, make_motion
from gsac.turntable.options import TurntableOptions
from gsac.turntable.person import Person, make_person
from gsac.turntable.pocket import cover_hands
from gsac.turntable.render import SHADOW, Picture, Studio
from gsac.turntable.room import make_lighting, make_room
from gsac.turntable.viewpoint import Viewpoint, look_at

FEET = [INDEX["left_ankle"], INDEX["right_ankle"], INDEX["left_foot"], INDEX["right_foot"]]
"""Joints of ankles and balls of the feet."""
HIDDEN_SHARE = 0.10
"""A hand counts as hidden when a smaller share of its vertices is visible."""
TRUNK = [INDEX[name] for name in ("pelvis", "left_hip", "right_hip", "spine1", "spine2", "spine3", "neck", "left_collar",
                                  "right_collar", "head", "jaw")]
"""Joints that lie deep, unlike those of limbs; the trunk is as thick as it is at their height."""
DEEPEST = 0.18
"""m, the most that a joint of the trunk lies below the surface."""
JOINT_SLACK = 0.015
"""m, likewise for joints, beyond the thickness of their limb."""
SLACK = np.full(133, 0.025)
"""(133,) m by which a key point may lie below the drawn surface and still count as visible: inside a limb, under cloth."""
SLACK[wholebody.BODY] = 0.14
SLACK[:5] = 0.03
SLACK[wholebody.FEET] = 0.05


def make_clip(out_dir: Path | str, options: TurntableOptions | None = None,
              progress: Callable[[int, int, str], None] = lambda done, total, what: None, **changes: Any) -> Path:
    """Writes a clip into out_dir, which is created if missing. Returns the path of `clip.mp4`, or of `frames` for other poses.

    Options are a TurntableOptions or keywords: `make_clip(out, seed=3, frames=40)`. A wrong one raises ValueError.

    truth.npz: focal (2,), center (2,) px; joints (T, 55, 3) m, camera frame, joints_visible (T, 55) bool; vertices (T, V, 3) m,
    bare body (option `vertices`); keypoints (T, 133, 2) px, keypoints_visible (T, 133) bool; expression (T, 52); yaw (T,) rad;
    hidden (T, 2) bool, left and right hand; height_m; rotation (3, 3) and eye (3,), world -> camera; shift (V, 3) m of the bare
    T-pose from the shape basis; with option `drawn` the surface as drawn, drawn (T, N, 3) m, drawn_faces (F, 3), drawn_material
    (F,) into `person.MATERIALS`; and the arrays of `BodyParams`, whose posed body is the truth up to that shift.
    mask: coverage of each pixel by the person with all that is worn or held; above 127 is the silhouette.
    """
    options = options or TurntableOptions(**changes)
    options.check()
    out = Path(out_dir)
    turn = options.poses == "turn"
    keep = [out / "mask"] + ([] if turn and not options.lossless else [out / "frames"])
    for folder in keep:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    person = make_person(options, np.random.default_rng([options.seed, 1]))
    motion = make_motion(person.body, person.joints, options, np.random.default_rng([options.seed, 2]))
    behave(motion, person, options, np.random.default_rng([options.seed, 6]))
    studio = make_studio(person, options)
    params = place_person(person, motion, studio.view)
    truth = TruthRecorder(person, motion, params, studio.view, options.drawn)
    with open_video(out / "clip.mp4", options) if turn else nullcontext() as video:
        for t in range(options.frames):
            bare, drawn, joints = pose_person(person, params, t, motion.covered[t])
            picture = studio.draw(drawn, studio.view.to_world(joints[FEET]))
            frame = develop(picture, options, t, noise=turn)
            write_image(out / "mask" / f"{t:06d}.png", picture.mask)
            if video is not None:
                video.add(frame)
            if not turn or options.lossless:
                write_frame(out / "frames" / f"{t:06d}.png", frame)
            truth.add(t, bare, drawn, joints, picture)
            progress(t + 1, options.frames, "frames")
    write_arrays(out / "truth.npz", **truth.arrays(options))
    return out / ("clip.mp4" if turn else "frames")


def open_video(path: Path, options: TurntableOptions) -> Video:
    """The clip's H.264 file, of the same bytes whatever the machine's number of cores. Raises VideoError."""
    return Video(path, *options.size, options.fps, encoder=h264(options.crf, "fast", threads=1))


def make_view(person: Person, options: TurntableOptions, rng: np.random.Generator) -> Viewpoint:
    """Places the camera at a distance that keeps the arms in the picture."""
    width, height = options.size
    fill = 0.73 if options.poses == "turn" else 0.53
    camera = Camera((options.focal_px,) * 2, (width / 2, height / 2), width, height)
    distance = options.distance * options.focal_px * person.height_m / (fill * min(height, width * 16 / 9))
    eye = np.array([rng.uniform(-0.05, 0.05), rng.uniform(1.1, 1.4), distance])
    return Viewpoint(camera, look_at(eye, np.array([0, 0.5 * person.height_m, 0])), eye)


def studio_rng(options: TurntableOptions) -> np.random.Generator:
    """The random numbers of camera, light and room."""
    return np.random.default_rng([options.seed, 3])


def make_studio(person: Person, options: TurntableOptions, window: Camera | None = None) -> Studio:
    """Camera, colours, light and room of a clip. window: a camera of part of the picture, to draw that part only."""
    rng = studio_rng(options)
    view = make_view(person, options, rng)
    if window is not None:
        view.camera = window
    light = make_lighting(rng)
    room = make_room(view.camera, view.rotation.T, view.eye, light, SHADOW, rng)
    return Studio(view, make_appearance(person, np.random.default_rng([options.seed, 4])), light, room, options.supersample)


def place_person(person: Person, motion: Motion, view: Viewpoint) -> BodyParams:
    """Body parameters of the motion in the camera frame; the lowest point of each frame touches the floor."""
    pose = motion.pose.copy()
    pelvis = person.joints[0]
    transl = np.empty((len(pose), 3))
    for t in range(len(pose)):
        transforms = joint_transforms(motion.pose[t][None], person.joints, person.body.parents)[0]
        _, drawn = person.pose(transforms, motion.expression[t])
        world = np.array([motion.place[t, 0], -drawn[:, 1].min(), motion.place[t, 1]])
        transl[t] = view.to_camera(pelvis * [0, 1, 0] + world) - pelvis
        pose[t, 0] = (Rotation.from_matrix(view.rotation) * Rotation.from_rotvec(motion.pose[t, 0])).as_rotvec()
    return BodyParams.from_pose(pose, transl, person.betas, motion.expression, view.camera.focal, view.camera.center,
                                person.joint_offset, person.body.digest)


def pose_person(person: Person, params: BodyParams, t: int,
                covered: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bare body (V, 3), drawn mesh (N, 3) and joints (55, 3) of frame t, m, camera frame. covered: (2,) bool, hands in pockets."""
    transforms = joint_transforms(params.pose[t][None], person.joints, person.body.parents)[0]
    bare, drawn = person.pose(transforms, params.expression[t])
    joints = np.einsum("jab,jb->ja", transforms[..., :3], person.joints) + transforms[..., 3]
    if covered is not None and covered.any():
        drawn = cover_hands(person, bare, drawn, joints, covered)
    return bare + params.transl[t], drawn + params.transl[t], joints + params.transl[t]


def develop(picture: Picture, options: TurntableOptions, t: int, noise: bool) -> np.ndarray:
    """Frame t as (H, W, 3) uint8, with sensor noise that grows as the square root of the brightness."""
    colour = picture.colour
    if noise and options.noise:
        rng = np.random.default_rng([options.seed, 5, t])
        grain = rng.standard_normal(colour.shape, np.float32)
        colour = colour + options.noise * grain * np.sqrt(0.25 + 1.5 * colour / 255)
    return np.clip(np.round(colour), 0, 255).astype(np.uint8)


def joint_depths(person: Person) -> np.ndarray:
    """(55,) m by which each joint may lie below the drawn surface and still count as seen: its limb's thickness with clothes."""
    drawn = person.rest[person.pair[:, 0]]
    drawn = (drawn + (person.rest[person.pair[:, 1]] - drawn) * person.share[:, None])[np.unique(person.faces)]
    out = KDTree(drawn).query(person.joints, k=60)[0].mean(1) * 1.6
    for joint in TRUNK:
        away = drawn - person.joints[joint]
        level = (np.abs(away[:, 1]) < 0.03) & (np.abs(away[:, 0]) < 0.12)
        out[joint] = min(np.percentile(np.hypot(away[level, 0], away[level, 2]), 90), DEEPEST)
    return out + JOINT_SLACK


def skin_is_seen(points: np.ndarray, skin: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(n,) bool: whether any of the eight points of skin (k, 3) nearest to each point (n, 3) is seen (k,) bool."""
    return np.any(seen[KDTree(skin).query(points, k=8)[1]], axis=1)


class TruthRecorder:
    """Collects the arrays of truth.npz, frame by frame."""

    def __init__(self, person: Person, motion: Motion, params: BodyParams, view: Viewpoint, drawn: bool):
        self.person, self.motion, self.params, self.view = person, motion, params, view
        frames = params.frames
        self.vertices = np.empty((frames, len(person.body.v_template), 3), np.float32)
        self.keypoints = np.empty((frames, 133, 2), np.float32)
        self.visible = np.zeros((frames, 133), bool)
        self.hidden = np.zeros((frames, 2), bool)
        self.joints_visible = np.zeros((frames, J), bool)
        self.drawn = np.empty((frames, len(person.share), 3), np.float32) if drawn else None
        self.deep = joint_depths(person)
        self.hands = [np.flatnonzero(person.body.weights[:, [wrist, *range(J)[fingers]]].sum(1) > 0.6)
                      for wrist, fingers in zip(WRISTS, (LEFT_HAND, RIGHT_HAND), strict=True)]

    def add(self, t: int, bare: np.ndarray, drawn: np.ndarray, joints: np.ndarray, picture: Picture) -> None:
        """Records frame t. bare: (V, 3) m, bare body; drawn: (N, 3) m, with clothes; joints: (55, 3) m; all in the camera frame."""
        camera = self.view.camera
        big = camera.scaled(picture.depth.shape[1], picture.depth.shape[0])
        points = self.person.body.keypoints(bare)
        self.vertices[t] = bare
        self.params.joints[t] = joints
        self.keypoints[t] = camera.project(points)
        near = points * (1 - SLACK / np.linalg.norm(points, axis=1))[:, None]
        self.visible[t] = visible_points(near, picture.depth, big, 0.0) & self.person.body.known_keypoints
        nearer = joints * (1 - self.deep / np.linalg.norm(joints, axis=1))[:, None]
        self.joints_visible[t] = visible_points(nearer, picture.depth, big, 0.0)
        parts = zip(self.hands, wholebody.HANDS.values(), (LEFT_HAND, RIGHT_HAND), strict=True)
        for side, (hand, keys, fingers) in enumerate(parts):
            seen = visible_points(bare[hand], picture.depth, big, 0.004)
            self.hidden[t, side] = seen.mean() < HIDDEN_SHARE
            if self.motion.covered[t, side]:
                self.visible[t, keys] &= skin_is_seen(points[keys], bare[hand], seen)
                self.joints_visible[t, fingers] &= skin_is_seen(joints[fingers], bare[hand], seen)
        if self.drawn is not None:
            self.drawn[t] = drawn

    def arrays(self, options: TurntableOptions) -> dict[str, np.ndarray]:
        """The arrays of truth.npz by name, shapes (T, ...) as `make_clip` lists them."""
        p = self.params
        shaped, _ = self.person.body.rest(p.betas)
        out = {name: getattr(p, name) for name in BODY_SHAPES if name not in ("model", "sigma_joints")}
        out |= {"model": np.array(p.model), "keypoints": self.keypoints, "keypoints_visible": self.visible,
                "joints_visible": self.joints_visible, "hidden": self.hidden, "yaw": self.motion.yaw.astype(np.float32),
                "height_m": np.float32(self.person.height_m), "rotation": self.view.rotation, "eye": self.view.eye,
                "shift": self.person.rest[: len(shaped)] - shaped, "fps": np.float32(options.fps)}
        out |= {"vertices": self.vertices} if options.vertices else {}
        surface = {"drawn": self.drawn, "drawn_faces": self.person.faces.astype(np.int32), "drawn_material": self.person.material}
        return out | (surface if self.drawn is not None else {})

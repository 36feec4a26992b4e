"""Landmarks that the face network finds on made-up people with known expressions: the data of `tools/face_actions.py`.

A person's seed decides body, colours, light and room, as in any truth clip. Each of `FRAMES` frames has a random yaw, nod and
expression; only the head is drawn, at a size that differs between people, and coded as a video.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from gsac.avatar.artifacts import read_arrays, write_arrays
from gsac.avatar.body import Body
from gsac.avatar.camera import Camera
from gsac.avatar.facemesh import LEFT_EYE, MODELS, POINTS, RIGHT_EYE, Face, FaceMesh
from gsac.avatar.network_files import model_path
from gsac.avatar.region import Region
from gsac.avatar.wholebody import INDEX
from gsac.avatar.zbuffer import interpolate, rasterise
from gsac.benchmarks.face.drawing import SMALLEST, Head, Portrait
from gsac.benchmarks.perception import video_frames
from gsac.stages.face.config import ATTENTIVE, PLAIN
from gsac.stages.face.landmarks import TwoMeshes, read_averaged
from gsac.turntable.clip import FEET, develop, make_studio, make_view, open_video, place_person, pose_person, studio_rng
from gsac.turntable.motion import make_motion
from gsac.turntable.options import TurntableOptions
from gsac.turntable.person import Person, make_person

FRAMES = 44
"""Frames of a person."""
DRAWN = 2000
"""Seeds from this one on are heads of `drawing`; smaller ones are people of the turntable."""
HEIGHTS = (1200, 2800)
"""Least and largest height, px, of the whole person's picture: 35 to 80 px between the eyes."""
FRONTAL = 0.35
"""Largest yaw, rad, at which a point's pixel is taken for its place on the skin."""
MARGIN = 2.6
"""Margin of the drawn window about the eyes, in distances between them."""
EYES = [INDEX["left_eye"], INDEX["right_eye"]]


def read_people(seeds: list[int], store: Path, folder: Path) -> list[dict[str, np.ndarray]]:
    """The arrays of `Reader.read`, shapes (T, ...), for each seed; kept in `folder`, so that an interrupted run can go on."""
    reader, out = Reader(store), []
    folder.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        kept = folder / f"{seed}.npz"
        if not kept.exists():
            write_arrays(kept, **reader.read(seed, folder))
            print(f"person {seed}", flush=True)
        out.append(read_arrays(kept))
    return out


class Reader:
    """Draws people and runs the face network on them as the stage does."""

    def __init__(self, store: Path):
        self.mesh = FaceMesh({name: model_path(name, store) for name in MODELS}, threads=1)
        self.network = TwoMeshes({name: model_path(name, store) for name in (PLAIN, ATTENTIVE)})
        self.mirror: np.ndarray | None = None

    def read(self, seed: int, folder: Path) -> dict[str, np.ndarray]:
        """One person: landmarks (T, 468, 3) px, NaN where no face was found; expression (T, 52); places (468, 3) m.

        places: the points on the template's skin; NaN where no frontal frame shows them. folder: for the video, which is removed.
        """
        if seed >= DRAWN:
            return self._read_drawn(seed)
        scene = Scene.sample(seed)
        clip = folder / f"{seed}.mp4"
        scene.film(clip)
        landmarks = np.full((FRAMES, POINTS, 3), np.nan, np.float32)
        images = list(video_frames(clip))
        if self.mirror is None:
            self.mirror = find_mirror(self._find(images, scene, int(np.abs(scene.yaw).argmin())).points)
        for t, image in enumerate(images):
            face = self._find(images, scene, t)
            if face is not None:
                landmarks[t] = self._look(image, face)
        clip.unlink()
        return {"landmarks": landmarks, "expression": scene.expression, "places": scene.locate(landmarks)}

    def _read_drawn(self, seed: int) -> dict[str, np.ndarray]:
        """As `read`, of a head of `drawing`; places are all NaN, the turntable's people give them."""
        rng, body = np.random.default_rng([seed, 77]), Body.load()
        head = Head(body, rng.normal(0, 1, body.num_figure), Portrait.sample(rng))
        share = float(np.exp(rng.uniform(np.log(SMALLEST), 0)))
        expression = np.array([sample_expression(body.expression_names, rng) for _ in range(FRAMES)], np.float32)
        turn = Rotation.from_euler("ZXY", rng.normal(0, 1, (FRAMES, 3)) * [0.08, 0.18, 0])
        yaw = rng.uniform(-1, 1, FRAMES)
        turn = (Rotation.from_euler("Y", yaw[:, None]) * turn).as_matrix()
        landmarks = np.full((FRAMES, POINTS, 3), np.nan, np.float32)
        for t in np.argsort(np.abs(yaw)):
            image = head.draw(turn[t], expression[t], share, rng)
            side = float(len(image))
            face = self.mesh.find(image, Region((side / 2, side / 2), side))
            if face is None:
                continue
            if self.mirror is None:
                self.mirror = find_mirror(face.points)
            landmarks[t] = self._look(image, face)
        return {"landmarks": landmarks, "expression": expression, "places": np.full((POINTS, 3), np.nan, np.float32)}

    def _look(self, image: np.ndarray, face: Face) -> np.ndarray:
        """Landmarks (468, 3) px, NaN where the network finds no face. image: (H, W, 3) uint8."""
        seen = read_averaged(self.network, image, face.points, self.mirror)
        return seen.points if seen.presence >= 0.5 else np.full((POINTS, 3), np.nan)

    def _find(self, images: list[np.ndarray], scene: Scene, t: int) -> Face | None:
        """The face in frame t, searched for around the true eyes."""
        middle = scene.eyes[t] - scene.corner
        return self.mesh.find(images[t], Region((float(middle[0]), float(middle[1])), 6 * scene.apart))


@dataclasses.dataclass
class Scene:
    """One person of the turntable in T random poses of the head."""

    person: Person
    options: TurntableOptions
    expression: np.ndarray  # (T, 52)
    yaw: np.ndarray  # (T,) rad
    frames: list[tuple[np.ndarray, np.ndarray, np.ndarray]]  # T times bare (V, 3), drawn (N, 3), joints (55, 3), of `pose_person`
    eyes: np.ndarray  # (T, 2) px of the whole picture, middle of both eyes
    apart: float  # px, largest distance between the eyes
    corner: np.ndarray  # (2,) px, the window's first pixel in the whole picture
    window: Camera  # of the part of the picture that is drawn

    @classmethod
    def sample(cls, seed: int) -> Scene:
        """Draws the person of a seed."""
        rng = np.random.default_rng([seed, 77])
        height = int(np.exp(rng.uniform(*np.log(HEIGHTS))) // 2 * 2)
        options = TurntableOptions(seed=seed, height=height, frames=FRAMES)
        person = make_person(options, np.random.default_rng([seed, 1]))
        motion = make_motion(person.body, person.joints, options, np.random.default_rng([seed, 2]))
        yaw, nod, tilt = rng.uniform(-1, 1, FRAMES), rng.normal(0, 0.16, FRAMES).clip(-0.35, 0.35), rng.normal(0, 0.08, FRAMES)
        pose, names = motion.pose.copy(), list(person.body.joint_names)
        pose[:, 0] = Rotation.from_euler("Y", yaw[:, None]).as_rotvec()
        turned = np.stack([nod / 2, rng.normal(0, 0.1, FRAMES), tilt], 1)
        pose[:, names.index("head")] = Rotation.from_euler("XYZ", turned).as_rotvec()
        pose[:, names.index("neck")] = Rotation.from_euler("X", (nod / 2)[:, None]).as_rotvec()
        expression = np.array([sample_expression(person.body.expression_names, rng) for _ in range(FRAMES)], np.float32)
        motion = dataclasses.replace(motion, pose=pose, yaw=yaw, expression=expression)
        view = make_view(person, options, studio_rng(options))
        params = place_person(person, motion, view)
        frames = [pose_person(person, params, t) for t in range(FRAMES)]
        eyes = np.array([view.camera.project(person.body.keypoints(bare))[EYES] for bare, _, _ in frames])
        apart = float(np.linalg.norm(eyes[:, 0] - eyes[:, 1], axis=-1).max())
        middle = eyes.mean(1)
        low = np.maximum(np.floor(middle.min(0) - MARGIN * apart).astype(int), 0)
        high = np.minimum(np.ceil(middle.max(0) + MARGIN * apart).astype(int), options.size)
        width, height = (int(n) for n in (high - low) // 2 * 2)
        center = tuple(np.asarray(view.camera.center) - low)
        return cls(person, options, expression, yaw, frames, middle, apart, low,
                   Camera(view.camera.focal, center, width, height))

    def film(self, clip: Path) -> None:
        """Writes the window as a video."""
        studio = make_studio(self.person, self.options, self.window)
        options = dataclasses.replace(self.options, width=self.window.width, height=self.window.height)
        with open_video(clip, options) as video:
            for t, (_, drawn, joints) in enumerate(self.frames):
                picture = studio.draw(drawn, studio.view.to_world(joints[FEET]))
                video.add(develop(picture, options, t, noise=True))

    def locate(self, landmarks: np.ndarray) -> np.ndarray:
        """Places (468, 3) m on the template's skin, median over frontal frames, NaN without one.

        landmarks: (T, 468, 3) px in the window.
        """
        body: Body = self.person.body
        found = np.full((FRAMES, POINTS, 3), np.nan, np.float32)
        for t in np.flatnonzero((np.abs(self.yaw) < FRONTAL) & np.isfinite(landmarks[:, 0, 0])):
            face_id, bary, _ = rasterise(self.frames[t][0].astype(np.float32), body.faces, self.window)
            x, y = np.floor(landmarks[t, :, :2]).astype(int).T
            x, y = x.clip(0, self.window.width - 1), y.clip(0, self.window.height - 1)
            hit = face_id[y, x][None]
            on = interpolate(body.v_template.astype(np.float32), body.faces, np.maximum(hit, 0), bary[y, x][None])[0]
            found[t] = np.where((hit[0] >= 0)[:, None], on, np.nan)
        some = np.isfinite(found[..., 0]).any(0)
        out = np.full((POINTS, 3), np.nan, np.float32)
        out[some] = np.nanmedian(found[:, some], axis=0)
        return out


def sample_expression(names: tuple[str, ...], rng: np.random.Generator) -> np.ndarray:
    """Random facial actions (52,) in 0..1.

    8 % are neutral; 47 % mix talking, smiling, brows and lids as truth clips do, but independently; the rest have one to five
    random actions, mostly on both sides.
    """
    out, index = np.zeros(len(names)), {name: i for i, name in enumerate(names)}

    def put(value: float, *actions: str) -> None:
        for action in actions:
            out[index[action]] = np.clip(value, 0, 1)

    kind = rng.random()
    if kind < 0.08:
        return out
    if kind < 0.55:
        put(0.08 + rng.normal(0, 0.25), "jawOpen")
        smile = 0.25 + rng.normal(0, 0.35)
        put(smile + rng.normal(0, 0.05), "mouthSmileLeft")
        put(smile + rng.normal(0, 0.05), "mouthSmileRight")
        put(0.5 * smile, "cheekSquintLeft", "cheekSquintRight")
        brow = rng.normal(0, 0.4)
        put(brow, "browInnerUp", "browOuterUpLeft", "browOuterUpRight")
        put(-0.8 * brow, "browDownLeft", "browDownRight")
        put(rng.normal(0, 0.25), "mouthPucker")
        put(rng.normal(0, 0.2), "mouthFunnel")
        put(rng.choice([0, 0, 0, 0.5, 1, 0.6]), "eyeBlinkLeft", "eyeBlinkRight")
        return out
    groups = sorted({name.removesuffix("Left").removesuffix("Right") if name.endswith(("Left", "Right")) else name
                     for name in names})
    for group in rng.choice(groups, rng.integers(1, 6), replace=False):
        members = [name for name in names if name in (group, f"{group}Left", f"{group}Right")]
        value, both = rng.uniform(0, 1), len(members) == 2
        if both and rng.random() < 0.25:
            members, both = [members[rng.integers(2)]], False
        for member in members:
            put(value + (rng.normal(0, 0.05) if both else 0), member)
    if rng.random() < 0.4:
        put(rng.uniform(0, 1), "jawOpen")
    return out


def find_mirror(points: np.ndarray) -> np.ndarray:
    """Index (468,) of each landmark's mirror image, an involution. points: (468, 3) px of a nearly symmetric face."""
    across = points[LEFT_EYE] - points[RIGHT_EYE]
    across /= np.linalg.norm(across)
    centred = points - (points[LEFT_EYE] + points[RIGHT_EYE]) / 2
    mirrored = centred - 2 * (centred @ across)[:, None] * across
    cost = np.linalg.norm(centred[:, None] - mirrored[None], axis=-1)
    pair = linear_sum_assignment(cost + cost.T)[1]
    return np.where(pair[pair] == np.arange(len(pair)), pair, np.arange(len(pair)))

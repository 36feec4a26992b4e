"""Motion of the person: one turn on the spot, novel poses, strong ones. World: y up, person at the origin, camera at +z."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from gsac.avatar.body import Body
from gsac.avatar.joints import INDEX, J, turn_joints
from gsac.avatar.skinning import joint_transforms
from gsac.turntable.footsteps import plant_feet
from gsac.turntable.options import TurntableOptions

SIDES = {"left": 1.0, "right": -1.0}
"""Side -> sign of its x in the body's axes."""


@dataclass
class Motion:
    """Pose, place and expression of T frames."""

    pose: np.ndarray
    """(T, 55, 3) axis-angle in SMPL-X order; the first turns the person in the world."""
    place: np.ndarray
    """(T, 2) m, world x and z of the pelvis."""
    yaw: np.ndarray
    """(T,) rad, 0 faces the camera, growing to the person's left."""
    expression: np.ndarray
    """(T, 52) in 0..1."""
    covered: np.ndarray = field(init=False)
    """(T, 2) bool, left and right hand: under the cloth of a pocket."""

    def __post_init__(self) -> None:
        self.covered = np.zeros((len(self.pose), 2), bool)


def make_motion(body: Body, joints: np.ndarray, options: TurntableOptions, rng: np.random.Generator) -> Motion:
    """joints: (55, 3) m, the person's joints in the T-pose."""
    make = {"turn": _make_turn, "novel": _make_novel, "strong": _make_strong}[options.poses]
    return make(body, joints, options, rng)


def _make_turn(body: Body, joints: np.ndarray, options: TurntableOptions, rng: np.random.Generator) -> Motion:
    """One uneven turn in the A-pose."""
    T = options.frames
    s = np.arange(T) / T
    uneven = options.sway * (0.018 * np.sin(2 * np.pi * (2 * s + rng.random())) + 0.009 * np.sin(
        2 * np.pi * (5 * s + rng.random())))
    yaw = 2 * np.pi * (s + uneven - uneven[0])
    pose = np.repeat(make_a_pose(rng)[None], T, 0)
    stir(pose, options.arm_swing, rng)
    if options.feet == "turning":
        lift_feet(pose, yaw, options.sway)
    if options.hidden_hand != "none":
        hide_hand(pose, body.parents, joints, options)
    turns = Rotation.from_euler("YX", np.stack([yaw, smooth_noise(rng, T, 0.015 * options.sway)], 1))
    pose[:, 0] = turns.as_rotvec()
    place = np.stack([smooth_noise(rng, T, 0.03 * options.sway), smooth_noise(rng, T, 0.03 * options.sway)], 1)
    if options.feet == "planted":
        plant_feet(pose, joints, yaw, place, turns.as_matrix())
    return Motion(pose, place, yaw, make_expressions(body, options, rng))


def _make_novel(body: Body, joints: np.ndarray, options: TurntableOptions, rng: np.random.Generator) -> Motion:
    """`NOVEL_POSES` one after another, smoothly blended, while the yaw swings slowly."""
    T = options.frames
    rest = make_a_pose(rng)
    keys = [turn_joints(rest, change) for change in NOVEL_POSES]
    at = np.linspace(0, len(keys), T, endpoint=False)
    first = at.astype(int)
    blend = smoothstep(np.clip((at - first - 0.35) / 0.65, 0, 1))[:, None, None]
    keys = np.stack(keys)
    pose = keys[first] * (1 - blend) + keys[(first + 1) % len(keys)] * blend
    stir(pose, options.arm_swing, rng)
    yaw = 0.9 * np.sin(2 * np.pi * np.arange(T) / T * 2 + rng.random())
    lean = pose[:, 0].copy()
    pose[:, 0] = (Rotation.from_euler("Y", yaw[:, None]) * Rotation.from_rotvec(lean)).as_rotvec()
    return Motion(pose, np.zeros((T, 2)), yaw, make_expressions(body, options, rng))


def _make_strong(body: Body, joints: np.ndarray, options: TurntableOptions, rng: np.random.Generator) -> Motion:
    """`STRONG_POSES` over and over, each frame turned on from the one before."""
    T = options.frames
    rest = make_a_pose(rng)
    pose = np.stack([turn_joints(rest, STRONG_POSES[t % len(STRONG_POSES)]) for t in range(T)])
    yaw = STRONG_TURN * np.arange(T)
    pose[:, 0] = (Rotation.from_euler("Y", yaw[:, None]) * Rotation.from_rotvec(pose[:, 0])).as_rotvec()
    return Motion(pose, np.zeros((T, 2)), yaw, make_expressions(body, options, rng))


def make_a_pose(rng: np.random.Generator) -> np.ndarray:
    """A-pose (55, 3) axis-angle: arms 25-35 degrees from the body, elbows and fingers slightly bent, feet apart."""
    pose = np.zeros((J, 3))
    away = np.radians(rng.uniform(25, 35))
    feet = np.radians(rng.uniform(-4, -2))  # the T-pose stands astride
    for side, sign in SIDES.items():
        pose[INDEX[f"{side}_collar"]] = [0, 0, -sign * 0.06]
        pose[INDEX[f"{side}_shoulder"]] = (
            Rotation.from_euler("z", -sign * (np.pi / 2 - away - 0.06)) * Rotation.from_euler("x", 0.1)).as_rotvec()
        pose[INDEX[f"{side}_elbow"]] = [0, -sign * rng.uniform(0.22, 0.34), 0]
        pose[INDEX[f"{side}_hip"]] = [0, sign * 0.1, sign * feet]
        pose[INDEX[f"{side}_ankle"]] = [0, 0.05 * sign, -sign * feet]
        for finger, curl in (("index", 0.16), ("middle", 0.2), ("ring", 0.24), ("pinky", 0.26)):
            for k, share in ((1, 1.0), (2, 1.5), (3, 0.8)):
                pose[INDEX[f"{side}_{finger}{k}"]] = [0, 0, -sign * curl * share * rng.uniform(0.8, 1.2)]
        pose[INDEX[f"{side}_thumb2"]] = [0, -sign * 0.15, 0]
        pose[INDEX[f"{side}_thumb3"]] = [0, -sign * 0.2, 0]
    return pose


STIR = {"spine1": 1.0, "spine2": 1.0, "spine3": 1.2, "neck": 1.6, "head": 2.4, "collar": 0.8, "shoulder": 3.5,
        "elbow": 3.5, "wrist": 4.0, "index1": 4.0, "middle1": 3.0, "ring1": 3.0, "pinky1": 4.0, "thumb1": 3.0}
"""Joint -> standard deviation of its small motion about each axis, degrees."""


def stir(pose: np.ndarray, amount: float, rng: np.random.Generator) -> None:
    """Adds smooth small motion to pose (T, 55, 3), in place. amount: factor on `STIR`."""
    for name, i in INDEX.items():
        degrees = STIR.get(name.removeprefix("left_").removeprefix("right_"))
        if degrees:
            for axis in range(3):
                pose[:, i, axis] += smooth_noise(rng, len(pose), np.radians(degrees) * amount)


def lift_feet(pose: np.ndarray, yaw: np.ndarray, amount: float) -> None:
    """Adds small steps on the spot, one every 30 degrees, left and right alternately.

    pose: (T, 55, 3), changed in place; yaw: (T,) rad; amount: factor on the height of the steps.
    """
    for side, phase in (("left", 0.0), ("right", np.pi)):
        lift = amount * np.clip(np.sin(6 * yaw + phase), 0, None) ** 2
        pose[:, INDEX[f"{side}_hip"], 0] -= 0.16 * lift
        pose[:, INDEX[f"{side}_knee"], 0] += 0.34 * lift
        pose[:, INDEX[f"{side}_ankle"], 0] -= 0.10 * lift


def hide_hand(pose: np.ndarray, parents: np.ndarray, joints: np.ndarray, options: TurntableOptions) -> None:
    """Moves one hand behind the back, or in front of the belly, between the times `options.hidden`.

    pose: (T, 55, 3), changed in place; parents: (55,) of the joints; joints: (55, 3) m, T-pose.
    """
    side, where = options.hidden_hand.split("_")
    sign = SIDES[side]
    back = where == "back"
    depth = -0.12 if back else 0.19
    target = joints[INDEX["spine1"]] + [sign * 0.10, 0.0, depth]
    chain = [INDEX[f"{side}_{name}"] for name in ("shoulder", "elbow", "wrist")]
    hand, knuckle, elbow = chain[2], INDEX[f"{side}_middle1"], chain[1]
    start = pose[0].copy()
    start[0] = 0
    aim = start[chain].copy()
    aim[0] = Rotation.from_euler("zy", [-sign * 1.15, sign * (0.4 if back else -0.3)]).as_rotvec()
    aim[1] = [0, -sign * 1.6, 0] if not back else [0, -sign * 1.2, 0]
    shoulder = joints[INDEX[f"{side}_shoulder"]]
    elbow_goal = shoulder + [sign * 0.17, -0.22, -0.12 if back else 0.02]

    def residuals(x: np.ndarray) -> np.ndarray:
        """Of the rotations x (9,): place and direction of the hand, place of the elbow, distance from `aim`, bend of the wrist."""
        trial = start.copy()
        trial[chain] = x.reshape(3, 3)
        a = joint_transforms(trial[None], joints, parents)[0]
        at = {j: a[j, :, :3] @ joints[j] + a[j, :, 3] for j in (hand, knuckle, elbow)}
        along = at[knuckle] - at[hand]
        across = along / np.linalg.norm(along) - np.array([-0.7 * sign, -0.7, 0])
        return np.concatenate([(at[hand] - target) * 30, across * 1.0, (at[elbow] - elbow_goal) * 4,
                               (x - aim.ravel()) * 0.15, x[6:] * 0.8])

    goal = least_squares(residuals, aim.ravel()).x.reshape(3, 3)
    s = np.arange(len(pose)) / len(pose)
    ramp = 0.10
    arrive, leave = options.hidden
    gone = smoothstep(np.clip((s - arrive + ramp) / ramp, 0, 1)) * smoothstep(np.clip((leave + ramp - s) / ramp, 0, 1))
    pose[:, chain] += gone[:, None, None] * (goal - start[chain])


def make_expressions(body: Body, options: TurntableOptions, rng: np.random.Generator) -> np.ndarray:
    """Facial actions (T, 52) in 0..1: talking, smiling, moving brows, and a blink every 6 to 13 frames."""
    T = options.frames
    out = np.zeros((T, len(body.expression_names)), np.float32)
    if not options.expression:
        return out
    names = {n: i for i, n in enumerate(body.expression_names)}

    def set_to(curve: np.ndarray, *actions: str) -> None:
        for a in actions:
            out[:, names[a]] = np.clip(curve, 0, 1)

    set_to(0.08 + smooth_noise(rng, T, 0.22, 4), "jawOpen")
    smile = 0.25 + smooth_noise(rng, T, 0.35, 2)
    set_to(smile + smooth_noise(rng, T, 0.05), "mouthSmileLeft")
    set_to(smile + smooth_noise(rng, T, 0.05), "mouthSmileRight")
    set_to(0.5 * smile, "cheekSquintLeft", "cheekSquintRight")
    brow = smooth_noise(rng, T, 0.4, 2)
    set_to(brow, "browInnerUp", "browOuterUpLeft", "browOuterUpRight")
    set_to(-brow * 0.8, "browDownLeft", "browDownRight")
    set_to(smooth_noise(rng, T, 0.25, 3), "mouthPucker")
    set_to(smooth_noise(rng, T, 0.2, 2), "mouthFunnel")
    blink = np.zeros(T)
    at = int(rng.integers(2, 6))
    while at < T:
        for k, v in ((-1, 0.5), (0, 1.0), (1, 0.6)):
            if 0 <= at + k < T:
                blink[at + k] = v
        at += int(rng.integers(6, 14))
    set_to(blink, "eyeBlinkLeft", "eyeBlinkRight")
    return out


def smooth_noise(rng: np.random.Generator, frames: int, scale: float, cycles: int = 3) -> np.ndarray:
    """Smooth periodic noise (frames,) of standard deviation `scale`: four random waves, of up to `cycles` + 1 periods a clip."""
    s = np.arange(frames) / frames
    waves = [np.sin(2 * np.pi * (k * s + rng.random())) * rng.uniform(0.5, 1) for k in (1, 2, cycles, cycles + 1)]
    return scale * np.sum(waves, 0) * 0.9


def smoothstep(x: np.ndarray) -> np.ndarray:
    """Smoothstep (n,) of x (n,) in 0..1."""
    return x * x * (3 - 2 * x)


NOVEL_POSES = (
    {},
    {"hip": (-55, 12, 10), "knee": (75, 0, 0), "ankle": (-25, 0, 0), "spine1": (15, 0, 0), "spine2": (10, 0, 0),
     "pelvis": (20, 0, 0), "shoulder": (0, -75, -10), "elbow": (0, -15, 0)},
    {"shoulder": (0, 0, 45), "collar": (0, 0, 15), "elbow": (0, -15, 0), "head": (-12, 0, 0)},
    {"left_shoulder": (0, -70, 8), "left_elbow": (0, -10, 0), "spine2": (8, -12, 0), "left_hip": (-15, 0, 3),
     "left_knee": (20, 0, 0)},
    {"spine1": (0, 14, 0), "spine2": (0, 14, 0), "spine3": (0, 14, 0), "neck": (0, -10, 0), "shoulder": (0, -30, -30),
     "elbow": (0, -70, 0)},
    {"shoulder": (0, 0, 0), "elbow": (0, -4, 0), "spine2": (0, 0, 10)},
    {"right_shoulder": (0, 20, -30), "right_elbow": (0, 95, 0), "right_hip": (-60, 0, -6), "right_knee": (80, 0, 0)},
)
"""Degrees, axis-angle: stand, squat, arms raised, reach, twist, T-pose with a side bend, knee up."""

STRONG_POSES = (
    {"shoulder": (-9, -34, -29), "elbow": (0, -115, 0), "hip": (-45, 12, 8), "knee": (60, 0, 0), "ankle": (-20, 0, 0)},
    {"collar": (0, 0, 18), "shoulder": (0, 0, 62), "elbow": (0, -12, 0)},
    {"right_shoulder": (-70, 9, -13), "right_elbow": (0, 105, 0), "right_wrist": (0, 0, 15)},
    {"shoulder": (46, 6, -50), "elbow": (0, -105, 0), "wrist": (0, 0, -20)},
    {"hip": (-110, 20, 15), "knee": (125, 0, 0), "ankle": (-30, 0, 0), "pelvis": (25, 0, 0), "shoulder": (0, -75, -10)},
    {"left_hip": (15, 0, 0), "left_knee": (120, 0, 0), "shoulder": (0, -80, 25), "elbow": (0, -120, 0)},
)
"""Degrees, axis-angle: guard, both arms up, wave, hands on hips, deep squat, heel to seat with hands to the shoulders."""
STRONG_TURN = np.radians(135)
"""Yaw between two frames: in twelve frames each pose is seen from two sides, and all together from eight."""

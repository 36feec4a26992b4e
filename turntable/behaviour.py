"""What people do while they are filmed: hands in pockets, on the hips, in the hair, arms crossed, a phone, a look down, a talk."""

from __future__ import annotations

import numpy as np

from gsac.avatar.joints import INDEX, WRISTS
from gsac.turntable.motion import Motion, smooth_noise, smoothstep
from gsac.turntable.options import TurntableOptions
from gsac.turntable.person import Person
from gsac.turntable.reach import CHAIN, Goal, reach

RAMP = 0.10
"""Share of the clip that arriving and leaving take each."""
RAISED = 0.10
"""m off the body at which a hand passes on its way."""
COVERED = 0.9
"""Share of the way from which on a hand that goes into a pocket is under the cloth."""
POCKET = Goal("hip", (0.080, -0.115, 0.062), (-0.1, -0.97, 0.12), (-0.8, 0, -0.6), (0.10, -0.26, -0.09), 0.06, under=True)
HIP = Goal("hip", (0.115, 0.06, 0.075), (-0.15, -0.45, 0.85), (-0.93, -0.1, -0.3), (0.22, -0.20, -0.10), 0.2)
HAIR = Goal("head", (0.045, 0.165, -0.03), (-0.45, 0.25, -0.85), (-0.25, -0.9, -0.1), (0.22, 0.17, 0.06), 0.25, under=True)
INNER = Goal("spine2", (-0.125, 0.02, 0.20), (-0.95, 0.1, -0.25), (0, -0.1, -1), (0.10, -0.25, 0.09), 0.15)
OUTER = Goal("spine2", (-0.17, 0.12, 0.245), (-0.9, 0.3, -0.3), (-0.2, -0.1, -1), (0.10, -0.24, 0.10), 0.2)
PHONE = Goal("spine2", (0.07, 0.16, 0.31), (-0.35, 0.75, 0.45), (-0.3, 0.5, -0.85), (0.05, -0.27, 0.02), 0.45)
TALK = Goal("spine2", (0.19, -0.02, 0.36), (-0.2, 0.3, 0.9), (-0.75, 0.5, 0), (0.13, -0.25, 0.04), 0.25)

REACHES = {
    "left_pocket": (("left", POCKET),), "right_pocket": (("right", POCKET),), "pockets": (("left", POCKET), ("right", POCKET)),
    "left_hip": (("left", HIP),), "right_hip": (("right", HIP),), "hips": (("left", HIP), ("right", HIP)),
    "left_hair": (("left", HAIR),), "right_hair": (("right", HAIR),),
    "crossed": (("left", INNER), ("right", OUTER), ("left", INNER)), "left_phone": (("left", PHONE),),
    "right_phone": (("right", PHONE),), "talking": (("left", TALK), ("right", TALK)),
}
"""Behaviour -> its hands, one after the other, each out of the way of the others; the first may have to give way again."""
BOWED = {"looking_down": {"neck": 20.0, "head": 24.0, "spine3": 5.0}, "phone": {"neck": 12.0, "head": 16.0}}
"""Behaviour -> joints of spine and head that it bends forward, degrees."""
CALM = [INDEX[name] for name in ("spine1", "spine2", "spine3")]
"""Joints that rest while a hand lies on the body."""
GESTURE = {"shoulder": 0.025, "elbow": 0.09, "wrist": 0.14, "head": 0.05}
"""Joint -> rad, standard deviation of its motion while talking."""


def behave(motion: Motion, person: Person, options: TurntableOptions, rng: np.random.Generator) -> None:
    """Adds the behaviour of the options to a motion, in place."""
    what = options.behaviour
    there = share_of_way(options)
    reaches = REACHES.get(what, ())
    pose = motion.pose
    start = pose[0].copy()
    start[0] = 0
    if reaches:
        start[CALM] = 0
        pose[:, CALM] *= 1 - there[:, None, None]
    goal, via = start, start
    for side, wanted in reaches:
        goal = reach(person, goal, side, wanted)
        via = reach(person, via, side, wanted.raised(RAISED))
    for k, (side, wanted) in enumerate(dict(reaches).items()):
        late = 0.25 * k if what == "crossed" else 0.0
        moving = [INDEX[f"{side}_{name}"] for name in CHAIN] + fingers_of(side)
        go_by_way(pose, moving, via, goal, np.clip(there * (1 + late) - late, 0, 1))
        if wanted is POCKET:
            motion.covered[:, WRISTS.index(INDEX[f"{side}_wrist"])] = there >= COVERED
    for name, degrees in BOWED.get(what.split("_")[-1] if "phone" in what else what, {}).items():
        pose[:, INDEX[name], 0] += np.radians(degrees) * there
    if what == "talking":
        gesture(motion, person, there, rng)
    if what == "looking_down" or "phone" in what:
        names = list(person.body.expression_names)
        for action in ("eyeLookDownLeft", "eyeLookDownRight"):
            motion.expression[:, names.index(action)] = 0.6 * there


def share_of_way(options: TurntableOptions) -> np.ndarray:
    """(T,) 0..amount: how far the behaviour is reached, smooth in time."""
    s = np.arange(options.frames) / options.frames
    start, stop = options.behaviour_from, options.behaviour_to
    rise, fall = (smoothstep(np.clip(x / RAMP, 0, 1)) for x in (s - start + RAMP, stop + RAMP - s))
    return options.behaviour_amount * rise * fall


def go_by_way(pose: np.ndarray, moving: list[int], via: np.ndarray, goal: np.ndarray, share: np.ndarray) -> None:
    """Turns joints from where they are past `via` to `goal`, both (55, 3). pose: (T, 55, 3), in place; share: (T,) of the way."""
    first, second = np.clip(share * 2, 0, 1)[:, None, None], np.clip(share * 2 - 1, 0, 1)[:, None, None]
    there = via[moving] + (goal[moving] - via[moving]) * second
    pose[:, moving] += (there - pose[:, moving]) * first


def gesture(motion: Motion, person: Person, there: np.ndarray, rng: np.random.Generator) -> None:
    """Moves hands, head and mouth of one who talks. there: (T,) share."""
    frames = len(motion.pose)
    for name, i in INDEX.items():
        amount = GESTURE.get(name.removeprefix("left_").removeprefix("right_"))
        if amount:
            for axis in range(3):
                motion.pose[:, i, axis] += there * smooth_noise(rng, frames, amount, max(4, frames // 8))
    names = list(person.body.expression_names)
    for action, most in (("jawOpen", 0.7), ("mouthFunnel", 0.4), ("mouthPucker", 0.3)):
        at = names.index(action)
        motion.expression[:, at] = np.clip(motion.expression[:, at] + there * rng.uniform(0, most, frames), 0, 1)


def fingers_of(side: str) -> list[int]:
    """The joints of a hand's fingers, without the thumb's."""
    return [INDEX[f"{side}_{finger}{k}"] for finger in ("index", "middle", "ring", "pinky") for k in (1, 2, 3)]

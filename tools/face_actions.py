"""Measures how the face network answers to facial actions; writes `stages/face/actions.npz`.

    python tools/face_actions.py STORE FOLDER

STORE is the cache folder that `gsac models pull` filled; the people that are drawn and looked at stay in FOLDER (10 s each).

What the network's points do differs from what the skin under them does: it slides along lips and lids, damps what it seldom saw,
and answers differently from the side. One linear model says what it says: of every person, view and action, all at once,

    points = neutral + view(direction) + person + sum_k action_k (response_k0 + yaw response_k1 + yaw^2 response_k2) + wavering

and what is left is the wavering, coordinate by coordinate with all others. `channels` are the sums of coordinates that still
tell the actions apart once the wavering is made white: in them it has spread one and the actions are found by least squares.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.linalg import solve_triangular

from gsac.avatar.artifacts import write_arrays
from gsac.avatar.body import Body
from gsac.avatar.facemesh import POINTS, Face
from gsac.benchmarks.face_people import looks_of, mirror_of
from gsac.stages.face.actions import TABLE, prior_sigma, view_terms, yaw_terms
from gsac.stages.face.head import AXES, fit_similarity
from gsac.stages.face.landmarks import align
from gsac.stages.smplx.head import closest, head_vertices, incident

SEEDS = [*range(1000, 1036), *range(2000, 2024)]
"""People of the turntable, of no truth clip that anything else is chosen or judged on, and drawn ones."""
ANGLE = np.radians(55)
"""Heads turned farther away are no faces to the stage."""
CHANNELS = 64
PULL_VIEW, PULL_PERSON, PULL_OWN_VIEW, PULL_FRONT, PULL_TURNED = 1e-3, 0.3, 3.0, 0.6, 2.0
"""Pulls to zero of what is solved for, in frames."""
OWN_WAVERING, LEAST_WAVERING = 0.05, 0.02
"""Share of the wavering that is a coordinate's own, and mm of it that each has at least: what a few thousand looks cannot tell."""
OWN_SHARE, LEAST_OWN = 0.3, 0.11
"""The same of the persons' differences."""
OWN_VIEW = 0.1
"""How much of the variance with which a person's rest changes with yaw is granted: all of it takes slow brows for it."""


class Looks:
    """All frames of all people and of their mirror images, N in all."""

    def __init__(self, people: list[dict], neutral: np.ndarray, mirror: np.ndarray, names: tuple[str, ...]):
        other = [names.index(n.replace("Left", "?").replace("Right", "Left").replace("?", "Right")) for n in names]
        points, direction, expression, person = [], [], [], []
        for k, one in enumerate(people):
            seen = np.isfinite(one["landmarks"][:, 0, 0])
            faces = [Face(p.astype(float), 1.0) for p in one["landmarks"][seen]]
            aligned, looks = (np.array(a) for a in zip(*[align(f.points, neutral, f.facing()) for f in faces], strict=True))
            near = looks[:, 2] >= np.cos(ANGLE)
            mm, looks, said = ((aligned - neutral) * 1e3)[near], looks[near], one["expression"][seen][near].astype(float)
            points += [mm, mm[:, mirror] * [-1, 1, 1]]
            direction += [looks, looks * [-1, 1, 1]]
            expression += [said, said[:, other]]
            person += [np.full(len(mm), 2 * k), np.full(len(mm), 2 * k + 1)]
        self.points = np.concatenate(points).reshape(-1, POINTS * 3) * np.tile(AXES, POINTS)
        self.direction, self.expression, self.person = (np.concatenate(a) for a in (direction, expression, person))


def fitted(looks: Looks, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """`rest` (1404,), `view` (10, 1404), `response` (3, E, 1404) mm, as `Actions` has them but for the axes' weights; `own`
    (2K, 1404) of each person and `left` (N, 1404)."""
    N, E, people = len(looks.points), len(names), looks.person.max() + 1
    acts = (yaw_terms(looks.direction)[:, :, None] * looks.expression[:, None]).reshape(N, -1)
    design = np.hstack([np.ones((N, 1)), view_terms(looks.direction), np.eye(people)[looks.person], acts])
    pull = np.repeat([1e-6, PULL_VIEW, PULL_PERSON, PULL_FRONT, PULL_TURNED], [1, 10, people, E, 2 * E])
    found = np.linalg.solve(design.T @ design + np.diag(pull), design.T @ looks.points)
    rest, view, own, response = np.split(found, [1, 11, 11 + people])
    left = looks.points - design @ found
    return {"rest": rest[0], "view": view, "own": own, "response": response.reshape(3, E, -1), "left": left}


def channels_of(fit: dict[str, np.ndarray], looks: Looks, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """`channels` (C, 1404), `persons` (3, C, C), and `own` and `wavering` (1404,) mm, for points weighted by the axes."""
    people = looks.person.max() + 1
    # each person's rest again, now that the actions are known, and how it changes with yaw: none of it counts as wavering
    rest, terms = fit["left"] + fit["own"][looks.person], yaw_terms(looks.direction)
    own, left, spent = np.empty((people, 3, rest.shape[1])), np.empty_like(rest), 0.0
    for k in range(people):
        mine = looks.person == k
        normal = terms[mine].T @ terms[mine] + np.diag([PULL_PERSON, PULL_OWN_VIEW, PULL_OWN_VIEW])
        own[k] = np.linalg.solve(normal, terms[mine].T @ rest[mine])
        left[mine] = rest[mine] - terms[mine] @ own[k]
        spent += np.trace(np.linalg.solve(normal, terms[mine].T @ terms[mine]))
    covariance = left.T @ left / (len(left) - spent)
    wavering = np.diag(covariance).copy()
    covariance = (1 - OWN_WAVERING) * covariance + np.diag(OWN_WAVERING * wavering + LEAST_WAVERING**2)
    lower = np.linalg.cholesky(covariance)
    loud = solve_triangular(lower, fit["response"].reshape(-1, len(lower)).T, lower=True).T
    loud = loud.reshape(3, len(names), -1) * prior_sigma(names)[:, None]
    _, _, ways = np.linalg.svd(loud.reshape(-1, len(lower)), full_matrices=False)
    channels = solve_triangular(lower, ways[:CHANNELS].T, lower=True, trans="T").T.astype(np.float16).astype(float)
    told = (own - own.mean(0)) @ channels.T  # (people, 3, C)
    persons = np.einsum("pka,pkb->kab", told, told) / people
    alone = np.stack([np.diag(np.diag(p)) for p in persons])
    persons = (1 - OWN_SHARE) * persons + OWN_SHARE * alone + LEAST_OWN**2 * channels @ channels.T
    persons[1:] *= OWN_VIEW
    return {"channels": channels, "persons": persons, "own": own[:, 0].std(0), "wavering": np.sqrt(wavering)}


def where(people: list[dict], mirror: np.ndarray, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Corners (468, 3) and shares (468, 3): where on the open body's skin the network's points lie, the median over people."""
    places = np.array([p["places"] for p in people])
    both = np.concatenate([places, places[:, mirror] * [-1, 1, 1]])
    skin = head_vertices(body)
    faces = body.faces[skin[body.faces].all(1)]
    used = np.unique(faces)
    faces = np.searchsorted(used, faces)
    _, corners, share = closest(np.nanmedian(both, axis=0), body.v_template[used].astype(float), faces, incident(faces, len(used)))
    return used[corners], share


def first_frame(people: list[dict], places: np.ndarray, mirror: np.ndarray) -> np.ndarray:
    """(468, 3) m, y up, z out of the face, about the root of the nose: the calmest frontal face of the first person, symmetric, as
    large as places (468, 3) m."""
    person = people[0]
    seen = np.isfinite(person["landmarks"][:, 0, 0])
    faces, moved = person["landmarks"][seen].astype(float), person["expression"][seen].sum(1)
    calm = np.argmin([abs(Face(points, 1.0).yaw) + 0.1 * much for points, much in zip(faces, moved, strict=True)])
    points = faces[calm] * [1, -1, -1]
    turn, size, shift = fit_similarity(points, places)
    points = size * points @ turn.T
    points = (points + points[mirror] * [-1, 1, 1]) / 2
    return points - points[168]


def measure(people: list[dict]) -> dict[str, np.ndarray]:
    """The arrays of `Actions`, in half precision where they are differences."""
    body = Body.load()
    names = tuple(body.expression_names)
    calm = people[0]["landmarks"][np.isfinite(people[0]["landmarks"][:, 0, 0])]
    mirror = mirror_of(min((Face(p.astype(float), 1.0) for p in calm), key=lambda face: abs(face.yaw)).points)
    corner, share = where(people, mirror, body)
    neutral = first_frame(people, np.einsum("lk,lkc->lc", share, body.v_template[corner].astype(float)), mirror)
    weight = np.tile(AXES, POINTS)
    for _ in range(2):  # everybody's rest is found in the frame of one, then in its own
        looks = Looks(people, neutral, mirror, names)
        fit = fitted(looks, names)
        neutral = neutral + (fit["rest"] / weight).reshape(POINTS, 3) / 1e3
    found = channels_of(fit, looks, names)

    channels = (found["channels"] * weight).reshape(-1, POINTS, 3)

    def points(a: np.ndarray) -> np.ndarray:
        return (a / weight).reshape(*a.shape[:-1], POINTS, 3).astype(np.float16)

    return {"neutral": neutral.astype(np.float32), "mirror": mirror.astype(np.int16), "names": np.array(names),
            "view": points(fit["view"]), "response": points(fit["response"]), "own": points(found["own"]),
            "wavering": points(found["wavering"]), "channels": channels.astype(np.float16),
            "persons": found["persons"].astype(np.float32), "corner": corner.astype(np.int16), "share": share.astype(np.float16)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("store", type=Path)
    parser.add_argument("folder", type=Path)
    asked = parser.parse_args()
    write_arrays(TABLE, **measure(looks_of(SEEDS, asked.store, asked.folder)))


if __name__ == "__main__":
    main()

"""Measures the face network's response to facial actions; writes `stages/face/actions.npz`.

    python tools/face_actions.py STORE FOLDER

STORE is the cache folder that `gsac models pull` filled; the people's landmarks are kept in FOLDER (10 s each).

The network's points do not follow the skin exactly: they slide along lips and lids, damp rare actions, and respond differently from
the side. One linear model of the points is fitted to all people, views and actions at once:

    points = neutral + view(direction) + person + sum_k action_k (response_k0 + yaw response_k1 + yaw^2 response_k2) + wavering

The wavering is noise with a full covariance over all coordinates. `channels` are the linear combinations of coordinates that still
tell the actions apart after whitening: in them the noise has a standard deviation of one, and actions follow by least squares.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.linalg import solve_triangular

from gsac.avatar.artifacts import write_arrays
from gsac.avatar.body import Body
from gsac.avatar.facemesh import POINTS, Face
from gsac.benchmarks.face.people import find_mirror, read_people
from gsac.stages.face.actions import TABLE, prior_sigma, view_terms, yaw_terms
from gsac.stages.face.head import AXES, fit_similarity
from gsac.stages.face.landmarks import align
from gsac.stages.smplx.paper.head import find_closest, find_incident_faces, select_head

SEEDS = [*range(1000, 1036), *range(2000, 2024)]
"""Turntable people that no other choice or judgement uses, and drawn heads."""
ANGLE = np.radians(55)
"""Largest yaw, rad, at which the stage reads a face."""
CHANNELS = 64
PULL_VIEW, PULL_PERSON, PULL_OWN_VIEW, PULL_FRONT, PULL_TURNED = 1e-3, 0.3, 3.0, 0.6, 2.0
"""Ridges on the unknowns, in frames."""
OWN_WAVERING, LEAST_WAVERING = 0.05, 0.02
"""Shrinkage of the noise covariance to its diagonal, and noise (mm) added to each coordinate: too few frames for all of it."""
OWN_SHARE, LEAST_OWN = 0.3, 0.11
"""The same for the covariance of people's differences."""
OWN_VIEW = 0.1
"""Factor on the variance of a person's change with yaw: with all of it, slow brows are taken for that change."""


class Looks:
    """N frames: all frames of all people, and their mirror images.

    points: (N, 1404) mm from neutral, weighted by the axes; direction: (N, 3), in which the face looks; expression: (N, E);
    person: (N,) index, a mirror image counts as another person.
    """

    def __init__(self, people: list[dict[str, np.ndarray]], neutral: np.ndarray, mirror: np.ndarray, names: tuple[str, ...]):
        """people: of `read_people`; neutral: (468, 3) m; mirror: (468,) of `find_mirror`; names: of the E actions."""
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


def fit_model(looks: Looks, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Solves the linear model, mm weighted by the axes.

    Returns `rest` (1404,), `view` (10, 1404), `response` (3, E, 1404), `own` (P, 1404) of P people, and residuals `left` (N, 1404).
    """
    N, E, people = len(looks.points), len(names), looks.person.max() + 1
    acts = (yaw_terms(looks.direction)[:, :, None] * looks.expression[:, None]).reshape(N, -1)
    design = np.hstack([np.ones((N, 1)), view_terms(looks.direction), np.eye(people)[looks.person], acts])
    pull = np.repeat([1e-6, PULL_VIEW, PULL_PERSON, PULL_FRONT, PULL_TURNED], [1, 10, people, E, 2 * E])
    found = np.linalg.solve(design.T @ design + np.diag(pull), design.T @ looks.points)
    rest, view, own, response = np.split(found, [1, 11, 11 + people])
    left = looks.points - design @ found
    return {"rest": rest[0], "view": view, "own": own, "response": response.reshape(3, E, -1), "left": left}


def find_channels(fit: dict[str, np.ndarray], looks: Looks, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """`channels` (C, 1404), their covariances `persons` (3, C, C), standard deviations `own` and `wavering` (1404,) mm.

    fit: arrays of `fit_model`.
    """
    people = looks.person.max() + 1
    # refit each person's rest and its change with yaw, now that the actions are known: neither counts as wavering
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


def place_points(people: list[dict[str, np.ndarray]], mirror: np.ndarray, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Places the network's points on the body's skin, median over people: vertices (468, 3) and barycentric shares (468, 3).

    people: of `read_people`; mirror: (468,).
    """
    places = np.array([p["places"] for p in people])
    both = np.concatenate([places, places[:, mirror] * [-1, 1, 1]])
    skin = select_head(body)
    faces = body.faces[skin[body.faces].all(1)]
    used = np.unique(faces)
    faces = np.searchsorted(used, faces)
    _, corners, share = find_closest(np.nanmedian(both, axis=0), body.v_template[used].astype(float), faces,
                                     find_incident_faces(faces, len(used)))
    return used[corners], share


def start_neutral(people: list[dict[str, np.ndarray]], places: np.ndarray, mirror: np.ndarray) -> np.ndarray:
    """A first neutral face (468, 3) m, y up, z out of the face, root of the nose at the origin.

    The calmest frontal face of the first person, made symmetric. places: (468, 3) m on the skin, for the size; mirror: (468,).
    """
    person = people[0]
    seen = np.isfinite(person["landmarks"][:, 0, 0])
    faces, moved = person["landmarks"][seen].astype(float), person["expression"][seen].sum(1)
    calm = np.argmin([abs(Face(points, 1.0).yaw) + 0.1 * much for points, much in zip(faces, moved, strict=True)])
    points = faces[calm] * [1, -1, -1]
    turn, size, shift = fit_similarity(points, places)
    points = size * points @ turn.T
    points = (points + points[mirror] * [-1, 1, 1]) / 2
    return points - points[168]


def measure(people: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The arrays of `Actions` by name, shapes (..., 468, 3) as there; differences in half precision. people: of `read_people`."""
    body = Body.load()
    names = tuple(body.expression_names)
    calm = people[0]["landmarks"][np.isfinite(people[0]["landmarks"][:, 0, 0])]
    mirror = find_mirror(min((Face(p.astype(float), 1.0) for p in calm), key=lambda face: abs(face.yaw)).points)
    corner, share = place_points(people, mirror, body)
    neutral = start_neutral(people, np.einsum("lk,lkc->lc", share, body.v_template[corner].astype(float)), mirror)
    weight = np.tile(AXES, POINTS)
    for _ in range(2):  # points are aligned with one person's neutral face, then with the mean one
        looks = Looks(people, neutral, mirror, names)
        fit = fit_model(looks, names)
        neutral = neutral + (fit["rest"] / weight).reshape(POINTS, 3) / 1e3
    found = find_channels(fit, looks, names)

    channels = (found["channels"] * weight).reshape(-1, POINTS, 3)

    def unweighted(a: np.ndarray) -> np.ndarray:
        """a: (..., 1404). Returns (..., 468, 3) float16."""
        return (a / weight).reshape(*a.shape[:-1], POINTS, 3).astype(np.float16)

    return {"neutral": neutral.astype(np.float32), "mirror": mirror.astype(np.int16), "names": np.array(names),
            "view": unweighted(fit["view"]), "response": unweighted(fit["response"]), "own": unweighted(found["own"]),
            "wavering": unweighted(found["wavering"]), "channels": channels.astype(np.float16),
            "persons": found["persons"].astype(np.float32), "corner": corner.astype(np.int16), "share": share.astype(np.float16)}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python tools/face_actions.py", description=__doc__.splitlines()[0])
    parser.add_argument("store", type=Path, metavar="STORE", help="cache folder that `gsac models pull` filled")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="keeps the people's landmarks; 10 s each")
    asked = parser.parse_args()
    write_arrays(TABLE, **measure(read_people(SEEDS, asked.store, asked.folder)))


if __name__ == "__main__":
    main()

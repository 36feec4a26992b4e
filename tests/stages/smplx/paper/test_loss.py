"""The terms of the published loss."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gsac.avatar.joints import NAMES
from gsac.stages.smplx.initial import estimate_start
from gsac.stages.smplx.paper.loss import Objective, Unknowns, box_person
from support.turning_person import FOCAL, HEIGHT, WIDTH, facing_person, sightings_of

pytestmark = pytest.mark.slow


def test_joint_offsets_of_both_sides_are_drawn_together(body):
    sightings = sightings_of(body, facing_person(body), seconds=False)
    center = np.array([WIDTH / 2, HEIGHT / 2])
    objective = Objective(body, sightings, estimate_start(body, sightings, FOCAL, center), center)
    unknowns = Unknowns(objective.start, torch.tensor([[0, 0, 2.4]] * 4), body.num_betas)
    losses = []
    for right in (torch.tensor([-0.01, 0.02, 0.0]), torch.tensor([0.01, 0.02, 0.0])):
        unknowns.joint_offset[18], unknowns.joint_offset[19] = torch.tensor([0.01, 0.02, 0.0]), right
        list(unknowns.open_batch(slice(0, 4), True, False))
        objective.target = objective.project(moved(objective, unknowns), slice(0, 4)).detach()
        losses.append(float(objective.loss(unknowns, slice(0, 4), 1.0).detach()))
    assert losses[0] + 0.02 / 24 == pytest.approx(losses[1], abs=2e-6)
    pairs = {(NAMES[a], NAMES[b]) for a, b in zip(objective.left, objective.right, strict=True)}
    assert ("left_wrist", "right_wrist") in pairs and len(pairs) == 24


def moved(objective, unknowns):
    rest = objective.kinematics.joints(unknowns.betas, unknowns.offsets())
    world, place = objective.kinematics.pose(unknowns.local(slice(0, 4)), rest)
    return objective.points.at(world, place, rest, unknowns.betas) + unknowns.batch[3][:, None]


def test_the_farther_of_two_hands_that_lie_on_each_other_does_not_count(body):
    sightings = sightings_of(body, facing_person(body), seconds=False)
    center = np.array([WIDTH / 2, HEIGHT / 2])
    objective = Objective(body, sightings, estimate_start(body, sightings, FOCAL, center), center)
    n = len(objective.known)
    x, uv = torch.zeros(1, n, 3), torch.rand(1, n, 2)
    left, right = objective.hands
    uv[0, right] = uv[0, left]
    x[0, left, 2], x[0, right, 2] = 2.0, 2.3
    count = objective.uncover(x, uv, slice(0, 1))[0]
    assert not count[right].any() and count[objective.wrists[1]] == 0
    assert count.sum() == n - len(right) - 1
    uv[0, right] += 5
    assert objective.uncover(x, uv, slice(0, 1)).all()


def test_the_square_holds_the_person_at_any_resolution(body):
    sightings = sightings_of(body, facing_person(body), seconds=False)
    corner, side = box_person(sightings)
    xy = sightings.xy[0][sightings.seen[0]]
    at = (xy - corner[0]) / side[0]
    assert at.min() == pytest.approx((1 - 1 / 1.5) / 2, abs=1e-5) and at.max() == pytest.approx(1 - (1 - 1 / 1.5) / 2, abs=1e-5)

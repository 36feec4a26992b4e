"""The published loss, against a plain transcription of its formulas over all vertices (GSAC eq. 5-8, ExAvatar's fitting)."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gsac.stages.smplx.initial import estimate_start
from gsac.stages.smplx.paper.head import Head
from gsac.stages.smplx.paper.loss import Objective, box_person
from gsac.stages.smplx.paper.torch_body import to_matrices
from support.turning_person import FOCAL, HEIGHT, WIDTH, facing_person, head_of, sightings_of

pytestmark = pytest.mark.slow

torch.set_num_threads(1)  # as fit_clip does

CENTER = np.array([WIDTH / 2, HEIGHT / 2])
ALL = slice(0, 2)
NAMES = ("betas", "joint_offset", "face_offset", "root", "body", "hands", "transl")


@pytest.fixture(scope="module")
def case(body):
    """An objective with a head, and unknowns somewhere beside the start."""
    rng = np.random.default_rng(7)
    betas = np.append(rng.normal(0, 1, body.num_figure), np.zeros(len(body.clothes)))
    sightings = sightings_of(body, facing_person(body, 2), noise=3.0, seconds=False, face=head_of(body, betas))
    sightings.face["valid"] = np.array([True, False])
    start = estimate_start(body, sightings, FOCAL, CENTER)
    objective = Objective(body, sightings, start, CENTER)
    unknowns = objective.unknowns(start.transl)
    torch.manual_seed(0)
    for name in ("root", "body", "hands"):
        getattr(unknowns, name).add_(0.1 * torch.randn(getattr(unknowns, name).shape))
    unknowns.betas[: body.num_figure] = 0.3 * torch.randn(body.num_figure)
    unknowns.joint_offset[:], unknowns.face_offset[:] = 0.01 * torch.randn(55, 3), 0.003 * torch.randn(objective.head.count, 3)
    list(unknowns.open_batch(ALL, False, True))
    return objective, unknowns, sightings, start, Head.from_arrays(sightings.face, body)


def pose(body, local, betas, offset, face=None, index=None):
    """Vertices (T, V, 3) about the origin of transl, and the pelvis (3,)."""
    shaped = torch.tensor(body.v_template).double() + torch.tensor(body.shapedirs).double() @ betas
    joints = torch.tensor(body.J_regressor).double() @ shaped + offset
    if face is not None:
        shaped = shaped.index_add(0, torch.tensor(index), face)
    out = []
    for turns in local:
        world, place = [turns[0]], [joints[0]]
        for j in range(1, 55):
            p = int(body.parents[j])
            world.append(world[p] @ turns[j])
            place.append(place[p] + world[p] @ (joints[j] - joints[p]))
        moved = sum(torch.tensor(body.weights[:, j: j + 1]).double() * ((shaped - joints[j]) @ world[j].T + place[j])
                    for j in range(55))
        out.append(moved)
    return torch.stack(out), joints[0]


def transcribe(body, case, values, warm_up):
    objective, unknowns, sightings, start, head = case
    known = np.flatnonzero(body.known_keypoints)
    matrix = torch.tensor(body.keypoint_matrix[known].toarray()).double()
    local = torch.cat([to_matrices(values["root"]), to_matrices(values["body"]), unknowns.face[ALL].double(),
                       to_matrices(values["hands"])], 1)
    fixed = torch.ones(55, 1).double()
    fixed[:3] = 0
    offset = values["joint_offset"] * fixed
    init = torch.tensor(start.local)
    with torch.no_grad():
        mesh_init, root_init = pose(body, init, values["betas"], offset)
        placed = mesh_init + values["transl"][:, None]
        centre = placed[:, body.weights[:, [15, 22]].sum(1) > 0.5].mean(1)
        look, sight = (matrix @ placed)[:, [1, 2]].mean(1) - centre, centre
        cos = torch.nn.functional.cosine_similarity(look[:, [0, 2]], sight[:, [0, 2]])
        faces = ((cos < np.cos(3 * np.pi / 4)) & torch.tensor(sightings.face["valid"])).double()
    corner, side = (torch.tensor(a).double() for a in box_person(sightings))
    target = (torch.tensor(sightings.xy[:, known]).double() - corner[:, None]) / side[:, None, None] * 8
    weight = torch.tensor(sightings.seen[:, known]).double()
    if not warm_up:
        weight[:, torch.tensor((known >= 23) & (known < 91))] *= faces[:, None]
    total = 0
    for face in (None, values["face_offset"]):
        x = matrix @ pose(body, local, values["betas"], offset, face, head.index)[0] + values["transl"][:, None]
        uv = FOCAL * x[..., :2] / x[..., 2:] + torch.tensor(CENTER)
        uv = (uv - corner[:, None]) / side[:, None, None] * 8
        total = total + ((uv - target).abs() * weight[..., None]).mean()
    if warm_up:
        return total
    mesh, root = pose(body, local, values["betas"], offset)
    total = total + 0.1 * ((mesh - root) - (mesh_init - root_init)).abs().mean() + 0.1 * (local - init).abs().mean()
    angle = torch.arccos((local.diagonal(dim1=-2, dim2=-1).sum(-1) - 1) / 2)
    bend = (local[..., 2, 1] - local[..., 1, 2]) / 2 * angle / torch.sin(angle)
    total = total + (bend[:, [3, 6, 9, 12, 15]] ** 2).mean() + 0.01 * (values["betas"] ** 2).sum() / 100
    hold = torch.ones(55, 1).double()
    hold[25:] = 10
    total = total + 100 * (hold * offset**2).mean()
    names = list(body.joint_names)
    pairs = [(names.index(n), names.index("right_" + n[5:])) for n in names if n.startswith("left_")]
    mirror = torch.tensor([-1.0, 1, 1]).double()
    total = total + torch.stack([(offset[a] - offset[b] * mirror).abs().sum() for a, b in pairs]).mean()
    rest = (torch.tensor(body.v_template).double() + torch.tensor(body.shapedirs).double() @ values["betas"])[head.index]
    own, aim = rest + values["face_offset"], torch.tensor(head.vertices)
    near = [set() for _ in own]
    for a, b, c in head.faces:
        near[a] |= {b, c}
        near[b] |= {a, c}
        near[c] |= {a, b}
    average = torch.zeros(len(own), len(own)).double()
    for i, others in enumerate(near):
        average[i, list(others)] = 1 / max(len(others), 1)
    lap = ((own - average @ own) - (aim - average @ aim)) ** 2
    edges = torch.cat([((own[head.faces[:, i]] - own[head.faces[:, j]]).norm(dim=1)
                        - (aim[head.faces[:, i]] - aim[head.faces[:, j]]).norm(dim=1)).abs() for i, j in ((0, 1), (0, 2), (1, 2))])
    seen = faces.mean()
    total = total + seen * (10 * ((own - own.mean(0)) - (aim - aim.mean(0))).abs().mean() + 10000 * lap.mean() + edges.mean())
    terms = objective.head
    other = (values["face_offset"][terms.other_corners] * terms.other_share.double()[..., None]).sum(1)
    return total + (values["face_offset"] - other * mirror).abs().sum(1).mean()


@pytest.mark.parametrize("warm_up", [True, False])
def test_the_loss_and_its_gradient_are_the_formulas(body, case, warm_up):
    objective, unknowns = case[:2]
    leaves = dict(zip(NAMES, (unknowns.betas, unknowns.joint_offset, unknowns.face_offset, *unknowns.batch), strict=True))
    values = {name: leaf.detach().double().requires_grad_() for name, leaf in leaves.items()}
    expected, found = transcribe(body, case, values, warm_up), objective.loss(unknowns, ALL, 10.0, warm_up)
    assert float(found.detach()) == pytest.approx(float(expected.detach()), rel=1e-5)
    for loss, ends in ((expected, values), (found, leaves)):
        for leaf in ends.values():
            leaf.grad = None
        loss.backward()
    for name in NAMES:
        shared = slice(body.num_figure if name == "betas" else None)  # clothes do not move our points
        wanted = values[name].grad[shared]
        np.testing.assert_allclose(leaves[name].grad.double()[shared], wanted, atol=1e-4 * max(float(wanted.abs().max()), 1e-3))


def test_the_other_side_of_each_head_vertex_is_its_mirror_image(body, case):
    terms, head = case[0].head, case[4]
    rest = body.v_template[head.index]
    found = (rest[terms.other_corners] * terms.other_share.numpy()[..., None]).sum(1)
    assert np.percentile(np.linalg.norm(found - rest * [-1, 1, 1], axis=1), 95) < 0.002
    even = torch.tensor(np.abs(rest[:, :1]) * [[0.0, 1, 1]], dtype=torch.float32)
    assert float(terms.asymmetry(even)) < 0.1 * float(terms.asymmetry(even * torch.sign(torch.tensor(rest[:, :1]))))

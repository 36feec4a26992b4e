"""The body under the gaussians as something to touch in Unity: rays meet it, capsules stand for its parts."""

import numpy as np
import pytest

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def met(play, mono, files, given, tmp_path_factory):
    """Rays (R, 2, 3), hits (R, 12) as Touch.Rays dumps them, joints that it names, world vertices (V, 3), the avatar, what the
    first ray meets within half a metre."""
    folder = tmp_path_factory.mktemp("rays")
    rng = np.random.default_rng(4)
    eyes = np.array([.4, 1.2, -.7]) + 3 * _unit(rng.normal(size=(40, 3)))
    aims = np.array([.4, 1.2, -.7]) + rng.normal(size=(40, 3)) * (.25, .45, .15)
    rays = np.stack([eyes, _unit(aims - eyes)], 1).astype(np.float32)
    np.savetxt(folder / "rays.txt", rays.reshape(1, -1), "%.9g")
    *joints, near = play("rays", files / "person.gsac", files / "person.txt", folder / "rays.txt", folder / "hits").splitlines()
    got = mono.arrays(folder / "hits")
    world = got["world"].reshape(-1, 3).astype(float)
    return rays.astype(float), got["hits"].reshape(-1, 12), joints, world, given("person")[0], near


def _unit(rows):
    return rows / np.linalg.norm(rows, axis=-1, keepdims=True)


def crossings(origin, ahead, corners):
    """Distance (F,) of a ray to triangles (F, 3, 3), infinite where it misses, by solving for the corners' shares."""
    a, b, c = corners.transpose(1, 0, 2)
    system = np.stack([np.broadcast_to(-ahead, a.shape), b - a, c - a], 2)
    t, u, v = np.linalg.solve(system, (origin - a)[..., None])[..., 0].T
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0), t, np.inf)


def test_a_ray_meets_the_nearest_face_of_the_posed_body_or_nothing(met):
    rays, hits, joints, world, avatar, near = met
    corners = world[avatar.faces]
    away = np.array([crossings(*ray, corners) for ray in rays])
    there = np.isfinite(away).any(1)
    assert 8 < there.sum() < 36, "some meet and some pass by"
    np.testing.assert_array_equal(hits[:, 0] == 1, there)
    np.testing.assert_allclose(hits[there, 1], away[there].min(1), atol=1e-5)
    np.testing.assert_array_equal(hits[there, 2], away[there].argmin(1))
    assert all((joint == "nothing") != ok for joint, ok in zip(joints, there, strict=True))
    assert near == "False", "half a metre is not far enough"


def test_a_hit_says_place_normal_and_the_joint_that_moves_the_place_most(met):
    rays, hits, joints, world, avatar, _ = met
    for (origin, ahead), hit, joint in zip(rays, hits, joints, strict=True):
        if not hit[0]:
            continue
        corners, shares = avatar.faces[int(hit[2])], hit[3:6]
        assert abs(shares.sum() - 1) < 1e-5
        np.testing.assert_allclose(hit[6:9], shares @ world[corners], atol=1e-5)
        np.testing.assert_allclose(hit[6:9], origin + hit[1] * ahead, atol=1e-5)
        sides = np.diff(world[corners], axis=0)
        assert abs(sides @ hit[9:12]).max() < 1e-5 and hit[9:12] @ ahead < 0 and abs(np.linalg.norm(hit[9:12]) - 1) < 1e-5
        pull = np.zeros(len(avatar.joints))
        np.add.at(pull, avatar.skin_index[corners], shares[:, None] * avatar.skin_weight[corners])
        assert pull[avatar.joint_names.index(joint)] > pull.max() - 1e-5


def test_capsules_hold_the_parts_of_the_body_and_little_more(play, files, given):
    avatar = given("person")[0]
    *lines, _, _ = play("colliders", files / "person.gsac", files / "figure.gsac").splitlines()
    vertices = avatar.vertices * (-1, 1, 1) - (0, avatar.ground, 0)
    part = avatar.skin_index[np.arange(len(vertices)), avatar.skin_weight.argmax(1)]
    off, parts = np.full(len(vertices), np.nan), set()
    for line in lines:
        joint = avatar.joint_names.index(line.split()[0])
        *ends, radius = map(float, line.split()[1:])
        a, b = np.reshape(ends, (2, 3))
        mine = vertices[part == joint]
        t = np.clip((mine - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0, 1)
        off[part == joint] = np.linalg.norm(mine - a - t[:, None] * (b - a), axis=1) - radius
        parts.add(joint)
    assert len(parts) == len(lines) > 40 and parts == set(np.flatnonzero(np.bincount(part, minlength=55) >= 8))
    known = off[np.isfinite(off)]
    print(f"outside: {np.quantile(known, [.9, .99, 1])} m, mean depth below the surface {-known.mean():.3f} m")
    assert np.quantile(known, .95) < .01 and -known.mean() < .03


def test_colliders_follow_another_person_in_ones_place_and_go_with_their_component(play, files):
    told = play("colliders", files / "person.gsac", files / "figure.gsac").splitlines()[-2:]
    assert told == ["kept True anew True old gone True joint kept True", "off 0 foreign nothing"]

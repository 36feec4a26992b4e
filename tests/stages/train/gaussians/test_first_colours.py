import json

import numpy as np
import pytest

from gsac.avatar.light import shade
from gsac.stages.train.gaussians.first_colours import Sight, find_light, mean_colours
from gsac.stages.train.stage import run

LAMP = np.tile([[0.8], [0.3], [0.1], [0.2]], 3)


def turning(frames, span, noise=0.02, seed=0, count=400):
    """What a camera at +z sees of points on a ball that turns by `span` rad under LAMP, their colours and places."""
    random = np.random.default_rng(seed)
    rgb = random.uniform(0.1, 0.7, (count, 3))
    normals = random.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sights = []
    for angle in np.arange(frames) / frames * span:
        c, s = np.cos(angle), np.sin(angle)
        n = normals @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
        which = np.flatnonzero(n[:, 2] > 0.1)
        colour = rgb[which] * shade(LAMP, n[which]) + random.normal(0, noise, (len(which), 3))
        sights.append(Sight(which, colour, n[which], n[which, 2] ** 2))
    return sights, rgb, 0.2 * normals


def scaled(light, sights):
    """The light at mean 1 over what was seen."""
    weight = sum(s.weight.sum() for s in sights)
    return light / (sum((s.weight[:, None] * shade(light, s.normal)).sum(0) for s in sights) / weight)


def test_the_light_of_a_turn_is_found():
    """But its part from above less well, of which a person who stays upright says nothing, but colours do."""
    sights, _, places = turning(24, 2 * np.pi)
    off = np.abs(find_light(sights, places) - scaled(LAMP, sights))
    assert off[[0, 1, 3]].max() < 0.04
    assert off[2].max() < 0.1


def test_with_the_light_told_apart_the_colours_are_nearer_to_the_surfaces_own():
    sights, rgb, places = turning(24, 2 * np.pi)
    even, seen = mean_colours(sights, 400)
    told, _ = mean_colours(sights, 400, find_light(sights, places))

    def spread(colours):
        """How unevenly the found colours follow the true ones."""
        return np.std(colours[seen] / rgb[seen], axis=0).mean()
    assert spread(told) < 0.8 * spread(even)


def test_without_a_turn_the_light_is_even_all_round_and_comes_from_above():
    sights, _, places = turning(10, 0.0)
    light = find_light(sights, places)
    assert np.abs(light[[1, 3]]).max() < 0.02
    assert 0 < light[2].min() < 0.3


def test_nothing_seen_gives_an_even_light():
    assert np.array_equal(find_light([], np.zeros((5, 3))), [[1, 1, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0]])


@pytest.mark.slow
def test_a_person_turning_under_a_lamp_is_drawn_better_with_its_light(job_anywhere):
    psnr = {}
    for light in (True, False):
        made = job_anywhere(name=f"light_{light}", lamp=True, light=light, pose_rounds=0)
        run(made)
        psnr[light] = json.loads((made.out / "metrics.json").read_text())["psnr_fg_ttpo"]
    assert psnr[True] > psnr[False] + 1

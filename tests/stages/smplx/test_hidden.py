"""What stands before the person hides parts that are named and not fitted; a person in full view is left alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.frame_files import read_alpha, write_alpha
from gsac.avatar.wholebody import INDEX
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.hidden import describe_hidden, find_occluder, hide, leave_out_outside
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.silhouette import Outline, make_outline, read_outline, sample_outlines
from gsac.stages.smplx.state import to_params
from support.turning_person import HEIGHT, WIDTH, height_of, joint_error_mm, outlines_of, sightings_of, turning_person

FRAMES = 6
ANKLES = [INDEX["left_ankle"], INDEX["right_ankle"]]


@pytest.fixture(scope="module")
def person(body) -> BodyParams:
    near = turning_person(body, FRAMES)
    return replace(near, transl=near.transl + np.float32([0, 0, 0.9]))  # the arms in the picture, too


def behind(body: Body, person: BodyParams, thing: np.ndarray, folder: Path) -> list[Outline]:
    """Outlines of the person behind a thing, (H, W) bool."""
    outlines_of(body, person, folder)
    for path in sorted(folder.glob("*.exr")):
        write_alpha(path, np.where(thing, 0, read_alpha(path)))
    return [read_outline(path) for path in sorted(folder.glob("*.exr"))]


def a_sofa(seen: Sightings) -> tuple[np.ndarray, Sightings]:
    """Furniture before the shanks, and points behind it as a detector guesses them: two fifths nearer to its upper edge."""
    top = int(np.median(seen.xy[:, [INDEX["left_knee"], INDEX["right_knee"]], 1])) + 25
    xy = seen.xy.copy()
    below = xy[..., 1] > top
    xy[below, 1] -= 0.4 * (xy[below, 1] - top)
    thing = np.zeros((HEIGHT, WIDTH), bool)
    thing[top:] = True
    return thing, replace(seen, xy=xy)


def a_pole() -> np.ndarray:
    thing = np.zeros((HEIGHT, WIDTH), bool)
    thing[:, WIDTH // 2 + 5: WIDTH // 2 + 30] = True
    return thing


def test_legs_behind_furniture_are_not_pulled_to_where_the_detector_guesses_them(body, person, tmp_path):
    thing, seen = a_sofa(sightings_of(body, person))
    outlines = behind(body, person, thing, tmp_path)
    occluder = find_occluder(seen, outlines)
    assert occluder is not None
    hidden, points = hide(seen, occluder, outlines[0].scale)
    assert (hidden.score[:, ANKLES] == 0).all() and points[:, ANKLES].all()
    finding, = describe_hidden(points)
    assert "hides the feet in all 6 frames;" in finding.message and finding.figure == FRAMES
    error = []
    for sightings, shown in ((seen, outlines), (hidden, [replace(o, hidden=occluder) for o in outlines])):
        with threadpool_limits(1, "blas"):
            fit = fit_clip(body, sightings, shown, SmplxConfig(height_m=height_of(body, person), rounds=1), lambda *a: None)
        error.append(joint_error_mm(body, to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2])), person).mean())
    assert error[1] < 0.5 * error[0]


def test_legs_may_stand_anywhere_below_what_furniture_shows(body, person, tmp_path):
    thing, seen = a_sofa(sightings_of(body, person))
    outlines = behind(body, person, thing, tmp_path)
    occluder = find_occluder(seen, outlines)
    lowest = max(np.flatnonzero(outline.mask.any(1))[-1] for outline in outlines)
    assert occluder is not None and occluder[lowest + 1:].all()


def test_a_body_cut_off_by_the_edge_stands_on_legs_that_no_guess_shortens(body, person):
    true = sightings_of(body, person)
    edge = int(np.median(true.xy[:, [INDEX["left_knee"], INDEX["right_knee"]], 1])) - 10
    xy = true.xy.copy()
    below = xy[..., 1] > edge
    xy[below, 1] -= 0.7 * (xy[below, 1] - edge)  # a detector guesses near the edge
    cut = replace(true, xy=xy, height=edge)
    config, error = SmplxConfig(height_m=height_of(body, person), rounds=1, silhouette=0), []
    for sightings in (cut, leave_out_outside(cut)):
        sightings = replace(sightings, principal_point=(WIDTH / 2, HEIGHT / 2))
        with threadpool_limits(1, "blas"):
            fit = fit_clip(body, sightings, [], config, lambda *a: None)
        error.append(joint_error_mm(body, to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2])), person).mean())
    assert error[1] < 0.6 * error[0]


def test_the_height_of_a_person_whose_feet_are_not_seen_is_told_by_the_trunk(body, person):
    whole = sightings_of(body, person)
    half = replace(whole, score=np.where(np.isin(np.arange(133), range(13, 23)), 0, whole.score))
    assert half.person_height == pytest.approx(whole.person_height, rel=0.1)


def test_a_pole_does_not_count_against_a_body_behind_it(body, person, tmp_path):
    thing, seen = a_pole(), sightings_of(body, person)
    outlines = behind(body, person, thing, tmp_path)
    occluder = find_occluder(seen, outlines)
    iou = sample_outlines(body, person, WIDTH, HEIGHT, outlines)[1]
    judged = sample_outlines(body, person, WIDTH, HEIGHT, [replace(o, hidden=occluder) for o in outlines])[1]
    assert iou.max() < 0.8 and judged.min() > 0.93


def test_before_a_person_in_full_view_stands_nothing(body, person, tmp_path):
    assert find_occluder(sightings_of(body, person, noise=2.0), outlines_of(body, person, tmp_path)) is None


def test_one_wrong_detection_is_no_furniture(body, person, tmp_path):
    seen, outlines = sightings_of(body, person), outlines_of(body, person, tmp_path)
    seen.xy[3, ANKLES] += (120, 0)
    assert find_occluder(seen, outlines) is None


@pytest.mark.parametrize("value", [0, 1])
def test_an_alpha_without_an_edge_tells_nothing(value):
    assert make_outline(np.full((64, 48), value, np.float32)).area == 0

"""The benchmark of hands behind the back: its cases, its bars, and skin beside a mask."""

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.zbuffer import silhouette
from gsac.benchmarks.fit.truth import Truth
from gsac.benchmarks.hidden_hand import bench
from gsac.benchmarks.hidden_hand.cases import FRAMES, HiddenHand
from gsac.benchmarks.hidden_hand.score import Row, measure_inside
from gsac.benchmarks.hidden_hand.table import text
from gsac.stages.contract import BadInput


@pytest.mark.parametrize("words", [*bench.LOOKED_AT, *bench.APART])
def test_a_case_names_person_side_and_how_many_frames_on_end_the_hand_is_hidden(words):
    hand = HiddenHand.parse(words)
    frames = np.flatnonzero(hand.hidden)
    assert len(frames) == hand.count == np.ptp(frames) + 1 and f"{hand.seed}:{hand.side}:{hand.count}" == words


def test_a_seed_alone_is_a_clean_turn():
    hand = HiddenHand.parse("201")
    assert hand.name == "201-clean" and not hand.hidden.any()


@pytest.mark.parametrize("words", ["left:8", "41:up:8", f"41:left:{FRAMES}", "41:left:", ""])
def test_a_case_that_cannot_be_is_refused_by_name(words):
    with pytest.raises(BadInput, match=f"case {words}: expected SEED"):
        HiddenHand.parse(words)


def test_people_by_whom_constants_were_set_are_not_those_apart():
    seeds = [{words.split(":")[0] for words in some} for some in (bench.LOOKED_AT, bench.APART)]
    assert seeds[1] and not seeds[0] & seeds[1]


@pytest.mark.parametrize("wrist, elbow, skin, missed", [(80, 40, 0.97, []), (80.1, 40, 0.97, ["wrist_mm"]),
                                                        (20, 41, 0.96, ["elbow_mm", "skin_inside"])])
def test_a_row_names_the_bars_that_it_misses(wrist, elbow, skin, missed):
    row = Row("41-left-17", wrist, elbow, skin, 20, 20, 15, 5.0, "")
    assert row.misses == missed
    assert ", ".join(missed or ["-"]) in text([row]).splitlines()[1]


def test_skin_beside_the_mask_is_counted_beyond_its_edge():
    body = Body.load()
    pose = np.zeros((1, 55, 3))
    pose[:, 0, 0] = np.pi
    params = BodyParams.from_pose(pose, np.array([[0, 0, 3.0]]), np.zeros(body.num_betas), np.zeros((1, body.exprdirs.shape[2])),
                                  500.0, (180, 320))
    mask = silhouette(body.posed(params)[0][0], body.faces, params.camera(360, 640))
    frames = np.ones(1, bool)
    truth = Truth(np.arange(22), np.zeros((1, 22, 3)), None, np.zeros((1, 23, 2)), 500.0, (180, 320), mask[None])
    assert measure_inside(body, params, truth, "left", frames) == 1
    assert measure_inside(body, params, replace(truth, masks=np.roll(mask, 60, axis=0)[None]), "left", frames) < 0.9

"""A person whose head is outside the picture is looked for where a frame nearby has them; all other frames are left alone."""

from __future__ import annotations

from gsac.avatar.region import Region
from gsac.stages.keypoints.cut_off import Cut
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.second_look import look_again

HEADLESS = {Cut.HEAD}


def seen(side, across=100.0):
    return Frame(region=Region((across, 200), side))


def looker(side, asked):
    def look(t, region):
        asked.append((t, region.center[0]))
        return None if side is None else (seen(side), HEADLESS)

    return look


def test_a_lost_and_a_shrunk_person_are_looked_for_where_the_nearest_frame_has_them():
    frames = [Frame(), seen(300), seen(450, 110), seen(460, 120), seen(440, 130), seen(290)]
    cuts = [set(), set(), HEADLESS, HEADLESS, HEADLESS, set()]
    asked = []
    look_again(frames, cuts, looker(445, asked))
    assert asked[0] == (0, 110.0) and asked[-1] == (5, 130.0) and len(asked) == 3
    assert all(frame.region.side > 400 for frame in frames) and all(cut == HEADLESS for cut in cuts)


def test_what_is_found_at_another_size_changes_nothing():
    for side in (200, None):
        frames, cuts = [seen(300), seen(450), seen(450), seen(450)], [set(), HEADLESS, HEADLESS, HEADLESS]
        before = list(frames)
        look_again(frames, cuts, looker(side, []))
        assert frames == before and cuts[0] == set()


def test_where_the_head_is_in_the_picture_no_frame_is_looked_at_again():
    frames, asked = [Frame(), seen(300), seen(450), seen(450), seen(450)], []
    look_again(frames, [{Cut.FEET}] * 5, looker(450, asked))
    assert not asked

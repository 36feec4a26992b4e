import dataclasses
import shutil

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gsac.cache.digest import tree_digest
from gsac.cache.errors import CacheError
from gsac.cache.key import ChangeKind, KeyParts

PARTS = KeyParts(
    stage="fill",
    inputs={"keypoints/keypoints.npz": "a" * 64, "split/clip.json": "b" * 64},
    params={"method": "gp", "gap": 5, "sigma": 0.5},
    code={"gsac.stages.fill.stage": "c" * 64},
    models={"pose": "d" * 64},
    packages={"numpy": "2.1.0"},
    device="cpu",
)


def test_the_key_of_known_parts_never_changes_without_a_new_key_version():
    assert PARTS.key == "8d709e9b9a769611dc6c594b929b1bda6d51bb138230d7b9e32953625b050d13"


def test_swapped_inputs_are_not_the_same_inputs():
    first, second = PARTS.inputs.items()
    swapped = dataclasses.replace(PARTS, inputs={first[0]: second[1], second[0]: first[1]})
    assert swapped.key != PARTS.key
    assert [change.kind for change in PARTS.diff(swapped)] == [ChangeKind.INPUT] * 2


@pytest.mark.parametrize(
    "change, kind, sentence",
    [
        ({"stage": "face"}, ChangeKind.STAGE, "stage changed from 'fill' to 'face'"),
        (
            {"inputs": {**PARTS.inputs, "split/clip.json": "e" * 64}},
            ChangeKind.INPUT,
            "input split/clip.json changed from bbbbbbbbbbbb to eeeeeeeeeeee",
        ),
        (
            {"params": {**PARTS.params, "gap": 6}},
            ChangeKind.PARAM,
            "parameter fill.gap changed from 5 to 6",
        ),
        (
            {"params": {**PARTS.params, "gap": 5.0}},
            ChangeKind.PARAM,
            "parameter fill.gap changed from 5 to 5.0",
        ),
        (
            {"code": {**PARTS.code, "gsac.avatar.body": "f" * 64}},
            ChangeKind.CODE,
            "code gsac.avatar.body is new (ffffffffffff)",
        ),
        ({"models": {}}, ChangeKind.MODEL, "model file pose is no longer used (was dddddddddddd)"),
        (
            {"packages": {"numpy": "2.2.0"}},
            ChangeKind.PACKAGE,
            "package numpy changed from '2.1.0' to '2.2.0'",
        ),
        ({"device": "cuda"}, ChangeKind.DEVICE, "device changed from 'cpu' to 'cuda'"),
    ],
)
def test_every_part_is_in_the_key_and_a_change_says_what_it_is(change, kind, sentence):
    changed = dataclasses.replace(PARTS, **change)
    assert changed.key != PARTS.key
    if kind is not ChangeKind.STAGE:
        [found] = PARTS.diff(changed)
        assert (found.kind, found.sentence) == (kind, sentence)
    else:
        assert PARTS.diff(changed)[0].sentence == sentence


def test_the_order_in_which_parts_are_named_does_not_matter():
    turned = {f.name: dict(reversed(v.items())) for f in dataclasses.fields(PARTS) if isinstance(v := getattr(PARTS, f.name), dict)}
    assert dataclasses.replace(PARTS, **turned).key == PARTS.key
    assert PARTS.diff(dataclasses.replace(PARTS, **turned)) == []


def test_clip_name_and_paths_are_not_in_the_key_so_equal_content_is_shared(store, tmp_path):
    (tmp_path / "anna.mp4").write_bytes(b"video")
    (tmp_path / "deep").mkdir()
    shutil.copy(tmp_path / "anna.mp4", tmp_path / "deep" / "bert.mov")
    keys = {
        KeyParts("split", {"clip": tree_digest(clip)[0]}).key for clip in (tmp_path / "anna.mp4", tmp_path / "deep" / "bert.mov")
    }
    assert len(keys) == 1


@pytest.mark.parametrize("value", [float("nan"), float("inf"), object(), {1, 2}])
def test_a_parameter_without_one_plain_value_is_named(value):
    with pytest.raises(CacheError, match="fill.sigma"):
        _ = dataclasses.replace(PARTS, params={"method": "gp", "sigma": value}).key


plain = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text("xyz", max_size=3)
names = st.text("abc", min_size=1, max_size=2)
several = st.builds(KeyParts, st.sampled_from("xy"), st.dictionaries(names, names), st.dictionaries(names, plain))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(several, several)
def test_keys_are_equal_exactly_when_nothing_differs(first, second):
    assert (first.key == second.key) == (first.diff(second) == [])

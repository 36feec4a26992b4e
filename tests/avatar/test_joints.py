from gsac.avatar.joints import BODY, EYES, FINGERS, HEAD, JAW, JAW_EYES, LEFT_HAND, NAMES, POSE_PARTS, RIGHT_HAND, WRISTS, J


def test_the_groups_hold_the_joints_that_their_names_say():
    assert len(NAMES) == len(set(NAMES)) == J
    assert NAMES[BODY][-1] == "right_wrist" and NAMES[JAW_EYES] == ("jaw", "left_eye_smplhf", "right_eye_smplhf")
    assert all(name.startswith("left_") for name in NAMES[LEFT_HAND])
    assert all(name.startswith("right_") for name in NAMES[RIGHT_HAND])
    assert NAMES[FINGERS] == NAMES[LEFT_HAND] + NAMES[RIGHT_HAND]
    assert [NAMES[j] for j in (HEAD, JAW, *EYES, *WRISTS)] == [
        "head", "jaw", "left_eye_smplhf", "right_eye_smplhf", "left_wrist", "right_wrist"]


def test_the_parts_of_a_pose_are_all_joints_in_order():
    assert [j for part in POSE_PARTS.values() for j in range(J)[part]] == list(range(J))

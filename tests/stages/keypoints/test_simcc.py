import numpy as np

from gsac.avatar.wholebody import HANDS
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.simcc import drop_doubled_hand


def test_both_hands_on_one_place_leave_the_surer_one():
    frame = Frame()
    frame.xy[HANDS["left"]] = np.random.default_rng(0).uniform(0, 50, (21, 2))
    frame.xy[HANDS["right"]] = frame.xy[HANDS["left"]] + 3
    frame.score[HANDS["left"]], frame.score[HANDS["right"]] = 0.5, 0.8
    drop_doubled_hand(frame)
    assert not frame.score[HANDS["left"]].any() and frame.score[HANDS["right"]].all()
    frame.score[HANDS["left"]] = 0.5
    frame.xy[HANDS["right"]] += 60
    drop_doubled_hand(frame)
    assert frame.score[HANDS["left"]].all() and frame.score[HANDS["right"]].all()


def test_the_config_asks_for_the_file_that_the_user_brings():
    assert "onnx-wholebody" in KeypointsConfig(detector="onnx-wholebody").models()
    assert "onnx-wholebody" not in KeypointsConfig().models()

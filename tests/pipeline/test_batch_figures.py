from gsac.pipeline.report.batch_figures import find_outliers, list_changes, read_figures

FLOCK = [{"psnr_fg": 22.0 + 0.1 * n} for n in range(8)]


def test_a_clip_far_below_the_others_stands_out_and_one_far_above_does_not():
    words = find_outliers([*FLOCK, {"psnr_fg": 14.0}, {"psnr_fg": 31.0}, {}])
    assert words[:8] == [[]] * 8 and words[9:] == [[], []]
    assert words[8] == ["Person 14.0 dB, the median is 22.4 dB"]


def test_of_few_clips_none_stands_out():
    assert find_outliers([*FLOCK[:3], {"psnr_fg": 2.0}]) == [[]] * 4


def test_clips_that_are_all_alike_have_no_outlier_for_a_difference_that_nobody_sees():
    assert find_outliers([{"psnr_fg": 22.0}] * 8 + [{"psnr_fg": 21.8}]) == [[]] * 9


def test_only_notable_differences_from_the_batch_before_are_told():
    before = read_figures({"psnr_fg": 23.0, "psnr_face": 20.0, "alpha_iou": float("nan"), "ssim": 1.0})
    assert list_changes({"psnr_fg": 22.1, "psnr_face": 20.2, "alpha_iou": 0.9}, before) == ["Person 22.1 dB, before 23.0 dB"]

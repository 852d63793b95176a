import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.error_histograms import ErrorHistograms
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.pose import Pose

CTX = Context("metric")


def two_logs(*errors: list[float]):
    ticks, truth, estimates = [], [], []
    for log, each in enumerate(errors):
        for frame, error in enumerate(each):
            ticks.append(Tick(len(ticks), len(ticks), log, frame, frame == 0))
            truth.append(Pose(0.0, 0.0, 0.0))
            pose = Pose(error, 0.0, 0.0)
            estimates.append(PoseEstimate(pose, np.eye(3), 1.0, pose))
    return collected(ticks, truth, None, estimates)


def test_each_log_has_the_shares_of_its_errors(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.metrics.error_histograms.BIN_M", 1.0)
    monkeypatch.setattr("omninav.stages.metrics.error_histograms.BINS", 3)
    first, second = (
        ErrorHistograms().step(CTX, two_logs([0.1, 0.3, 1.5, 9.0], [0.2, 0.2])).metrics.values["error_histograms"]
    )
    assert first["error_m"] == [0.5, 1.5, 2.5]
    assert first["share"] == [0.5, 0.25, 0.25]
    assert (first["small"], first["large"]) == (0.5, 0.25)
    assert second["share"] == [1.0, 0.0, 0.0]


def test_what_is_skipped_does_not_count():
    (late,) = ErrorHistograms(skip=0.5).step(CTX, two_logs([5.0, 5.0, 0.1, 0.1])).metrics.values["error_histograms"]
    assert late["large"] == 0.0
    assert sum(late["share"]) == pytest.approx(1.0)


def test_bins_are_a_fifth_of_a_metre_and_limits_belong_to_what_is_small():
    drive = two_logs([0.0, 0.3, 0.4, 0.5, 2.0, 2.1, 99.0])
    (found,) = ErrorHistograms().step(CTX, drive).metrics.values["error_histograms"]
    assert found["error_m"] == pytest.approx([0.1 + 0.2 * k for k in range(16)])
    assert found["share"] == pytest.approx(np.bincount([0, 1, 2, 2, 10, 10, 15], minlength=16) / 7)
    assert (found["small"], found["large"]) == pytest.approx((3 / 7, 2 / 7))


def test_frames_without_truth_or_estimate_and_logs_of_such_do_not_count():
    drive = two_logs([0.1, 9.0, 9.0], [5.0])
    drive.truth[1] = np.nan
    drive.estimate[2] = np.nan
    drive.estimate[3] = np.nan
    (found,) = ErrorHistograms().step(CTX, drive).metrics.values["error_histograms"]
    assert found["small"] == 1.0


def test_nothing_is_skipped_unless_asked_for_and_half_a_frame_is_not():
    (all_,) = ErrorHistograms().step(CTX, two_logs([5.0, 0.1, 0.1])).metrics.values["error_histograms"]
    (two,) = ErrorHistograms(skip=0.5).step(CTX, two_logs([5.0, 0.1, 0.1])).metrics.values["error_histograms"]
    assert (all_["large"], two["large"]) == (pytest.approx(1 / 3), 0.0)

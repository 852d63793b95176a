import numpy as np
import pytest
from measured_drives import AT_ORIGIN, figures, made_drive, on_x

from omninav.stages.metrics.error_histograms import ErrorHistograms


def logs_of(*errors: list[float]):
    """A drive in a log for each list of errors (m)."""
    every = [error for each in errors for error in each]
    logs = [log for log, each in enumerate(errors) for _ in each]
    return made_drive([AT_ORIGIN] * len(every), on_x(every), logs=logs)


def histograms(drive, **parameters):
    return figures(ErrorHistograms(**parameters), drive)["error_histograms"]


def test_each_log_has_the_shares_of_its_errors(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.metrics.error_histograms.BIN_M", 1.0)
    monkeypatch.setattr("omninav.stages.metrics.error_histograms.BINS", 3)
    first, second = histograms(logs_of([0.1, 0.3, 1.5, 9.0], [0.2, 0.2]))
    assert first == {"error_m": [0.5, 1.5, 2.5], "share": [0.5, 0.25, 0.25], "small": 0.5, "large": 0.25}
    assert second["share"] == [1.0, 0.0, 0.0]


def test_bins_are_a_fifth_of_a_metre_and_limits_belong_to_what_is_small():
    (found,) = histograms(logs_of([0.0, 0.3, 0.4, 0.5, 2.0, 2.1, 99.0]))
    assert found["error_m"] == pytest.approx([0.1 + 0.2 * k for k in range(16)])
    assert found["share"] == pytest.approx(np.bincount([0, 1, 2, 2, 10, 10, 15], minlength=16) / 7)
    assert (found["small"], found["large"]) == pytest.approx((3 / 7, 2 / 7))


def test_frames_without_truth_or_estimate_and_logs_of_such_do_not_count():
    drive = logs_of([0.1, 9.0, 9.0], [5.0])
    drive.truth[1] = np.nan
    drive.estimate[2:] = np.nan
    (found,) = histograms(drive)
    assert found["small"] == 1.0


def test_nothing_is_skipped_unless_asked_for_and_half_a_frame_is_not():
    drive = logs_of([5.0, 0.1, 0.1])
    (all_,), (two,) = histograms(drive), histograms(drive, skip=0.5)
    assert (all_["large"], two["large"]) == (pytest.approx(1 / 3), 0.0)
    assert sum(two["share"]) == pytest.approx(1.0)

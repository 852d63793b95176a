"""Right from the first time on that it was; and where the belief's mean lies at first."""

import math

import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.mean_at_first import MeanAtFirst
from omninav.stages.metrics.once_right import OnceRight
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.drive import Drive
from omninav.stages.values.grid import FreeSpace
from omninav.stages.values.pose import Pose


def believed(off: list[tuple[float, float]]) -> Drive:
    """A robot at the origin that is believed `off` (m aside, degrees) in each frame, with means twice as far aside."""
    ticks = [Tick(n, n, 0, n, n == 0) for n in range(len(off))]
    estimates = [
        PoseEstimate(Pose(0.0, aside, math.radians(turned)), np.eye(3), 1.0, Pose(0.0, 2 * aside, 0.0))
        for aside, turned in off
    ]
    return collected(ticks, [Pose(0.0, 0.0, 0.0)] * len(off), None, estimates)


def once_right(off: list[tuple[float, float]]):
    out = OnceRight().step(Context("once_right"), believed(off))
    assert out.metrics is not None
    return out.metrics.values["once_right"]


def test_frames_before_the_first_right_one_do_not_count() -> None:
    found = once_right([(9.0, 0.0), (1.0, 40.0), (1.9, 34.0), (2.1, 0.0), (0.0, 0.0), (0.0, 36.0)])
    assert found == {"after_frames": 2, "right_rate": pytest.approx(2 / 4)}


def test_a_robot_that_was_never_right_has_no_share() -> None:
    assert once_right([(9.0, 0.0), (1.0, 40.0)]) == {"after_frames": None, "right_rate": None}


def test_the_mean_counts_from_the_middle_of_the_free_cells() -> None:
    free = FreeSpace(np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 9.0]]), 1.0)  # their mean is (2, 3)
    out = MeanAtFirst().step(Context("mean"), believed([(3.5, 0.0), (0.0, 0.0)]), free)
    assert out.metrics is not None
    assert out.metrics.values["mean_at_first"]["from_middle_m"] == pytest.approx(math.hypot(2.0, 4.0))

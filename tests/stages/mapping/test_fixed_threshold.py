"""A given limit between views."""

from omninav.pipeline import Context
from omninav.pipeline.graph.signature import signature
from omninav.stages.mapping.calibrated_threshold import CalibratedThreshold
from omninav.stages.mapping.fixed_threshold import FixedThreshold


def test_a_fixed_limit_is_given_at_once() -> None:
    limit = FixedThreshold(distance=7.0).step(Context("limit")).threshold
    assert (limit.distance, limit.settled) == (7.0, True)
    assert FixedThreshold().step(Context("limit")).threshold.distance == 100.0


def test_it_can_stand_in_for_one_that_is_measured() -> None:
    assert set(signature(CalibratedThreshold).inputs) <= set(signature(FixedThreshold).inputs)

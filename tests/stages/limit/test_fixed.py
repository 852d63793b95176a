"""A given limit between views."""

from omninav.pipeline import Context
from omninav.stages.limit.fixed import FixedLimit


def test_a_fixed_limit_is_given_at_once() -> None:
    limit = FixedLimit(distance=7.0).step(Context("limit")).limit
    assert (limit.distance, limit.settled) == (7.0, True)

"""Room around a robot, by rings of ranges whose answers are seen by eye."""

import math

import numpy as np
import pytest

from omninav.stages.control.clearance import free_ahead, free_direction, roomier_side

AZIMUTHS = np.radians(np.arange(0.0, 360.0, 5.0))


def test_the_way_ahead_ends_at_the_nearest_range_within_the_discs_width():
    # A wall 3 m ahead, and a corner 1.5 m to the left of the line, 2 m on.
    ranges, azimuths = np.array([3.0, 2.5]), np.array([0.0, math.atan2(1.5, 2.0)])
    assert free_ahead(ranges, azimuths, 0.5, 0.5) == pytest.approx(2.5)
    assert free_ahead(ranges, azimuths, 0.5, 0.99) == pytest.approx(2.5)
    assert free_ahead(ranges, azimuths, 0.5, 1.01) == pytest.approx(1.5)
    assert free_ahead(ranges, -azimuths, 0.5, 1.01) == pytest.approx(1.5)


def test_what_is_just_clear_of_the_disc_is_not_in_the_way():
    azimuth = math.pi / 6
    beside = abs(1.0 * np.sin(azimuth))
    assert free_ahead(np.array([5.0, 1.0]), np.array([0.0, azimuth]), 0.0, beside) == 5.0


def test_without_anything_in_the_way_the_longest_range_is_free():
    assert free_ahead(np.array([4.0, 0.1, 7.0]), np.array([2.0, 3.0, -2.5]), 0.5, 0.1) == 6.5


@pytest.mark.parametrize(("cosine", "free"), [(0.15, 0.15), (0.05, 9.0), (-0.5, 9.0)])
def test_a_range_beside_or_behind_is_not_ahead(cosine: float, free: float):
    ranges, azimuths = np.array([1.0, 9.0]), np.array([math.acos(cosine), 0.0])
    assert free_ahead(ranges, azimuths, 0.0, 2.0) == pytest.approx(free)


def test_the_roomier_side_is_the_mean_of_what_is_in_front():
    # Left 4 m at 30 degrees, right 2 m at 90; 9 m behind to the right do not count.
    ranges, azimuths = np.array([4.0, 2.0, 9.0]), np.radians([30.0, -90.0, -98.0])
    assert roomier_side(ranges, azimuths) == pytest.approx((4.0 * 0.5 - 2.0) / 2)
    assert roomier_side(ranges[:2], -azimuths[:2] / 2) == pytest.approx(
        (-4.0 * math.sin(math.radians(15)) + 2.0 * math.sin(math.radians(45))) / 2
    )
    assert roomier_side(np.array([1.0, 2.0]), np.array([math.acos(-0.05), 0.0])) == pytest.approx(
        math.sin(math.acos(-0.05)) / 2
    )


def ring(**open_at: float) -> np.ndarray:
    """Ranges of 1 m, and of as many as given within 10 degrees of openings (`left15`): only their middle is free."""
    ranges = np.ones(len(AZIMUTHS))
    for name, metres in open_at.items():
        degrees = int(name.removeprefix("left").removeprefix("right")) * (1 if name.startswith("left") else -1)
        off = (np.arange(0, 360, 5) - degrees + 180) % 360 - 180
        ranges[np.abs(off) <= 10] = metres
    return ranges


@pytest.mark.parametrize("degrees", [0, 5, 15, 90])
@pytest.mark.parametrize("side", ["left", "right"])
def test_the_free_direction_is_the_closest_one(degrees: int, side: str):
    found = free_direction(ring(**{f"{side}{degrees}": 5.0}), AZIMUTHS, 0.0, 3.0, 0.1, 0.1)
    assert found == pytest.approx(math.radians(degrees) * (1 if side == "left" else -1))


def test_a_direction_that_is_wanted_is_the_middle_of_the_search():
    ranges = ring(left30=5.0, right10=5.0)
    assert free_direction(ranges, AZIMUTHS, math.radians(25), 3.0, 0.1, 0.1) == pytest.approx(math.radians(30))
    assert free_direction(ranges, AZIMUTHS, math.radians(5), 3.0, 0.1, 0.1) == pytest.approx(math.radians(-10))


@pytest.mark.parametrize(("ranges", "degrees"), [((5.0, 6.0), -15), ((6.0, 5.0), 15)])
def test_of_two_directions_as_close_the_one_with_more_room_is_taken(ranges: tuple[float, float], degrees: int):
    found = free_direction(ring(left15=ranges[0], right15=ranges[1]), AZIMUTHS, 0.0, 3.0, 0.1, 0.1)
    assert found == pytest.approx(math.radians(degrees))


def test_room_that_is_just_enough_is_enough_and_beyond_90_degrees_nothing_is_looked_for():
    alone = np.array([3.5])
    assert free_direction(alone, np.zeros(1), 0.0, 3.0, 0.5, 0.1) == 0.0
    assert free_direction(ring(left95=5.0), AZIMUTHS, 0.0, 3.0, 0.1, 0.1) is None
    assert free_direction(ring(right95=5.0), AZIMUTHS, 0.0, 3.0, 0.1, 0.1) is None

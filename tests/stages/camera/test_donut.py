import math

import numpy as np
import pytest
from camera_round_trip import assert_mask, assert_round_trip
from hypothesis import given
from hypothesis import strategies as st

from omninav.pipeline import BadInput
from omninav.stages.camera.donut import Donut
from omninav.stages.camera.rays import unit_vectors

RING = Donut(640, 480, 320.0, 240.0, 40.0, 200.0, "counter_clockwise", yaw=0.1)


@given(azimuth=st.floats(-math.pi, math.pi), elevation=st.floats(-1.0, 1.0))
def test_a_ray_comes_back_from_its_pixel(azimuth: float, elevation: float) -> None:
    assert_round_trip(RING, azimuth, elevation)


def test_the_mask_is_the_ring() -> None:
    assert_mask(RING)


def test_the_middle_of_the_ring_is_taken_for_the_horizon() -> None:
    assert RING.unproject(np.array([[320.0, 120.0]]))[0][0] == pytest.approx(unit_vectors(math.pi / 2 + 0.1, 0.0))
    assert not RING.elevations_known


def test_without_its_ring_a_donut_gives_no_rays() -> None:
    for ask in (Donut(640, 480).unproject, Donut(640, 480).project):
        with pytest.raises(BadInput, match=r"give centre and mask in camera\.yaml, or use unwarp=donut"):
            ask(np.ones((1, 3)))

import numpy as np
import pytest
from made_rings import ring_picture

from omninav.pipeline import BadInput
from omninav.stages.camera.donut import Donut


def test_elevations_of_a_ring_are_not_known() -> None:
    assert not Donut(640, 480, 320.0, 240.0, 40.0, 200.0).elevations_known


def test_without_its_ring_a_donut_gives_no_rays() -> None:
    for ask in (Donut(640, 480).unproject, Donut(640, 480).project):
        with pytest.raises(BadInput, match=r"give centre and mask in camera\.yaml"):
            ask(np.ones((1, 3)))


def test_what_a_donut_leaves_open_is_found_in_an_image() -> None:
    picture = ring_picture((330, 236), 200, 40, seed=0)
    found = Donut(640, 480, centre_x=331.0, yaw=0.5).found_in(picture)
    assert found is not None
    assert found.complete
    assert (found.centre_x, found.yaw) == (331.0, 0.5)
    assert found.ring == pytest.approx((331.0, 236.0, 40.0, 200.0), abs=6.0)
    assert found.found_in(ring_picture((300, 250), 190, 50, seed=1)) is found
    assert Donut(640, 480).found_in(np.full((480, 640, 3), 90, np.uint8)) is None

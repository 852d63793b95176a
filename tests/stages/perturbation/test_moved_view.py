"""Windows shifted, turned, enlarged, sheared and seen in part."""

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.perturbation.moved_view import MovedView
from omninav.stages.values.image import Windows

IMAGE = np.zeros((41, 81, 3), np.uint8)
IMAGE[20, 40] = 255  # the middle
IMAGE[20, 60] = 200  # 20 columns to the right of it


def moved(**how: float) -> Windows:
    windows = Windows(IMAGE[None], np.zeros(1), 1.0)
    return MovedView(**how).step(Context("perturbation"), windows).panorama


@pytest.mark.parametrize(
    ("how", "where"),
    [
        ({}, (20, 60)),
        ({"shift": 10 / 81}, (20, 70)),
        ({"turn_deg": 90.0}, (0, 40)),
        ({"scale": 2.0}, (20, 80)),
        ({"scale": 0.5}, (20, 50)),
        ({"turn_deg": 90.0, "shear": 0.5}, (0, 50)),
    ],
    ids=["left as it is", "to the right", "counter-clockwise", "larger", "smaller", "sheared"],
)
def test_a_pixel_goes_where_it_is_moved(how: dict[str, float], where: tuple[int, int]) -> None:
    found = moved(**how).pixels[0, :, :, 0].astype(float)
    found[20, 40 if "shift" not in how else 50] = 0
    assert np.unravel_index(int(found.argmax()), found.shape) == where


def test_what_comes_from_outside_and_what_is_left_out_is_black_and_unseen() -> None:
    seen = moved(shift=0.25).seen
    assert seen.shape == (1, 41, 81)
    assert not seen[0, :, :20].any()
    assert seen[0, :, 21:].all()
    half = moved(part=0.5)
    assert half.seen is not None
    assert half.seen[0].mean() == pytest.approx(0.5, abs=0.01)
    assert not half.pixels[~half.seen].any()

import cv2
import numpy as np
import pytest

from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.donut import Donut
from omninav.stages.camera.fisheye import Fisheye
from omninav.stages.camera.thumbnail import thumbnail

PIXELS = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8), (0, 0), 5)


def test_of_a_lens_only_the_disc_is_kept_and_points_move_with_it() -> None:
    lens = Fisheye(640, 480, 140.0, 319.0, 239.0, 200.0)
    assert (thumbnail(PIXELS, lens, 2000).pixels == PIXELS[39:440, 119:520]).all()
    small = thumbnail(PIXELS, lens, 101)
    assert small.corner == (119, 39)
    assert small.pixels.shape == (101, 101, 3)
    assert small.points(np.array([[319.0, 239.0], [119.0, 39.0]])) == pytest.approx(
        np.array([[50.0, 50.0], [-0.374, -0.374]]), abs=1e-3
    )


@pytest.mark.parametrize("camera", [None, Cylindrical(640, 480, 320.0), Donut(640, 480)])
def test_of_any_other_image_all_is_kept(camera: Cylindrical | Donut | None) -> None:
    assert thumbnail(PIXELS, camera, 160).pixels.shape == (120, 160, 3)
    assert thumbnail(PIXELS, camera, 2000).scale == 1.0


def test_it_is_encoded_as_jpeg() -> None:
    back = cv2.imdecode(np.frombuffer(thumbnail(PIXELS, None, 160).jpeg(90), np.uint8), cv2.IMREAD_COLOR)
    assert back is not None
    assert back.shape == (120, 160, 3)

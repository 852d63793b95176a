"""Other light than the map was learned in."""

import numpy as np

from omninav.pipeline import Context
from omninav.stages.perturbation.changed_light import ChangedLight, changed_light
from omninav.stages.values.image import Panorama

CTX = Context("perturbation", np.random.default_rng(0))
GREY = np.full((4, 360, 3), 100, np.uint8)


def test_as_it_is_by_default():
    assert (ChangedLight().step(CTX, Panorama(GREY)).panorama.pixels == GREY).all()


def test_gamma_gain_and_colour():
    assert (changed_light(GREY, 1.0, (0.5, 1.0, 3.0), 0.0, 0.0)[0, 0] == [50, 100, 255]).all()
    assert (changed_light(GREY, 2.0, (1.0, 1.0, 1.0), 0.0, 0.0) == round(255 * (100 / 255) ** 2)).all()


def test_light_from_the_left_is_brightest_there():
    view = ChangedLight(side=0.5, direction_deg=90).step(CTX, Panorama(GREY)).panorama.pixels[0, :, 0]
    assert abs(int(view.argmax()) - 90) <= 12  # columns run clockwise from behind, so the left is a quarter in
    assert view.max() == 150
    assert view.min() == 50

"""Other light than the map was learned in."""

import numpy as np
import pytest

from omninav.pipeline import BadInput, Context, Tick
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.perturbation.changed_light import ChangedLight, changed_light
from omninav.stages.values.image import Image, Panorama, column_azimuths

CTX = Context("perturbation", np.random.default_rng(0))
GREY = np.full((4, 360, 3), 100, np.uint8)
AROUND = column_azimuths(360)


def test_as_it_is_by_default():
    assert (ChangedLight().step(CTX, Panorama(GREY)).panorama.pixels == GREY).all()


def test_gamma_gain_and_colour():
    assert (changed_light(GREY, 1.0, (0.5, 1.0, 3.0), 0.0, 0.0, AROUND)[0, 0] == [50, 100, 255]).all()
    warm = ChangedLight(gain=0.5, blue=0.5, red=3.0).step(CTX, Panorama(GREY)).panorama
    assert (warm.pixels == [25, 50, 150]).all()
    assert (changed_light(GREY, 2.0, (1.0, 1.0, 1.0), 0.0, 0.0, AROUND) == round(255 * (100 / 255) ** 2)).all()


def test_light_from_the_left_is_brightest_there():
    view = ChangedLight(side=0.5).step(CTX, Panorama(GREY)).panorama.pixels[0, :, 0]
    quarter = np.sin(2 * np.pi * (np.arange(360) + 0.5) / 360)  # columns run clockwise from behind
    assert view.tolist() == np.rint(100 + 50 * quarter).tolist()


def test_an_image_is_lit_as_its_camera_looks():
    forward_left = Equirectangular(360, 4, 0.0, sense="counter_clockwise", elevation_top=0.1, elevation_bottom=-0.1)
    view = ChangedLight(side=0.5).step(CTX, image=Image(GREY), camera=forward_left).image.pixels
    assert abs(int(view[0, :, 0].argmax()) - 90) <= 12
    with pytest.raises(BadInput, match="an image needs its camera"):
        ChangedLight().step(CTX, image=Image(GREY))


def test_light_that_falls_on_no_image_is_refused_at_the_first_one():
    ctx = Context("perturbation")
    ctx.tick = Tick(0, 0, first_of_log=True)
    with pytest.raises(BadInput, match="wired to no image"):
        ChangedLight().step(ctx)
    ctx.tick = Tick(1, 1)
    assert ChangedLight().step(ctx).panorama is None

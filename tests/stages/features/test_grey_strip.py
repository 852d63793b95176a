import numpy as np

from omninav.pipeline import Context
from omninav.stages.features.grey_strip import GreyStrip
from omninav.stages.geometry.appearance.visual_compass import turns_and_correlations
from omninav.stages.values.image import Panorama, Windows


def test_a_strip_holds_the_means_of_equal_parts():
    pixels = np.repeat(np.random.default_rng(0).integers(0, 256, (16, 180, 1), np.uint8), 3, axis=2)
    strip = GreyStrip().step(Context("strip"), Panorama(pixels)).strip
    assert strip is not None
    means = pixels[..., 0].reshape(8, 2, 90, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(strip.pixels, means, atol=1e-3)


def test_a_turned_robot_sees_its_turn_in_two_strips():
    pixels = np.random.default_rng(0).integers(0, 256, (16, 180, 3), np.uint8)
    stage, ctx = GreyStrip(), Context("strip")
    before, after = (stage.step(ctx, Panorama(np.roll(pixels, shift, axis=1))).strip for shift in (0, 20))
    assert before is not None
    assert after is not None
    (turn,), (correlation,) = turns_and_correlations(np.stack([before.pixels, after.pixels]))
    np.testing.assert_allclose((np.degrees(turn), correlation), (40.0, 1.0), atol=1e-3)


def test_windows_have_no_strip():
    windows = Windows(np.zeros((4, 8, 8, 3), np.uint8), np.zeros(4), 1.0)
    assert GreyStrip().step(Context("strip"), windows).strip is None

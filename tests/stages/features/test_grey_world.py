"""Colour constancy by the grey-world assumption."""

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.features.colour_histogram import ColourHistogram
from omninav.stages.features.grey_world import grey_world_pixels
from omninav.stages.features.haar_integral import HaarIntegral
from omninav.stages.features.hsv_histogram import HsvHistogram
from omninav.stages.features.mean_rgb import MeanRgb
from omninav.stages.perturbation.changed_light import changed_light
from omninav.stages.values.image import Panorama, Windows, column_azimuths

CTX = Context("features", np.random.default_rng(0))
AROUND = column_azimuths(360)
SCENE = np.random.default_rng(0).integers(20, 120, (40, 360, 3), dtype=np.uint8)
WARM = changed_light(SCENE, 1.0, (0.6, 1.0, 1.3), 0.0, 0.0, AROUND)
DARK = changed_light(SCENE, 1.0, (0.7, 0.7, 0.7), 0.0, 0.0, AROUND)
FROM_ONE_SIDE = changed_light(SCENE, 1.0, (1.0, 1.0, 1.0), 0.5, 1.0, AROUND)


@pytest.mark.parametrize("light", [WARM, DARK])
@pytest.mark.parametrize("window", [0.25, 1.0])
def test_exposure_and_colour_of_the_light_are_removed(light, window):
    gap = grey_world_pixels(light, window).astype(int) - grey_world_pixels(SCENE, window)
    assert np.abs(gap).max() <= 3  # of levels that were rounded


def test_light_from_one_side_is_removed_in_a_window_and_not_over_the_whole_view():
    def mean_gap(window):
        gap = grey_world_pixels(FROM_ONE_SIDE, window).astype(int) - grey_world_pixels(SCENE, window)
        return float(np.abs(gap).mean())

    assert mean_gap(0.25) < 6 < 20 < mean_gap(1.0)


def test_a_column_is_scaled_by_the_mean_of_a_quarter_of_the_circle_around_it():
    view = np.full((2, 40, 3), 55, np.uint8)
    view[:, 2] = 165
    expected = np.full(40, 128.0)
    expected[np.arange(-3, 8)] = 108.0  # 55 x 128 / 65: the mean of ten columns of 55 and one of 165 is 65
    expected[2] = 255.0
    described = MeanRgb(segments=40, grey_world="local").step(CTX, Panorama(view)).features.values
    assert described == pytest.approx(np.repeat(expected[:, None], 3, axis=1))
    whole = grey_world_pixels(view, 1.0)[0, [0, 2], 0]  # of 40 columns the mean is 57.75
    assert whole.tolist() == [round(55 * 128 / 57.75), 255]


def test_black_stays_black_and_what_is_too_bright_is_cut():
    assert not grey_world_pixels(np.zeros_like(SCENE), 0.25).any()
    view = np.zeros_like(SCENE)
    view[:, ::10] = 200
    assert set(np.unique(grey_world_pixels(view, 0.25))) == {0, 255}


@pytest.mark.parametrize("stage", [HsvHistogram, ColourHistogram, MeanRgb, HaarIntegral])
def test_features_of_two_lights_agree(stage):
    def gap(grey_world):
        described = [
            stage(segments=36, grey_world=grey_world).step(CTX, Panorama(light)).features.values
            for light in (SCENE, WARM)
        ]
        return float(np.abs(described[0] - described[1]).mean())

    assert gap("local") < 0.25 * gap("none")
    assert gap("whole") < 0.25 * gap("none")


def test_windows_have_a_gain_each():
    stage = HaarIntegral(grey_world="local")
    described = [
        stage.step(CTX, Windows(light[None, :, :60], np.zeros(1), 1.0)).features.values for light in (SCENE, WARM)
    ]
    assert np.abs(described[0] - described[1]).mean() < 0.01

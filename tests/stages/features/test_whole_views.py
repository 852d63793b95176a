"""Whole views by cosine transform and Fourier spectrum, of turned pictures and of a turned robot."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy import fft
from turned_robot import look

from omninav.pipeline import Context, Stage
from omninav.stages.features.averaged_strip import averaged_strip, local_contrast
from omninav.stages.features.dct import CosineTransform, cosine_basis, lowest_frequencies
from omninav.stages.features.fourier import SegmentSpectrum, spectrum_around
from omninav.stages.values.image import Panorama
from omninav.stages.values.views import WholeView

STAGES = [
    CosineTransform(),
    CosineTransform(channels="colour", mean=True, contrast="none"),
    SegmentSpectrum(),
    SegmentSpectrum(contrast="none"),
]


def described(stage: Any, pixels: np.ndarray) -> WholeView:
    context = Context("features")
    stage.setup(context)
    view = stage.step(context, panorama=Panorama(pixels)).view
    assert isinstance(view, WholeView)
    return view


def test_the_basis_is_the_orthonormal_transform_of_scipy() -> None:
    signal = np.random.default_rng(0).normal(size=(24, 3))
    basis = cosine_basis(24)
    assert basis @ signal == pytest.approx(fft.dct(signal, axis=0, norm="ortho"))


def test_coefficients_are_the_lowest_of_the_strips_transform_in_order() -> None:
    down, across = lowest_frequencies(4, 6, 6, True)
    assert list(zip(down.tolist(), across.tolist(), strict=True)) == [(0, 0), (0, 1), (1, 0), (0, 2), (1, 1), (2, 0)]
    assert list(zip(*(part.tolist() for part in lowest_frequencies(4, 6, 2, False)), strict=True)) == [(0, 1), (1, 0)]
    pixels = np.random.default_rng(1).integers(0, 256, (80, 360, 3), dtype=np.uint8)
    stage = CosineTransform(coefficients=20, mean=True, contrast="none")
    strip = averaged_strip(pixels, stage.rows, stage.columns, "brightness")[..., 0]
    whole = fft.dctn(strip.astype(np.float64), norm="ortho")
    expected = whole[lowest_frequencies(stage.rows, stage.columns, 20, True)]
    assert described(stage, pixels).values == pytest.approx(expected, rel=1e-4, abs=1e-3)


def test_all_coefficients_keep_the_distance_of_the_strips() -> None:
    a, b = np.random.default_rng(2).integers(0, 256, (2, 8, 12, 3), dtype=np.uint8)
    stage = CosineTransform(
        coefficients=96, contrast="none", mean=True, rows=8, columns=12, headings=1, channels="colour"
    )
    apart = described(stage, a).distances(described(stage, b).values[None])
    assert apart == pytest.approx([np.linalg.norm(a.astype(float) - b)], rel=1e-5)


def test_the_mean_is_what_a_brighter_picture_changes() -> None:
    pixels = np.random.default_rng(4).integers(0, 200, (80, 360, 3), dtype=np.uint8)
    for stage in (CosineTransform(contrast="none"), SegmentSpectrum(mean=False, contrast="none")):
        assert described(stage, pixels + 40).values == pytest.approx(described(stage, pixels).values, abs=0.2)
    stage = CosineTransform(mean=True, contrast="none")
    with_mean = described(stage, pixels + 40).values - described(stage, pixels).values
    assert with_mean[0] == pytest.approx(40 * math.sqrt(16 * 72), rel=1e-3)


def test_a_strip_is_the_mean_of_its_parts_and_its_contrast_that_to_20_degrees_around() -> None:
    pixels = np.random.default_rng(5).integers(0, 256, (80, 360, 3), dtype=np.uint8)
    expected = pixels.reshape(4, 20, 36, 10, 3).mean(axis=(1, 3))
    strip, contrast = (averaged_strip(pixels, 4, 36, "colour", how) for how in ("none", "local"))
    assert strip == pytest.approx(expected, abs=1e-3)
    assert contrast == pytest.approx(local_contrast(strip, 2.0, 1.0), abs=1e-5)  # columns of 10 degrees, rows of 20


def test_contrast_does_not_know_how_bright_the_lamps_are() -> None:
    pixels = np.kron(
        np.random.default_rng(9).integers(40, 120, (8, 36, 3), dtype=np.uint8), np.ones((10, 10, 1), np.uint8)
    )
    dim, bright = (averaged_strip(part, 8, 36, "colour", "local") for part in (pixels, 2 * pixels - 10))
    assert bright == pytest.approx(dim, abs=0.1)
    assert dim.std() == pytest.approx(1.0, abs=0.1)


def test_contrast_is_in_standard_deviations_with_noise_of_five_grey_levels() -> None:
    pixels = np.tile(np.array([100, 124], np.uint8)[:, None], (8, 18, 3))
    # Its parts are 24 apart and narrow against the surroundings, which are grey on average; 12 / 13 is of 5, 12, 13.
    assert np.abs(averaged_strip(pixels, 8, 36, "colour", "local")) == pytest.approx(12.0 / 13.0, rel=0.02)


def test_local_contrast_goes_around_the_circle_and_counts_a_lit_side_as_little() -> None:
    strip = np.random.default_rng(10).uniform(50, 100, (16, 72, 1)).astype(np.float32)
    contrast = local_contrast(strip, 4.0, 4.0)
    assert local_contrast(np.roll(strip, 30, axis=1), 4.0, 4.0) == pytest.approx(
        np.roll(contrast, 30, axis=1), abs=1e-4
    )
    lit = strip.copy()
    lit[:, 20:50] *= 2.0
    inside = local_contrast(lit, 4.0, 4.0)[:, 32:38]
    assert inside == pytest.approx(contrast[:, 32:38], abs=0.15)


def test_a_wave_around_the_robot_is_one_coefficient_of_its_row_and_channel() -> None:
    sizes = np.arange(1.0, 7.0)
    waves = sizes * (10.0 + np.cos(np.arange(8) * np.pi / 4)[:, None])
    expected = np.outer(sizes, [10.0, 0.5, 0.0]) * np.sqrt(8.0)
    strip = waves.reshape(8, 2, 3).swapaxes(0, 1)
    assert spectrum_around(strip, 3) == pytest.approx(expected, abs=1e-9)
    assert spectrum_around(strip, 3, mean=False) == pytest.approx(expected * [0.0, 1.0, 1.0], abs=1e-9)


@pytest.mark.parametrize("stage", STAGES, ids=repr)
@pytest.mark.parametrize("columns", [0, 10, 130, -70])
def test_a_panorama_moved_to_the_right_is_the_same_place_seen_by_a_robot_turned_left(
    stage: Stage, columns: int
) -> None:
    pixels = np.kron(
        np.random.default_rng(7).integers(0, 256, (4, 18, 3), dtype=np.uint8), np.ones((20, 20, 1), np.uint8)
    )
    kept = described(stage, pixels).values[None]
    view = described(stage, np.roll(pixels, columns, axis=1))
    scale = float(np.linalg.norm(kept))
    assert view.distances(kept)[0] < 1e-5 * scale
    assert abs(math.remainder(view.turns(kept)[0] - columns * 2 * math.pi / 360, 2 * math.pi)) < math.radians(2)


@pytest.mark.parametrize("stage", STAGES, ids=repr)
@pytest.mark.parametrize("turn", [0.5, -1.2, 2.9])
def test_a_robot_that_turned_on_the_spot_knows_the_place_and_its_turn(stage: Stage, turn: float) -> None:
    """Rendered through the mirror at two headings; a metre further on looks less alike than turned."""
    kept = described(stage, look("panorama", 0.4, 5.8, 4.5).pixels).values[None]
    view = described(stage, look("panorama", 0.4 + turn, 5.8, 4.5).pixels)
    away = described(stage, look("panorama", 0.4, 6.8, 4.5).pixels)
    assert view.distances(kept)[0] < 0.5 * away.distances(kept)[0]
    assert abs(math.remainder(view.turns(kept)[0] - turn, 2 * math.pi)) < math.radians(2)


def test_the_papers_form_compares_unturned() -> None:
    stage = CosineTransform(headings=1, contrast="none")
    pixels = np.random.default_rng(8).integers(0, 256, (80, 360, 3), dtype=np.uint8)
    view = described(stage, pixels)
    assert view.turns(view.values[None]).tolist() == [0.0]
    assert described(stage, np.roll(pixels, 180, axis=1)).distances(view.values[None])[0] > 100.0


@pytest.mark.parametrize(
    ("stage", "changed", "says"),
    [
        (CosineTransform(), {"headings": 7}, "do not divide"),
        (CosineTransform(), {"rows": 2, "columns": 36, "coefficients": 72}, "has fewer"),
    ],
)
def test_parameters_that_do_not_fit_each_other_are_refused(
    stage: CosineTransform, changed: dict[str, Any], says: str
) -> None:
    with pytest.raises(ValueError, match=says):
        dataclasses.replace(stage, **changed)


def test_views_lie_in_memory_as_a_cache_gives_them_back() -> None:
    # In another order products with them differ in their last bit: a run with a warm cache from one with a cold one.
    stage = CosineTransform()
    stage.setup(Context("features"))
    pixels = np.random.default_rng(0).integers(0, 256, (80, 360, 3), np.uint8)
    view = stage.step(Context("features"), Panorama(pixels)).view
    assert view.turned.flags.c_contiguous

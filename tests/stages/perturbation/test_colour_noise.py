"""Occlusion by colour noise."""

from collections import Counter

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.perturbation.colour_noise import ColourNoise, random_parts, sectors
from omninav.stages.values.image import Panorama

GREY = Panorama(np.full((60, 360, 3), 7, dtype=np.uint8), 0.5, -0.5)


def covered(stage: ColourNoise, frame: int = 0, seed: int = 0) -> np.ndarray:
    ctx = Context("disturbance", np.random.default_rng(seed))
    ctx.tick = Tick(index=frame, stamp=0, log=0, frame=frame)
    return stage.step(ctx, GREY).panorama.pixels


@pytest.mark.parametrize("share", [0.1, 0.35, 0.8])
def test_the_share_that_is_asked_for_is_covered(share):
    for seed in range(20):
        mask = sectors(np.random.default_rng(seed), 60, 360, share, 40 / 360)
        assert mask.mean() == pytest.approx(share, abs=1 / 360)


@pytest.mark.parametrize(("share", "number"), [(0.04, 1), (0.4, 4)])
def test_there_are_as_many_sectors_as_their_mean_width_allows_and_never_none(share, number):
    masks = [sectors(np.random.default_rng(seed), 1, 360, share, 0.1)[0] for seed in range(100)]
    assert max(np.count_nonzero(mask & ~np.roll(mask, 1)) for mask in masks) == number


def test_sectors_reach_over_the_full_height():
    mask = sectors(np.random.default_rng(1), 60, 360, 0.4, 40 / 360)
    assert (mask == mask[0]).all()


def test_every_column_is_as_likely_to_be_covered():
    masks = [sectors(np.random.default_rng(seed), 1, 36, 0.4, 40 / 360)[0] for seed in range(3000)]
    assert np.mean(masks, axis=0) == pytest.approx(0.4, abs=4 * np.sqrt(0.24 / 3000))


def test_every_split_is_as_likely_as_any_other():
    rng = np.random.default_rng(0)
    seen = Counter(tuple(random_parts(rng, 4, 3).tolist()) for _ in range(15_000))
    assert len(seen) == 15  # (4 + 2 over 2)
    assert all(sum(split) == 4 for split in seen)
    excess = sum((count - 1000) ** 2 / 1000 for count in seen.values())
    assert excess < 36.1  # chi square with 14 degrees of freedom: one in a thousand
    assert random_parts(rng, 5, 1).tolist() == [5]


def test_the_pattern_follows_the_frame_and_not_the_seed():
    stage = ColourNoise(share=0.4)
    assert (covered(stage, 3, seed=1) == covered(stage, 3, seed=2)).all()
    assert (covered(stage, 3) != covered(stage, 4)).any()


def test_noise_has_the_mean_and_spread_asked_for_and_the_rest_is_untouched(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.perturbation.colour_noise.MEAN", 120.0)
    monkeypatch.setattr("omninav.stages.perturbation.colour_noise.SIGMA", 20.0)
    pixels = covered(ColourNoise(share=0.5))
    noisy = (pixels != 7).any(axis=2)
    assert noisy.mean() == pytest.approx(0.5, abs=0.01)
    assert pixels[noisy].mean(axis=0) == pytest.approx([120.0] * 3, abs=1.0)
    assert pixels[noisy].std(axis=0) == pytest.approx([20.0] * 3, abs=1.0)
    for mean, cut in ((-300.0, 0), (500.0, 255)):
        monkeypatch.setattr("omninav.stages.perturbation.colour_noise.MEAN", mean)
        assert (covered(ColourNoise(share=1.0)) == cut).all()


def test_no_share_changes_nothing():
    assert (covered(ColourNoise(share=0.0)) == GREY.pixels).all()

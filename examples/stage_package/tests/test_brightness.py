import numpy as np
from omninav_brightness import BrightnessHistogram

from omninav.stages.values.image import Panorama
from omninav.testing import check_stage


def panorama(seed: int) -> Panorama:
    return Panorama(np.random.default_rng(seed).integers(0, 256, (40, 180, 3)).astype(np.uint8))


def test_it_keeps_what_every_stage_promises() -> None:
    check_stage(BrightnessHistogram(segments=12), [{"panorama": panorama(seed)} for seed in range(4)])


def test_a_black_half_falls_into_the_darkest_bin() -> None:
    pixels = np.zeros((40, 180, 3), np.uint8)
    pixels[:, 90:] = 255
    (out,) = check_stage(BrightnessHistogram(segments=2, bins=4), [{"panorama": Panorama(pixels)}])
    assert out["features"].values.tolist() == [[1, 0, 0, 0], [0, 0, 0, 1]]

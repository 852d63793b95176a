"""Finds the elevations of a strip that does not say them, by what its images show of one another."""

import math
from dataclasses import replace

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.landmarks.map_making import LocalViews, PairMatches, fitting_matches

from .equirectangular import Equirectangular
from .model import Camera
from .strip import Strip

STEPS = math.radians(2.5), math.radians(0.5)
"""Spacing of the horizons that are tried, of all and around the best (rad): 5 degrees off, half as many fit."""
MIN_GAIN = 1.3
"""Factor by which more matches must fit than with the horizon in the middle."""
MIN_FITTING = 100
"""Matches that must fit: fewer agree with some horizon by chance."""


def with_elevations_found(
    camera: Camera, pixels: Array, views: LocalViews, matches: PairMatches, poses: Array
) -> Equirectangular | None:
    """The strip with the elevations at which most matches fit the motion between their references.

    `pixels` (F, 2) of all features, `poses` (R, 3) of the references. Pixels are taken to be square. None where the
    camera is no strip or says its elevations, and where the guess, the horizon in the middle, is about as good.
    """
    if not isinstance(camera, Strip) or camera.elevations_known or not len(matches.first):
        return None
    height = min(2.0 * math.pi * camera.height_px / camera.width, math.pi)
    guess = Equirectangular(
        camera.width,
        camera.height_px,
        camera.column_of_forward,
        height=camera.height,
        yaw=camera.yaw,
        sense=camera.sense,
        elevation_top=0.5 * height,
        elevation_bottom=-0.5 * height,
    )

    def fitting(strip: Strip) -> int:
        return int(fitting_matches(views.looking_along(strip.unproject(pixels)[0]), matches, poses).sum())

    lowest, highest = height - 0.5 * math.pi, 0.5 * math.pi
    best, number, first, last = guess, 0, lowest, highest
    for step in STEPS:
        for top in np.arange(first, last + step, step).clip(lowest, highest).tolist():
            strip = replace(guess, elevation_top=top, elevation_bottom=top - height)
            if (fits := fitting(strip)) > number:
                best, number = strip, fits
        first, last = best.elevations[0] - step, best.elevations[0] + step
    return best if number >= max(MIN_GAIN * fitting(guess), MIN_FITTING) else None

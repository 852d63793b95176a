"""A camera that is calibrated by what it sees: its fields in the bundle adjustment, and the elevations of a strip."""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from omninav.pipeline import BadInput
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.landmarks.adjustment import Lens, rotations_about
from omninav.stages.geometry.landmarks.map_making import LocalViews, PairMatches, fitting_matches

from .equirectangular import Equirectangular
from .model import Camera
from .strip import Strip

Model = TypeVar("Model", bound=Camera)
AXIS = {"centre_x": math.inf, "centre_y": math.inf}
"""The point where a mirror's or lens's axis meets the image, nothing known of it: a robot on a floor shows it best."""
SAME_RAY = 1e-6
"""Difference of unit vectors up to which a bearing is that of its pixel."""
TILT = ("roll", "pitch")
"""Parameters of a camera that leans (rad): it is turned about x by the roll, then about y by the pitch."""
TILT_SIGMA = math.radians(3.0)
"""Standard deviation of a camera's roll and pitch (rad) that nothing states: of what is screwed on by eye."""
STEPS = math.radians(2.5), math.radians(0.5)
"""Spacing of the horizons that are tried, of all and around the best (rad): 5 degrees off, half as many fit."""
MIN_GAIN = 1.3
"""Factor by which more matches must fit than with the horizon in the middle."""
MIN_FITTING = 100
"""Matches that must fit: fewer agree with some horizon by chance."""


def adjustable(camera: Camera, pixels: Array, sigmas: Mapping[str, float] = AXIS) -> Lens:
    """Fields of a camera as parameters that `adjusted` corrects, seen at `pixels` (O, 2).

    `sigmas`: the fields by name, and the standard deviations of what the camera's description states, in their
    own units. On a flat floor the yaw is not separable from the headings unless there is odometry, and the scale of
    elevations not from that of heights: a focal length, or a mirror's half axis, needs a small standard deviation. A
    pixel that looks nowhere has a bearing of zero, which agrees with no landmark. Raises BadInput for a field that the
    camera does not have, or that holds no number.
    """
    numbers = [each.name for each in fields(camera) if type(getattr(camera, each.name)) is float]
    for name in sigmas:
        if name not in numbers:
            raise BadInput(
                f"camera: a {camera.projection} camera has no number {name!r} to calibrate, expected of "
                f"{', '.join(numbers)}"
            )

    def bearings(corrections: Array) -> Array:
        with np.errstate(all="ignore"):
            rays, looks = corrected(camera, sigmas, corrections).unproject(pixels)
        return np.where(looks[:, None], rays, 0.0)

    return Lens(bearings, np.array([*sigmas.values()]))


def corrected(camera: Model, sigmas: Mapping[str, float], corrections: Array) -> Model:
    """The camera with corrections (K,) added to the fields that `sigmas` names."""
    changed: dict[str, Any] = {
        name: getattr(camera, name) + float(by) for name, by in zip(sigmas, corrections, strict=True)
    }
    return replace(camera, **changed)


def with_tilt(lens: Lens) -> Lens:
    """The lens of a camera that may lean, with the parameters of its `TILT` at the end."""

    def bearings(corrections: Array) -> Array:
        return leaning(lens.bearings(corrections[: -len(TILT)]), *corrections[-len(TILT) :])

    return Lens(bearings, np.append(lens.sigmas, [TILT_SIGMA] * len(TILT)))


def leaning(rays: Array, roll: float, pitch: float) -> Array:
    """Rays (N, 3) of a camera that leans (rad), in the frame of the level robot."""
    (mounted,) = rotations_about(np.array([pitch]), 1) @ rotations_about(np.array([roll]), 0)
    return np.asarray(rays @ mounted.T)


def observed(camera: Camera, poses_given: bool) -> dict[str, float]:
    """The fields that a drive on a floor shows, for `adjustable`: where the axis meets the image, and the yaw too where
    poses are given. None of a camera without a ring, whose centre is hardly separable from its heading."""
    numbers = {each.name for each in fields(camera) if type(getattr(camera, each.name)) is float}
    if camera.ring is None or not camera.elevations_known or not numbers >= set(AXIS):
        return {}
    return {**AXIS, **({"yaw": math.inf} if poses_given else {})}


def with_elevations_found(
    camera: Camera, pixels: Array, views: LocalViews, matches: PairMatches, poses: Array
) -> Equirectangular | None:
    """The strip with the elevations at which most matches fit the motion between their references.

    `pixels` (F, 2) of all features, `poses` (R, 3) of the references. Pixels are taken to be square. None where the
    camera is no strip or states its elevations, and where the guess, the horizon in the middle, is about as good.
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

"""Cameras as rays: for each pixel the direction it looks along, in the robot's frame (x forward, y left, z up)."""

import math
from typing import NamedTuple

import numpy as np

from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array, Floats, Ints, Shorts
from omninav.stages.recordings.camera_yaml import camera_from
from omninav.stages.recordings.recording import UnreadableRecording

from .config import Sensor, WorldConfig

RAYS_PER_WEDGE = 200
"""About how many rays share one look around: fewer looks for more rays cost less, but each finds more bodies."""


class Rays(NamedTuple):
    """The pixels of a camera that see something, in wedges of like azimuth.

    `rows` and `columns` of the image. `pixels` (N,): their numbers, row by row from 0, wedge after wedge.
    `directions` (N, 3): unit rays in the robot's frame. `footprint` (N,): angle (rad) across a pixel. `gain` (N,):
    share that vignetting leaves. `wedge_start` (W + 1,): first ray of each wedge; `wedges` (W, 3): its lowest and
    highest azimuth (rad, counter-clockwise from forward) and steepest slope. `ray_of` (rows * columns,): ray of each
    pixel, or -1. `own` (M, 3): colours of the M pixels that see the robot itself; their gains and numbers in `ray_of`
    follow those of the rays.
    """

    rows: int
    columns: int
    pixels: Shorts
    directions: Floats
    footprint: Floats
    gain: Floats
    wedge_start: Shorts
    wedges: Array
    ray_of: Shorts
    own: Floats


def camera_of(world: WorldConfig) -> Camera:
    """A world's camera. Raises `UnreadableRecording` for a description that is wrong, or states no height."""
    camera = camera_from(world.camera, "world.camera")
    if camera.height is None:
        raise UnreadableRecording("world.camera: key 'height' is missing: metres of the camera above the floor")
    return camera


def shutter_times(sensor: Sensor, at: float) -> Array:
    """Moments (s) of the sub-exposures of an image taken at a time: they are spaced evenly around it."""
    if sensor.shutter == 0.0:
        return np.array([at])
    parts: Array = at + sensor.shutter * ((np.arange(sensor.sub_exposures) + 0.5) / sensor.sub_exposures - 0.5)
    return parts


DECK_HEIGHT_M = 0.45
"""Height (m) of the robot's deck: in the ordinary mirror it just fills the middle that is masked."""
HOUSING_RADIUS_M = 0.02
"""Radius (m) of the camera below the mirror."""
LENS_BELOW_FOCUS_M = 0.073
"""Distance (m) of the camera's lens below the mirror's focus."""


def camera_rays(camera: Camera, vignetting: float = 0.0, robot_radius: float = 0.0) -> Rays:
    """The rays of a camera; `vignetting` is the share of light that is lost in the corners of the image.

    A robot of `robot_radius` (m) is seen in the image where the camera's height is known; there is none if that is 0.
    Raises BadInput for a donut whose ring is not known.
    """
    grid, seen = camera.grid(), camera.mask()
    directions, disc = camera.unproject(grid)
    if camera.ring is not None:
        disc &= camera.ring._replace(inner=0.0).holds(grid[..., 0], grid[..., 1])
    own = _own_body(directions, robot_radius, camera)
    is_own = disc & np.isfinite(own).all(axis=-1)
    seen &= ~is_own
    across, down = (np.linalg.norm(np.gradient(directions, axis=axis), axis=-1) for axis in (1, 0))
    with np.errstate(invalid="ignore"):
        footprint = np.sqrt(across * down)  # angles between neighbouring rays
    corner = math.hypot(camera.width / 2, camera.height_px / 2)
    rim = np.hypot(grid[..., 0] + 0.5 - camera.width / 2, grid[..., 1] + 0.5 - camera.height_px / 2) / corner
    if camera.wraps:
        rim = np.zeros_like(rim)
    pixels = np.flatnonzero(seen).astype(np.int32)
    order, wedge_start, wedges = _wedges(directions[seen])
    ray_of = np.full(seen.size, -1, dtype=np.int32)
    ray_of[pixels[order]] = np.arange(len(pixels), dtype=np.int32)
    ray_of[is_own.ravel()] = len(pixels) + np.arange(is_own.sum(), dtype=np.int32)
    gain = 1.0 - vignetting * rim**2
    footprint = np.nan_to_num(footprint[seen], nan=float(np.nanmax(footprint)))
    return Rays(
        rows=camera.height_px,
        columns=camera.width,
        pixels=pixels[order],
        directions=np.ascontiguousarray(directions[seen][order], dtype=np.float32),
        footprint=footprint[order].astype(np.float32),
        gain=np.concatenate([gain[seen][order], gain[is_own]]).astype(np.float32),
        wedge_start=wedge_start,
        wedges=wedges,
        ray_of=ray_of,
        own=own[is_own].astype(np.float32),
    )


def leaning(rays: Rays, rotation: Array) -> Rays:
    """The rays of a camera that leans: `rotation` (3, 3) brings its frame to that of the level robot.

    The robot's own image stays as it is.
    """
    directions = rays.directions @ rotation.T.astype(np.float32)
    order, wedge_start, wedges = _wedges(directions.astype(np.float64))
    seen = len(rays.pixels)
    ray_of = rays.ray_of.copy()
    ray_of[rays.pixels[order]] = np.arange(seen, dtype=np.int32)
    return rays._replace(
        pixels=rays.pixels[order],
        directions=np.ascontiguousarray(directions[order]),
        footprint=rays.footprint[order],
        gain=np.concatenate([rays.gain[:seen][order], rays.gain[seen:]]),
        wedge_start=wedge_start,
        wedges=wedges,
        ray_of=ray_of,
    )


def _own_body(directions: Array, radius: float, camera: Camera) -> Array:
    """Colours (..., 3), blue-green-red, of the robot along rays (..., 3) from its camera; NaN where they pass it.

    It is a round deck with a mark in front, and under a mirror the camera that looks up at it.
    """
    colours = np.full(directions.shape, np.nan)
    height = camera.height
    if radius <= 0.0 or height is None or height <= DECK_HEIGHT_M:
        return colours
    with np.errstate(invalid="ignore", divide="ignore"):
        level = np.hypot(directions[..., 0], directions[..., 1]) / np.maximum(-directions[..., 2], 1e-9)
        azimuth = np.arctan2(directions[..., 1], directions[..., 0])
        off = level * (height - DECK_HEIGHT_M)
        deck = off < radius
        colours[deck] = (95.0, 82.0, 70.0)
        colours[deck & (off > 0.88 * radius)] = (38.0, 36.0, 34.0)
        colours[deck & (np.abs(azimuth) < 0.2)] = (40.0, 60.0, 205.0)
        if camera.sees_itself:
            off = level * LENS_BELOW_FOCUS_M
            for share, colour in ((1.0, (46.0, 44.0, 42.0)), (0.6, (120.0, 118.0, 115.0)), (0.5, (40.0, 22.0, 18.0))):
                colours[off < share * HOUSING_RADIUS_M] = colour
    return colours


def _wedges(directions: Array) -> tuple[Ints, Shorts, Array]:
    """Rays (N, 3) by azimuth: the order that brings wedges together and lower rays first, and `Rays`' two arrays."""
    azimuth = np.arctan2(directions[:, 1], directions[:, 0])
    level = np.hypot(directions[:, 0], directions[:, 1])
    slope = directions[:, 2] / np.maximum(level, 1e-9)
    columns, number = np.unique(np.round(azimuth * 1e5), return_inverse=True)
    if len(columns) * 16 <= len(azimuth):  # a strip: all rays of a column look one way
        return _gathered(number, columns[number] * 1e-5, azimuth, slope)
    taken = len(np.unique(np.floor(azimuth * 180.0 / math.pi))) / 360.0
    count = max(8, round(len(azimuth) / RAYS_PER_WEDGE / taken))
    around = 2.0 * math.pi / count
    number = np.round((azimuth - azimuth[0]) / around)
    return _gathered(np.mod(number.astype(np.int64), count), azimuth[0] + number * around, azimuth, slope)


def _gathered(number: Ints, middle: Array, azimuth: Array, slope: Array) -> tuple[Ints, Shorts, Array]:
    """Rays (N,) in the order of their wedges' numbers, and the wedges; `middle` is the azimuth of each ray's wedge."""
    order = np.lexsort((slope, number))
    _, start = np.unique(number[order], return_index=True)
    off = (azimuth - middle)[order]
    around = middle[order][start]
    lowest, highest = np.minimum.reduceat(off, start), np.maximum.reduceat(off, start)
    steepest = np.maximum.reduceat(slope[order], start)
    wedges = np.stack([around + lowest - 1e-6, around + highest + 1e-6, steepest], axis=1)
    return order, np.append(start, len(order)).astype(np.int32), wedges

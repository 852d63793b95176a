"""Cameras as rays: for each pixel the direction it looks along, in the robot's frame (x forward, y left, z up)."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omninav.stages.camera.catadioptric import back_project
from omninav.stages.camera.models import Camera, Cylindrical, Equirectangular, HyperbolicMirror, Perspective

from .config import CameraConfig, CylinderCamera, EquirectangularCamera, MirrorCamera, Sensor

F64 = npt.NDArray[np.float64]


RAYS_TO_A_WEDGE = 200
"""About how many rays share one look around: fewer looks for more rays cost less, but each finds more bodies."""


@dataclass(frozen=True, eq=False)
class Rays:
    """The pixels of a camera that see something, in wedges of like azimuth.

    `shape`: rows and columns of the picture. `pixels` (N,): their numbers, row by row from 0, wedge after wedge.
    `directions` (N, 3): unit rays in the robot's frame. `footprint` (N,): angle (rad) across a pixel. `gain` (N,):
    share that vignetting leaves. `wedge_start` (W + 1,): first ray of each wedge; `wedges` (W, 3): its lowest and
    highest azimuth (rad, counter-clockwise from forward) and steepest slope. `ray_of` (rows * columns,): ray of each
    pixel, or -1. `own` (M, 3): colours of the M pixels that see the robot itself; their gains and numbers in `ray_of`
    follow those of the rays.
    """

    shape: tuple[int, int]
    pixels: npt.NDArray[np.int32]
    directions: npt.NDArray[np.float32]
    footprint: npt.NDArray[np.float32]
    gain: npt.NDArray[np.float32]
    wedge_start: npt.NDArray[np.int32]
    wedges: F64
    ray_of: npt.NDArray[np.int32]
    own: npt.NDArray[np.float32]


def camera_of(config: CameraConfig) -> Camera:
    """A world's camera as the value that travels on wires."""
    if isinstance(config, MirrorCamera):
        return HyperbolicMirror(
            width=config.width,
            height_px=config.height_px,
            focal_x=config.focal,
            focal_y=config.focal,
            centre_x=config.centre[0],
            centre_y=config.centre[1],
            a=config.a,
            b=config.b,
            inner_radius_px=config.inner_radius_px,
            outer_radius_px=config.outer_radius_px,
            height=config.height,
            yaw=config.yaw,
        )
    if isinstance(config, CylinderCamera | EquirectangularCamera):
        strip = Cylindrical if isinstance(config, CylinderCamera) else Equirectangular
        return strip(
            width=config.width,
            height_px=config.height_px,
            column_of_forward=config.width / 2,
            elevation_top=config.elevation_top,
            elevation_bottom=config.elevation_bottom,
            height=config.height,
        )
    return Perspective(
        width=config.width,
        height_px=config.height_px,
        focal_x=config.focal,
        focal_y=config.focal,
        centre_x=config.centre[0],
        centre_y=config.centre[1],
        height=config.height,
        yaw=config.yaw,
    )


def shutter_times(sensor: Sensor, at: float) -> F64:
    """Moments (s) of the sub-exposures of a picture taken at a time: they lie evenly around it."""
    if sensor.shutter == 0.0:
        return np.array([at])
    parts: F64 = at + sensor.shutter * ((np.arange(sensor.sub_exposures) + 0.5) / sensor.sub_exposures - 0.5)
    return parts


DECK = 0.45
"""Height (m) of the robot's deck: in the ordinary mirror it just fills the middle that is masked."""
HOUSING = 0.02
"""Radius (m) of the camera below the mirror."""
HANGS = 0.073
"""Distance (m) of the camera's lens below the mirror's focus."""


def camera_rays(camera: Camera, vignetting: float = 0.0, robot_radius: float = 0.0) -> Rays:
    """The rays of a camera; `vignetting` is the share of light that is lost in the corners of the picture.

    A robot of `robot_radius` (m) is seen in the picture where the camera's height is known; there is none if that is 0.
    Raises `TypeError` for a projection whose rays are not known (a donut without a mirror model).
    """
    v, u = np.mgrid[0 : camera.height_px, 0 : camera.width].astype(np.float64)
    seen = np.ones(u.shape, dtype=bool)
    if isinstance(camera, HyperbolicMirror):
        directions = turn(mirror_directions(camera, np.stack([u, v], axis=-1)), camera.yaw)
        radius = np.hypot(u - camera.centre_x, v - camera.centre_y)
        seen = radius <= camera.outer_radius_px
        ring = seen & (radius >= camera.inner_radius_px)
    elif isinstance(camera, Cylindrical):
        if camera.elevation_top is None or camera.elevation_bottom is None:
            raise TypeError("a cylindrical camera without elevation_top and elevation_bottom has no rays; give both")
        top, bottom = math.tan(camera.elevation_top), math.tan(camera.elevation_bottom)
        slope = top + (bottom - top) * (v + 0.5) / camera.height_px
        directions = from_angles(strip_azimuths(camera, u), np.arctan(slope))
    elif isinstance(camera, Equirectangular):
        span = camera.elevation_bottom - camera.elevation_top
        directions = from_angles(strip_azimuths(camera, u), camera.elevation_top + span * (v + 0.5) / camera.height_px)
    elif isinstance(camera, Perspective):
        down = (v - camera.centre_y) / camera.focal_y
        right = (u - camera.centre_x - camera.skew * down) / camera.focal_x
        ahead = np.stack([np.ones_like(u), -right, -down], axis=-1)
        directions = turn(ahead / np.linalg.norm(ahead, axis=-1, keepdims=True), camera.yaw)
    else:
        raise TypeError(
            f"no rays are known for {type(camera).__name__}; use HyperbolicMirror, Cylindrical, "
            "Equirectangular or Perspective"
        )
    own = _own_body(directions, robot_radius, camera)
    is_own = seen & np.isfinite(own).all(axis=-1)
    if isinstance(camera, HyperbolicMirror):
        seen = ring
    seen &= np.isfinite(directions).all(axis=-1) & ~is_own
    across, down_angle = _pixel_angles(directions)
    with np.errstate(invalid="ignore"):
        footprint = np.sqrt(across * down_angle)
    corner = math.hypot(camera.width / 2, camera.height_px / 2)
    rim = np.hypot(u + 0.5 - camera.width / 2, v + 0.5 - camera.height_px / 2) / corner
    if isinstance(camera, Cylindrical | Equirectangular):
        rim = np.zeros_like(rim)
    pixels = np.flatnonzero(seen).astype(np.int32)
    order, wedge_start, wedges = _wedges(directions[seen])
    ray_of = np.full(seen.size, -1, dtype=np.int32)
    ray_of[pixels[order]] = np.arange(len(pixels), dtype=np.int32)
    ray_of[is_own.ravel()] = len(pixels) + np.arange(is_own.sum(), dtype=np.int32)
    gain = 1.0 - vignetting * rim**2
    footprint = np.nan_to_num(footprint[seen], nan=float(np.nanmax(footprint)))
    return Rays(
        shape=(camera.height_px, camera.width),
        pixels=pixels[order],
        directions=np.ascontiguousarray(directions[seen][order], dtype=np.float32),
        footprint=footprint[order].astype(np.float32),
        gain=np.concatenate([gain[seen][order], gain[is_own]]).astype(np.float32),
        wedge_start=wedge_start,
        wedges=wedges,
        ray_of=ray_of,
        own=own[is_own].astype(np.float32),
    )


def _own_body(directions: F64, radius: float, camera: Camera) -> F64:
    """Colours (..., 3), blue-green-red, of the robot along rays (..., 3) from its camera; NaN where they pass it.

    It is a round deck with a mark in front, and under a mirror the camera that looks up at it.
    """
    colours = np.full(directions.shape, np.nan)
    height = getattr(camera, "height", None)
    if radius <= 0.0 or height is None or height <= DECK:
        return colours
    with np.errstate(invalid="ignore", divide="ignore"):
        level = np.hypot(directions[..., 0], directions[..., 1]) / np.maximum(-directions[..., 2], 1e-9)
        azimuth = np.arctan2(directions[..., 1], directions[..., 0])
        off = level * (height - DECK)
        deck = off < radius
        colours[deck] = (95.0, 82.0, 70.0)
        colours[deck & (off > 0.88 * radius)] = (38.0, 36.0, 34.0)
        colours[deck & (np.abs(azimuth) < 0.2)] = (40.0, 60.0, 205.0)
        if isinstance(camera, HyperbolicMirror):
            off = level * HANGS
            for edge, colour in ((HOUSING, (46.0, 44.0, 42.0)), (0.6 * HOUSING, (120.0, 118.0, 115.0)),
                                 (0.5 * HOUSING, (40.0, 22.0, 18.0))):  # fmt: skip
                colours[off < edge] = colour
    return colours


def _wedges(directions: F64) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], F64]:
    """Rays (N, 3) by azimuth: the order that brings wedges together and lower rays first, and `Rays`' two arrays."""
    azimuth = np.arctan2(directions[:, 1], directions[:, 0])
    level = np.hypot(directions[:, 0], directions[:, 1])
    slope = directions[:, 2] / np.maximum(level, 1e-9)
    columns, number = np.unique(np.round(azimuth * 1e5), return_inverse=True)
    if len(columns) * 16 <= len(azimuth):  # a strip: all rays of a column look one way
        return _gathered(number, columns[number] * 1e-5, azimuth, slope)
    taken = len(np.unique(np.floor(azimuth * 180.0 / math.pi))) / 360.0
    count = max(8, round(len(azimuth) / RAYS_TO_A_WEDGE / taken))
    around = 2.0 * math.pi / count
    number = np.round((azimuth - azimuth[0]) / around)
    return _gathered(np.mod(number.astype(np.int64), count), azimuth[0] + number * around, azimuth, slope)


def _gathered(
    number: npt.NDArray[np.int64], middle: F64, azimuth: F64, slope: F64
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], F64]:
    """Rays (N,) in the order of their wedges' numbers, and the wedges; `middle` is the azimuth of each ray's wedge."""
    order = np.lexsort((slope, number))
    _, start = np.unique(number[order], return_index=True)
    off = (azimuth - middle)[order]
    around = middle[order][start]
    lowest, highest = np.minimum.reduceat(off, start), np.maximum.reduceat(off, start)
    steepest = np.maximum.reduceat(slope[order], start)
    wedges = np.stack([around + lowest - 1e-6, around + highest + 1e-6, steepest], axis=1)
    return order, np.append(start, len(order)).astype(np.int32), wedges


def mirror_directions(camera: HyperbolicMirror, pixels: npt.ArrayLike) -> F64:
    """Unit rays (..., 3) in the mirror's frame of pixels (..., 2); NaN where they look past the mirror."""
    return back_project(
        pixels,
        camera.focal_x,
        camera.focal_y,
        camera.centre_x,
        camera.centre_y,
        camera.skew,
        camera.a,
        camera.b,
    )


def strip_azimuths(camera: Cylindrical | Equirectangular, columns: npt.ArrayLike) -> F64:
    """Azimuths (rad, counter-clockwise from forward) of the centres of columns of a strip."""
    sign = 1.0 if camera.sense == "clockwise" else -1.0
    azimuths: F64 = sign * 2.0 * math.pi * (camera.column_of_forward - (np.asarray(columns) + 0.5)) / camera.width
    return azimuths


def from_angles(azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> F64:
    """Unit rays (..., 3) of azimuths and elevations (rad)."""
    azimuth, elevation = np.asarray(azimuth), np.asarray(elevation)
    return np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    )


def turn(rays: F64, yaw: float) -> F64:
    """Rays (..., 3) turned about z, counter-clockwise by `yaw`."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    x, y = rays[..., 0], rays[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y, rays[..., 2]], axis=-1)


def _pixel_angles(directions: F64) -> tuple[F64, F64]:
    """Angles between neighbouring rays along rows and along columns, each (rows, columns)."""
    across = np.linalg.norm(np.gradient(directions, axis=1), axis=-1)
    down = np.linalg.norm(np.gradient(directions, axis=0), axis=-1)
    return across, down

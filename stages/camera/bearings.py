"""Pixels as directions: unit vectors in the robot's frame, from the camera's projection centre."""

import math

import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.problems import BadInput

from .catadioptric import back_project
from .models import (
    Camera,
    Cylindrical,
    Donut,
    Equirectangular,
    Fisheye,
    HyperbolicMirror,
    Perspective,
)

Array = npt.NDArray[np.float64]


def unit_vectors(azimuths: npt.ArrayLike, elevations: npt.ArrayLike) -> Array:
    """Bearings (..., 3) of azimuths (rad, counter-clockwise from forward) and elevations (rad above the horizon)."""
    level = np.cos(elevations)
    parts = np.broadcast_arrays(level * np.cos(azimuths), level * np.sin(azimuths), np.sin(elevations))
    return np.stack(parts, axis=-1).astype(np.float64)


def span_of(top: float | None, bottom: float | None, rows: int, columns: int) -> tuple[float, float]:
    """Elevations (rad) of the upper and lower edge of a panorama: where they are not known, as of square pixels.

    The horizon is taken for the middle then: azimuths are right, elevations a guess.
    """
    if top is None or bottom is None:
        return math.pi * rows / columns, -math.pi * rows / columns
    return top, bottom


def panorama_bearings(points: Array, shape: tuple[int, ...], top: float | None, bottom: float | None) -> Array:
    """Bearings (N, 3) of points (N, 2), columns and rows, in a `Panorama` of `shape` (rows, columns, …).

    Rows are equal steps of elevation from `top` to `bottom` (rad, of the edges; see `span_of` where they are None).
    """
    rows, columns = shape[:2]
    top, bottom = span_of(top, bottom, rows, columns)
    azimuths = math.pi - 2.0 * math.pi * (points[..., 0] + 0.5) / columns
    return unit_vectors(azimuths, top + (bottom - top) * (points[..., 1] + 0.5) / rows)


def camera_bearings(points: Array, camera: Camera) -> Array:
    """Bearings (N, 3) of points (N, 2), columns and rows (pixels), in a camera's picture; NaN where it shows nothing.

    A strip or donut without known elevations has square pixels and its horizon in the middle, as in `span_of`. Raises
    BadInput for a donut whose ring is not known.
    """
    u, v = points[..., 0], points[..., 1]
    match camera:
        case HyperbolicMirror():
            k = camera.focal_x, camera.focal_y, camera.centre_x, camera.centre_y, camera.skew
            return _turned(back_project(points, *k, camera.a, camera.b), camera.yaw)
        case Fisheye():
            sign = 1.0 if camera.sense == "clockwise" else -1.0
            radius = np.hypot(u - camera.centre_x, v - camera.centre_y)
            around = np.arctan2(sign * (v - camera.centre_y), u - camera.centre_x) + camera.yaw
            return unit_vectors(around, math.pi / 2 - radius / camera.focal_px)
        case Perspective():
            down = (v - camera.centre_y) / camera.focal_y
            right = (u - camera.centre_x - camera.skew * down) / camera.focal_x
            rays = np.stack([np.ones_like(down), -right, -down], axis=-1)
            return _turned(rays / np.linalg.norm(rays, axis=-1, keepdims=True), camera.yaw)
        case Cylindrical() | Equirectangular():
            sign = -1.0 if camera.sense == "clockwise" else 1.0
            azimuths = sign * 2.0 * math.pi * (u + 0.5 - camera.column_of_forward) / camera.width
            top, bottom, share = camera.elevation_top, camera.elevation_bottom, (v + 0.5) / camera.height_px
            if isinstance(camera, Cylindrical) and top is not None and bottom is not None:
                level, lowest = math.tan(top), math.tan(bottom)
                return unit_vectors(azimuths, np.arctan(level + (lowest - level) * share))
            top, bottom = span_of(top, bottom, camera.height_px, camera.width)
            return unit_vectors(azimuths, top + (bottom - top) * share)
        case Donut(centre_x=float(x), centre_y=float(y), inner_radius_px=float(inner), outer_radius_px=float(outer)):
            sign = 1.0 if camera.sense == "clockwise" else -1.0
            middle = (inner + outer) / 2.0
            around = np.arctan2(sign * (v - y), u - x) + camera.yaw
            return unit_vectors(around, (np.hypot(u - x, v - y) - middle) / middle)
        case _:
            raise BadInput(
                f"camera: no bearings are known for the pixels of this {type(camera).__name__}; give its model in "
                "camera.yaml (a donut: centre and mask), or find features on the panorama: "
                "wires.features.image=unwarp.panorama"
            )


def _turned(rays: Array, yaw: float) -> Array:
    cos, sin = math.cos(yaw), math.sin(yaw)
    x, y = rays[..., 0], rays[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y, rays[..., 2]], axis=-1)

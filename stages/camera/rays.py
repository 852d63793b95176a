"""Where in a camera's picture a direction around the robot is seen."""

import math

import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.problems import BadInput

from .bearings import span_of
from .catadioptric import project
from .models import Camera, Cylindrical, Equirectangular, Fisheye, HyperbolicMirror

Array = npt.NDArray[np.float64]


def strip_columns(camera: Cylindrical | Equirectangular, azimuths: Array) -> Array:
    """The strip's column (pixel centres at integers) that looks along each azimuth (rad), of the same shape."""
    turned = azimuths * (-1.0 if camera.sense == "clockwise" else 1.0)
    edge = camera.column_of_forward + turned * camera.width / (2.0 * math.pi)
    return np.mod(edge, camera.width) - 0.5


def pixels_of_rays(camera: Camera, rays: Array) -> tuple[Array, Array]:
    """Columns and rows in the picture at which rays (..., 3) in the robot's frame are seen: NaN where they are not.

    Rays need not be of unit length. The models are those of the panoramas; a strip with elevations is taken for a
    cylinder. Raises BadInput for a camera of which elevations are not known, or which does not see the full circle.
    """
    azimuth = np.arctan2(rays[..., 1], rays[..., 0])
    level = np.hypot(rays[..., 0], rays[..., 1])
    elevation = np.arctan2(rays[..., 2], level)
    match camera:
        case HyperbolicMirror():
            cos, sin = math.cos(camera.yaw), math.sin(camera.yaw)
            x, y = rays[..., 0], rays[..., 1]
            turned = np.stack([cos * x + sin * y, cos * y - sin * x, rays[..., 2]], axis=-1)
            k = camera.focal_x, camera.focal_y, camera.centre_x, camera.centre_y, camera.skew
            pixels = project(turned, *k, camera.a, camera.b)
            return _in_ring(camera, pixels[..., 0], pixels[..., 1])
        case Fisheye():
            radius = camera.focal_px * (math.pi / 2 - elevation)
            sign = 1.0 if camera.sense == "clockwise" else -1.0
            u = camera.centre_x + radius * np.cos(azimuth - camera.yaw)
            return _in_ring(camera, u, camera.centre_y + sign * radius * np.sin(azimuth - camera.yaw))
        case Equirectangular():
            share = (elevation - camera.elevation_top) / (camera.elevation_bottom - camera.elevation_top)
            return strip_columns(camera, azimuth), _in_strip(camera, share)
        case Cylindrical(elevation_top=float(highest), elevation_bottom=float(lowest)):
            top, bottom = math.tan(highest), math.tan(lowest)
            with np.errstate(divide="ignore", invalid="ignore"):
                share = (rays[..., 2] / level - top) / (bottom - top)
            return strip_columns(camera, azimuth), _in_strip(camera, share)
        case _:
            raise BadInput(
                f"camera: no elevations are known for the rows of a {type(camera).__name__} picture, nor where in it "
                "a direction is seen; give its model in camera.yaml (projection: hyperbolic, fisheye, equirectangular, "
                "or cylindrical with elevation_top and elevation_bottom), or use unwarp=by_camera"
            )


def panorama_points(rays: Array, shape: tuple[int, ...], top: float | None, bottom: float | None) -> Array:
    """Columns and rows (..., 2) at which rays (..., 3) are seen in a `Panorama` of `shape`: NaN above and below it.

    The inverse of `bearings.panorama_bearings`.
    """
    rows, columns = shape[:2]
    top, bottom = span_of(top, bottom, rows, columns)
    azimuth = np.arctan2(rays[..., 1], rays[..., 0])
    elevation = np.arctan2(rays[..., 2], np.hypot(rays[..., 0], rays[..., 1]))
    share = (elevation - top) / (bottom - top)
    row = np.where((share >= 0.0) & (share <= 1.0), share * rows - 0.5, np.nan)
    return np.stack([np.mod((math.pi - azimuth) * columns / (2.0 * math.pi), columns) - 0.5, row], axis=-1)


def _in_ring(camera: HyperbolicMirror | Fisheye, u: Array, v: Array) -> tuple[Array, Array]:
    radius = np.hypot(u - camera.centre_x, v - camera.centre_y)
    seen = (radius >= camera.inner_radius_px) & (radius <= camera.outer_radius_px)
    seen &= (u >= 0.0) & (u <= camera.width - 1.0) & (v >= 0.0) & (v <= camera.height_px - 1.0)
    return np.where(seen, u, np.nan), np.where(seen, v, np.nan)


def _in_strip(camera: Cylindrical | Equirectangular, share: Array) -> Array:
    inside = np.clip(share * camera.height_px - 0.5, 0.0, camera.height_px - 1.0)
    return np.where((share >= 0.0) & (share <= 1.0), inside, np.nan)

"""Cameras: one class per projection, with what `camera.yaml` says of it.

All share the robot frame (x forward, y left, z up). `yaw` (radians, counter-clockwise) turns the camera against the
robot; `height` (metres) is the focus above the floor, None where it is not known.
"""

from typing import Literal

from omninav.pipeline import Value

Sense = Literal["clockwise", "counter_clockwise"]


class Camera(Value):
    """What makes a direction of a pixel. `width` and `height_px` are the size of its pictures."""

    width: int
    height_px: int


class HyperbolicMirror(Camera):
    """A perspective camera looking up into a hyperbolic mirror (Svoboda & Pajdla; erratum 33).

    Mirror: (z+e)^2/a^2 - (x^2+y^2)/b^2 = 1, e = sqrt(a^2+b^2), origin at its focus, camera centre at (0, 0, -2e).
    `focal_x`, `focal_y`, `centre_x`, `centre_y`, `skew` make K (pixels; integer coordinates are pixel centres). `a`
    and `b` share any one unit. A pixel's bearing is atan2(v - cy, u - cx) + yaw. The usable ring lies between
    `inner_radius_px` and `outer_radius_px` around the principal point.
    """

    focal_x: float
    focal_y: float
    centre_x: float
    centre_y: float
    a: float
    b: float
    inner_radius_px: float
    outer_radius_px: float
    skew: float = 0.0
    height: float | None = None
    yaw: float = 0.0


class Donut(Camera):
    """A mirror image with nothing known of the mirror: a ring between two radii, one azimuth per ray.

    `centre_x`, `centre_y`, `inner_radius_px`, `outer_radius_px` (pixels) are None where they are to be found in the
    picture. `sense` is the sense in which azimuth grows on the screen seen as a picture (v down): a camera looking up
    into a mirror has u = mirror x and v = mirror y, so its bearings atan2(v, u) grow clockwise on the screen.
    """

    centre_x: float | None = None
    centre_y: float | None = None
    inner_radius_px: float | None = None
    outer_radius_px: float | None = None
    sense: Sense = "clockwise"
    yaw: float = 0.0


class Cylindrical(Camera):
    """A finished strip: columns are azimuths at equal steps, rows are whatever they are.

    `column_of_forward` (pixels, edges of columns count from 0, so the middle is width / 2) looks along the robot's
    forward; with `sense` clockwise the scene right of it follows at higher columns.
    """

    column_of_forward: float
    sense: Sense = "clockwise"
    height: float | None = None
    elevation_top: float | None = None
    elevation_bottom: float | None = None


class Equirectangular(Camera):
    """Azimuths and elevations at equal steps: `elevation_top` to `elevation_bottom` (radians) over the rows."""

    column_of_forward: float
    elevation_top: float
    elevation_bottom: float
    sense: Sense = "clockwise"
    height: float | None = None


class Fisheye(Camera):
    """An equidistant lens looking up: the angle from the optical axis grows with the radius by `focal_px` per radian.

    Bearings as with the mirror: atan2(v - cy, u - cx) + yaw. The image is used out to `outer_radius_px`.
    """

    focal_px: float
    centre_x: float
    centre_y: float
    outer_radius_px: float
    inner_radius_px: float = 0.0
    sense: Sense = "clockwise"
    height: float | None = None
    yaw: float = 0.0


class Perspective(Camera):
    """An ordinary camera looking along the robot's forward turned by `yaw`. K as in `HyperbolicMirror`."""

    focal_x: float
    focal_y: float
    centre_x: float
    centre_y: float
    skew: float = 0.0
    height: float | None = None
    yaw: float = 0.0

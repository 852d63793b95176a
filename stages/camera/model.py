"""Interface of every camera model: where a ray is seen, where a pixel looks, and what of the image shows the world.

A model is one file in this folder. Everything else (panoramas, windows, bearings, thumbnails, the simulator's rays,
camera.yaml) follows from what it states here.
"""

import importlib
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np

from omninav.pipeline import BadInput, Bounds, Value, offered
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.values.image import Pixels

from .rays import unit_vectors

Sense = Literal["clockwise", "counter_clockwise"]
"""In which sense azimuth grows in the image, seen on a screen (v down). A camera that looks up, by a lens or into a
mirror, has u along x and v along y, so its bearings atan2(v, u) grow clockwise on the screen."""


class Key(NamedTuple):
    """Place of a parameter in `camera.yaml`: a section and a name in it, or the matrix K and a place in it (row-major).

    A parameter without a key is at the top under its own name. Of several keys any is accepted when the file is
    read, and the first is used when it is written.
    """

    section: str
    name: str | int


MAX_SIDE, MAX_PIXELS = 32_768, 100_000_000
"""Columns or rows of an image, and its pixels: several arrays of this size are made of a camera."""
FAR_PX = 1e6
"""No place of a camera's image, and no radius in it, is further from its corner than this."""
FAR_M = 20.0
"""Largest distance of a camera from its robot's origin along x or y, m."""
MAX_HEIGHT_M = 10.0
"""Largest height of a camera above its floor, m: more is a height in centimetres or millimetres."""
MAX_DELAY_S = 10.0
"""Largest delay of a camera's images, early or late, s."""
FocalX = Annotated[float, Key("K", 0), Bounds(ge=1, le=FAR_PX)]
FocalY = Annotated[float, Key("K", 4), Bounds(ge=1, le=FAR_PX)]
CentreX = Annotated[float, Key("K", 2), Bounds(ge=-FAR_PX, le=FAR_PX)]
CentreY = Annotated[float, Key("K", 5), Bounds(ge=-FAR_PX, le=FAR_PX)]
Skew = Annotated[float, Key("K", 1), Bounds(ge=-FAR_PX, le=FAR_PX)]
InnerRadius = Annotated[float, Key("mask", "inner_radius_px"), Bounds(ge=0, le=FAR_PX)]
OuterRadius = Annotated[float, Key("mask", "outer_radius_px"), Bounds(gt=0, le=FAR_PX)]


class Ring(NamedTuple):
    """The part of an image between two circles whose radii are upright lines of the world (pixels)."""

    centre_x: float
    centre_y: float
    inner: float
    outer: float

    def holds(self, u: Array, v: Array) -> Bools:
        """Which pixels are in it, of columns and rows of any shapes that go together."""
        radius = np.hypot(u - self.centre_x, v - self.centre_y)
        return (radius >= self.inner) & (radius <= self.outer)


MODELS: dict[str, type["Camera"]] = {}
"""The camera models that were imported, by what `projection:` in camera.yaml calls them; see `camera_models`."""


class Camera(Value, ABC):
    """A camera: rays of the robot's frame (x forward, y left, z up) to pixels (column u, row v) and back.

    A subclass is a model and names itself: `class Fisheye(Camera, projection="fisheye")`. Its fields are what
    camera.yaml states of it. Raises ValueError for fields that contradict each other. Integer coordinates are the
    centres of pixels.
    """

    projection: ClassVar[str]
    wraps: ClassVar[bool] = False
    """The image is a full circle itself: its left edge continues at its right one."""
    sees_itself: ClassVar[bool] = False
    """The camera's housing is seen in the middle of its own image, as under a mirror."""

    width: Annotated[int, Key("image", "width"), Bounds(gt=0, le=MAX_SIDE)]
    """Columns of an image, pixels."""
    height_px: Annotated[int, Key("image", "height"), Bounds(gt=0, le=MAX_SIDE)]
    """Rows of an image, pixels."""
    _: KW_ONLY
    height: Annotated[float, Bounds(ge=0, le=MAX_HEIGHT_M)] | None = None
    """Height of the projection centre above the floor, m; None where it is not known."""
    yaw: Annotated[float, Bounds(ge=-2 * math.pi, le=2 * math.pi)] = 0.0
    """Angle by which the camera is turned against the robot, radians, counter-clockwise."""
    position_x: Annotated[float, Key("position", "x"), Bounds(ge=-FAR_M, le=FAR_M)] | None = None
    """Position of the camera in front of the robot's origin, m; None where it is not known."""
    position_y: Annotated[float, Key("position", "y"), Bounds(ge=-FAR_M, le=FAR_M)] | None = None
    """Position of the camera to the left of the robot's origin, m; None where it is not known."""
    delay: Annotated[float, Bounds(ge=-MAX_DELAY_S, le=MAX_DELAY_S)] | None = None
    """Time by which images on a topic are stamped later than they were taken, s; None where it is not known."""

    def __init_subclass__(cls, projection: str = "", **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if projection:
            cls.projection = projection
            other = MODELS.setdefault(projection, cls)
            if (other.__module__, other.__qualname__) != (cls.__module__, cls.__qualname__):
                raise BadInput(
                    f"camera: the projection '{projection}' of {cls.__module__}.{cls.__qualname__} is that of "
                    f"{other.__module__}.{other.__qualname__}; give it a name of its own"
                )
            MODELS[projection] = cls

    def __post_init__(self) -> None:
        if self.width * self.height_px > MAX_PIXELS:
            raise ValueError(f"'image' is {self.width} x {self.height_px}, expected at most {MAX_PIXELS:,} pixels")
        ring = self.ring
        if ring is not None and ring.inner >= ring.outer:
            raise ValueError("'mask.inner_radius_px' must be below 'mask.outer_radius_px'")

    @abstractmethod
    def project(self, rays: Array) -> tuple[Array, Bools]:
        """Pixels (..., 2) at which rays (..., 3) of any length are seen, and which of them (...,) the image shows."""

    @abstractmethod
    def unproject(self, pixels: Array) -> tuple[Array, Bools]:
        """Unit rays (..., 3) of pixels (..., 2), and a mask (...,) of those that have a ray; NaN where it is False."""

    @property
    def ring(self) -> Ring | None:
        """The ring of the image that shows the world, whose radii are upright lines; None where it has none."""
        return None

    @property
    def upright(self) -> bool:
        """Tells whether columns of the image are upright lines, or taken for them."""
        return self.ring is None

    @property
    def looks_up(self) -> bool:
        """Tells whether the inside of the ring is above its outside, as of a lens that looks up."""
        if (ring := self.ring) is None:
            return False
        radii = np.linspace(ring.inner, ring.outer, SIGHT_PIXELS)
        rays = self.unproject(np.stack([ring.centre_x + radii, np.full_like(radii, ring.centre_y)], axis=-1))[0]
        return bool(np.nansum(np.diff(rays[:, 2])) < 0.0)

    @property
    def mount(self) -> Array:
        """The described pose of the camera on the robot (3,): x, y (m), yaw (rad)."""
        return np.array([self.position_x or 0.0, self.position_y or 0.0, self.yaw])

    @property
    def placed(self) -> bool:
        """True where its description has a position on the robot."""
        return self.position_x is not None or self.position_y is not None

    @property
    def delay_ns(self) -> int:
        """The described delay of its images, ns."""
        return round((self.delay or 0.0) * 1e9)

    @property
    def arm(self) -> Array:
        """The mount (3,) of the frame that bearings are in: they are turned by the yaw already."""
        return self.mount * [1.0, 1.0, 0.0]

    @property
    def elevations(self) -> tuple[float, float] | None:
        """Highest and lowest elevation (rad) of a camera that sees the full circle; None for any other.

        Raises BadInput where the model does not reach over the whole ring.
        """
        ring = self.ring
        if ring is None:
            return None
        edges = np.array([[ring.centre_x + radius, ring.centre_y] for radius in (ring.outer, ring.inner)])
        rays, looks = self.unproject(edges)
        if not looks.all():
            raise BadInput(
                f"camera: the mask ({ring.inner:g} to {ring.outer:g} px) reaches beyond what this {self.projection} "
                "camera shows; check the mask and the model in camera.yaml"
            )
        found = np.arctan2(rays[:, 2], np.hypot(rays[:, 0], rays[:, 1]))
        return float(found.max()), float(found.min())

    @property
    def mirrored(self) -> bool:
        """Tells whether images show the world mirrored, as under a mirror."""
        x, y = (side * (np.arange(SIGHT_PIXELS) + 0.5) / SIGHT_PIXELS for side in (self.width, self.height_px))
        pixels = np.stack(np.meshgrid(x, y), axis=-1)
        ray, right, below = (self.unproject(pixels + step)[0] for step in ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0]))
        with np.errstate(invalid="ignore"):
            towards = (ray * np.cross(right, below)).sum(axis=-1)
        return bool(np.nanmean(np.sign(towards)) < 0.0) if np.isfinite(towards).any() else False

    @property
    def elevations_known(self) -> bool:
        """Tells whether elevations are measured; else azimuths are right, and elevations a guess."""
        return True

    @property
    def complete(self) -> bool:
        """True if every parameter is known; otherwise `found_in` estimates the missing ones from an image."""
        return True

    def found_in(self, pixels: Pixels) -> Self | None:
        """The camera with its missing parameters estimated from an image; None where the image does not show them."""
        return self

    def shows(self, pixels: Array) -> Bools:
        """Which pixels (..., 2), whole or not, are in the image and, where it has one, in its ring: (...,)."""
        u, v = pixels[..., 0], pixels[..., 1]
        inside: Bools = (u >= 0.0) & (u <= self.width - 1.0) & (v >= 0.0) & (v <= self.height_px - 1.0)
        return inside if self.ring is None else inside & self.ring.holds(u, v)

    def mask(self) -> Bools:
        """Which pixels of an image (height_px, width) show the world."""
        grid = self.grid()
        return self.shows(grid) & self.unproject(grid)[1]

    def grid(self) -> Array:
        """The coordinates of all pixels (height_px, width, 2), columns and rows."""
        rows, columns = np.mgrid[0 : self.height_px, 0 : self.width].astype(np.float64)
        return np.stack([columns, rows], axis=-1)

    def camera_info(self) -> dict[str, Any]:
        """Fields of a CameraInfo message that describe it besides its size."""
        return {}

    @classmethod
    def of_size(cls, width: int, height: int) -> Self | None:
        """The usual camera of this kind whose images are of a size (pixels); None where a size is not enough."""
        return None

    @classmethod
    def from_camera_info(cls, model: str, size: tuple[int, int], k: Sequence[float], d: Sequence[float]) -> Self | None:
        """The camera of a CameraInfo's `distortion_model`, (width, height), K and D; None where that is another one."""
        return None


def camera_models() -> dict[str, type[Camera]]:
    """All camera models by their names in camera.yaml: those of this folder, and those that others offer (`registry`).

    One that cannot be imported is missing; `omninav stages camera` states why.
    """
    for file in sorted(Path(__file__).parent.glob("[a-z]*.py")):
        importlib.import_module(f"{__package__}.{file.stem}")
    offered("camera")
    return MODELS


def seen_at(camera: Camera, rays: Array) -> Array:
    """Pixels (..., 2) at which rays (..., 3) in the robot's frame are seen; NaN where they are not."""
    pixels, shown = camera.project(rays)
    return np.where(shown[..., None], pixels, np.nan)


SIGHT_PIXELS = 16
"""Pixels along each side of an image at which a camera is asked whether right and below are as the eye sees them."""
SIGHT_STEPS, MIN_SIGHT, MIN_AZIMUTHS = (144, 73), 0.001, 0.75
"""Numbers of azimuths and elevations at which a camera is asked what it sees; smallest share of the sphere that it sees
(7 by 7 degrees), and of all azimuths that a ring shows."""


def require_sight(camera: Camera) -> None:
    """Raise BadInput for a camera that sees nothing, or almost nothing: its numbers are no camera's.

    One of which something is still to be found in its images is not asked.
    """
    if camera.elevations is None and not camera.complete:
        return
    azimuths = np.linspace(-math.pi, math.pi, SIGHT_STEPS[0])
    elevations = np.linspace(-math.pi / 2, math.pi / 2, SIGHT_STEPS[1])
    with np.errstate(all="ignore"):
        pixels, shown = camera.project(unit_vectors(azimuths[:, None], elevations))
        looks = camera.unproject(camera.grid()[:: max(1, camera.height_px // 64), :: max(1, camera.width // 64)])[1]
    share = float((shown * np.cos(elevations)).sum() / (SIGHT_STEPS[0] * np.cos(elevations).sum()))
    if not np.isfinite(pixels[shown]).all() or share < MIN_SIGHT or not looks.any():
        raise BadInput(
            f"camera: with these numbers a {camera.projection} camera of {camera.width} x {camera.height_px} pixels "
            f"sees {100 * share:.2g} % of all directions; check the model, the mask and the size in camera.yaml"
        )
    around = float(shown.any(axis=1).mean())
    if camera.ring is not None and around < MIN_AZIMUTHS:
        raise BadInput(
            f"camera: of the ring around ({camera.ring.centre_x:g}, {camera.ring.centre_y:g}) an image of "
            f"{camera.width} x {camera.height_px} shows {100 * around:.0f} % of all azimuths; correct the centre"
        )


def require_elevations(camera: Camera) -> None:
    """Raise BadInput for a camera of which elevations are not known."""
    if not camera.elevations_known:
        raise BadInput(
            f"camera: no elevations are known for the rows of a {camera.projection} image, nor where in it a "
            "direction is seen; give its model in camera.yaml (projection: hyperbolic, fisheye, equirectangular, …, or "
            "cylindrical with elevation: {top, bottom}), or use unwarp=panorama"
        )

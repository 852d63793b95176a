"""What a world is made of, as typed configuration. `WorldConfig()` is the embedded demo, a small home store.

Metres and radians in the map frame (x right and y up on the map, z up, the floor at 0) unless a field says otherwise.
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from omninav.pipeline import Bounds

Point = tuple[float, float]
Positive = Annotated[float, Bounds(gt=0)]
Spread = Annotated[float, Bounds(ge=0)]
Share = Annotated[float, Bounds(ge=0, le=1)]
Material = Literal[
    "wall",
    "concrete",
    "stripes",
    "floor",
    "ceiling",
    "lamp",
    "wood",
    "mat",
    "counter",
    "door",
    "window",
    "poster",
    "carton",
    "goods",
]
"""What a face may look like; `textures.MATERIALS` draws them."""


@dataclass(frozen=True)
class Shelf:
    """A shelf with goods on its four faces: centre, length along its own x, depth along its own y, turned by `yaw`."""

    centre: Point
    length: Positive
    depth: Positive
    height: Positive = 1.8
    levels: Annotated[int, Bounds(ge=1)] = 4
    yaw: float = 0.0
    stock: bool = True
    """Cartons stand on top."""


@dataclass(frozen=True)
class Block:
    """A plain body: pillar, counter, inner wall, furniture, mat. `material` is its sides' look, `top` its top's."""

    centre: Point
    size: Point
    height: Positive
    material: Material = "concrete"
    top: Material = "wood"
    bottom_z: float = 0.0
    yaw: float = 0.0


@dataclass(frozen=True)
class Hanging:
    """A poster, sign, window or door against a wall: its middle on the wall, the way it faces, and what is on it."""

    centre: Point
    facing: float
    """Heading of its outward normal."""
    width: Positive
    bottom_z: float
    height: Positive
    material: Material = "poster"


@dataclass(frozen=True)
class Lamp:
    """A ceiling lamp: where it hangs, its panel's size, and its light (blue, green, red; 1 is ordinary)."""

    centre: Point
    size: Point = (1.2, 0.3)
    light: tuple[float, float, float] = (0.96, 1.0, 1.0)


@dataclass(frozen=True)
class Route:
    """Waypoints that the robot is steered along, one after the other; it starts at the first, facing the second."""

    waypoints: tuple[Point, ...]


@dataclass(frozen=True)
class Robot:
    """A differential drive and the hand on its joystick: limits (m/s, rad/s and per second), and its body."""

    radius: Positive = 0.25
    speed: Positive = 0.45
    turn_speed: Positive = 0.9
    acceleration: Positive = 0.5
    turn_acceleration: Positive = 2.0
    look_ahead: Positive = 0.45
    """Distance (m) along the route of the point that is steered for."""
    wander: Spread = 0.04
    """Spread (m) by which each day's line misses the inner waypoints."""


@dataclass(frozen=True)
class OdometryNoise:
    """Noise of an odometry increment (rotation, translation, rotation), and the spread of a day's systematic errors.

    sigma_trans = `translation` sqrt(m); sigma_rot^2 = `rotation`^2 |rad| + `drift`^2 m. Biases are drawn once a day.
    """

    translation: Spread = 0.02
    rotation: Spread = 0.021
    """rad per sqrt(rad), 1.2 degrees."""
    drift: Spread = 0.0122
    """rad per sqrt(m), 0.7 degrees."""
    scale_bias: Spread = 0.02
    """Share by which translation is misjudged."""
    rotation_bias: Spread = 0.015
    """Share by which rotation is misjudged."""
    turn_bias: Spread = 0.0044
    """Rotation (rad) added per metre, 0.25 degrees."""


@dataclass(frozen=True)
class MirrorCamera:
    """The omnidirectional camera: a hyperbolic mirror over a perspective camera. Numbers as in camera.yaml."""

    width: int = 640
    height_px: int = 480
    focal: Positive = 497.0
    centre: Point = (319.5, 239.5)
    a: Positive = 28.095
    b: Positive = 23.4125
    inner_radius_px: float = 34.0
    outer_radius_px: float = 238.0
    height: Positive = 0.9
    yaw: float = 0.3


@dataclass(frozen=True)
class Sensor:
    """What the chip does: noise (grey levels), darker rim (share lost in the corner), slow exposure drift (share)."""

    noise: Spread = 2.0
    vignetting: Share = 0.12
    exposure: Positive = 1.0
    exposure_drift: Share = 0.04
    exposure_period: Positive = 23.0
    """Seconds."""


@dataclass(frozen=True)
class Timing:
    """Rates (Hz) of pictures and of odometry and truth."""

    pictures: Positive = 2.0
    odometry: Positive = 20.0


def _shelves() -> tuple[Shelf, ...]:
    return (
        Shelf(centre=(3.7, 2.9), length=3.2, depth=1.0),
        Shelf(centre=(7.7, 2.9), length=2.8, depth=1.0, height=1.5, levels=3),
        Shelf(centre=(3.5, 6.1), length=2.8, depth=1.0, height=1.5, levels=3),
        Shelf(centre=(7.5, 6.1), length=3.2, depth=1.0),
        Shelf(centre=(5.6, 8.8), length=4.8, depth=0.4, height=2.2, levels=5, stock=False),
    )


def _blocks() -> tuple[Block, ...]:
    return (
        Block(centre=(10.6, 3.0), size=(0.4, 0.4), height=3.2, material="concrete"),
        Block(centre=(10.6, 6.1), size=(0.4, 0.4), height=3.2, material="stripes"),
        Block(centre=(11.4, 1.6), size=(0.6, 1.8), height=1.0, material="counter"),
        Block(centre=(0.45, 6.6), size=(0.6, 1.2), height=0.8, material="wood"),
        Block(centre=(11.3, 7.9), size=(0.9, 0.9), height=0.55, material="carton", yaw=0.35),
        Block(centre=(1.2, 4.5), size=(1.4, 1.4), height=0.01, top="mat"),
    )


def _hangings() -> tuple[Hanging, ...]:
    east, north, west, south = 0.0, 1.5707963267948966, 3.141592653589793, -1.5707963267948966
    return (
        Hanging((0.0, 1.9), east, 1.0, 0.0, 2.1, "door"),
        Hanging((0.0, 4.2), east, 1.2, 1.0, 1.0),
        Hanging((0.0, 8.0), east, 0.8, 1.1, 1.1),
        Hanging((1.6, 0.0), north, 1.0, 1.0, 1.2),
        Hanging((3.6, 0.0), north, 1.4, 1.1, 0.9),
        Hanging((5.4, 0.0), north, 0.8, 0.9, 1.3),
        Hanging((7.6, 0.0), north, 1.6, 0.8, 1.4, "window"),
        Hanging((9.9, 0.0), north, 1.0, 0.0, 2.1, "door"),
        Hanging((12.0, 3.6), west, 1.2, 1.1, 1.2),
        Hanging((12.0, 5.6), west, 1.8, 0.0, 2.2, "door"),
        Hanging((1.4, 9.0), south, 1.0, 1.0, 1.3),
        Hanging((9.4, 9.0), south, 1.4, 0.9, 1.2, "window"),
        Hanging((10.9, 9.0), south, 0.7, 1.2, 1.0),
    )


def _lamps() -> tuple[Lamp, ...]:
    return tuple(Lamp(centre=(x, y)) for y in (1.3, 4.5, 7.6) for x in (1.5, 4.5, 7.5, 10.5))


def _routes() -> dict[str, Route]:
    return {
        "tour": Route(
            waypoints=(
                (1.2, 1.2),
                (9.4, 1.2),
                (9.75, 4.0),
                (9.2, 4.5),
                (1.5, 4.5),
                (1.25, 5.2),
                (1.4, 7.2),
                (2.0, 7.6),
                (9.0, 7.6),
                (9.75, 6.8),
                (9.5, 4.9),
            )
        ),
        "drive": Route(
            waypoints=((2.4, 1.5), (9.0, 1.5), (9.7, 2.4), (9.75, 6.6), (9.0, 7.3), (2.2, 7.3), (1.5, 6.4), (1.7, 5.0))
        ),
    }


@dataclass(frozen=True)
class WorldConfig:
    """A world: one hall of `size` with what stands in it, the robot that drives there and what it perceives.

    `seed` decides goods, textures, the line of each day and all noise. On day 0 the goods stand as the seed places
    them; on another day a share `rearranged` of the shelves' compartments holds something else.
    """

    name: str = "home_store_demo"
    seed: int = 1
    size: Point = (12.0, 9.0)
    height: Positive = 3.2
    shelves: tuple[Shelf, ...] = field(default_factory=_shelves)
    blocks: tuple[Block, ...] = field(default_factory=_blocks)
    hangings: tuple[Hanging, ...] = field(default_factory=_hangings)
    lamps: tuple[Lamp, ...] = field(default_factory=_lamps)
    ambient: Spread = 0.45
    rearranged: Share = 0.1
    routes: dict[str, Route] = field(default_factory=_routes)
    robot: Robot = Robot()
    odometry: OdometryNoise = OdometryNoise()
    camera: MirrorCamera = MirrorCamera()
    sensor: Sensor = Sensor()
    timing: Timing = Timing()

"""What a world is made of, as typed configuration. `WorldConfig()` is an empty hall, `demo.DEMO` a small home store.

Bodies are listed one by one (shelves, blocks, wall_panels, lamps) or by the dozen (aisle blocks, rooms, a lamp grid);
`layout.expand` turns these into such lists. Metres and radians in the map frame (x right and y up on the map, z up, the
floor at 0) unless a field says otherwise.
"""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

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
    "plaster",
    "brick",
    "facade",
    "carpet",
    "parquet",
    "linoleum",
    "asphalt",
    "paving",
    "grass",
    "hedge",
    "leaves",
    "bark",
    "sky",
    "curtain",
    "books",
    "cabinet",
    "steel",
    "fabric",
    "screen",
    "board",
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
    department: str = ""
    """Whose goods stand here: shelves of one department choose among the same few."""


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
    bottom: Material | None = None
    """Look of its underside; that of its top where null."""
    look: str = ""
    """Bodies of one material and one look are alike; every body has its own where it is empty."""
    kind: Literal["block", "wall", "door", "furniture", "plant", "roof"] = "block"
    """What a floor plan shows it as."""


@dataclass(frozen=True)
class WallPanel:
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
    z: float | None = None
    """Height (m) that it hangs at; under the ceiling where null."""
    name: str = ""
    """What switches it: the name of its room, or its own."""


@dataclass(frozen=True)
class LampGrid:
    """Lamps all over the hall, the same distances apart in x and in y."""

    spacing: Point = (3.0, 3.0)
    size: Point = (1.2, 0.3)
    light: tuple[float, float, float] = (0.96, 1.0, 1.0)


@dataclass(frozen=True)
class AisleBlock:
    """Rows of shelves with aisles between them: they fill a rectangle, and aisles take what the shelves leave.

    `cross_aisles` cut all rows, as wide as an aisle. Each stretch between two rows is an aisle; of the inner ones a
    share `dead_ends` is closed by a shelf at one end, drawn by the seed.
    """

    corner: Point
    """Lower left."""
    size: Point
    name: str = ""
    along: Literal["x", "y"] = "y"
    """Which way the aisles run."""
    aisle: Positive = 2.0
    """Least width of an aisle."""
    depth: Positive = 1.0
    height: Positive = 2.0
    levels: Annotated[int, Bounds(ge=1)] = 4
    stock: bool = True
    cross_aisles: Annotated[int, Bounds(ge=0)] = 0
    dead_ends: Share = 0.0
    pillars: Spread = 0.0
    """Distance of pillars that stand in every other row; none where 0."""
    department: str = ""
    """Whose goods they hold; the block's own where empty."""


Side = Literal["east", "north", "west", "south"]
Furniture = Literal[
    "none", "office", "meeting", "kitchen", "lab", "lounge", "library", "store", "copy", "lobby", "trees", "park"
]


@dataclass(frozen=True)
class Door:
    """A way through a wall of a room and whatever wall lies behind: its middle is `at` m from the wall's low end."""

    side: Side
    at: float
    width: Positive = 1.0
    leaf: bool = True
    """A leaf opens and closes it; else it is a mere opening."""


@dataclass(frozen=True)
class Room:
    """A named rectangle: inner walls with doors and windows, its own floor, furniture along the walls, lamps.

    Without walls it is a part of the hall or of the open: a corridor, a lawn.
    """

    name: str
    corner: Point
    size: Point
    doors: tuple[Door, ...] = ()
    windows: tuple[Side, ...] = ()
    """Sides with a row of windows; each has a curtain."""
    furniture: Furniture = "none"
    furniture_density: Share = 0.6
    """Share of the places for furniture that are taken."""
    walls: bool = True
    wall: Material = "plaster"
    facade: Material | None = None
    """Look of the walls from outside, where the room stands in the open."""
    floor: Material | None = None
    """The hall's where null."""
    height: float | None = None
    """Of a ceiling of its own; the hall's where null."""
    lamps: Spread = 2.5
    """Distance between its lamps; none where 0."""


@dataclass(frozen=True)
class Kidnapping:
    """Somebody lifts the robot, `at` seconds into a drive; odometry does not see it.

    It is put down where it was, or at `to` (x, y, heading: a kidnapping), turned by `turn` (rad).
    """

    at: Positive
    turn: float = 0.0
    to: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Route:
    """A way through a world; `route_planning.plan` makes it a line of points around whatever stands in between.

    `waypoints` goes through the given points, `laps` round them. `aisles` goes through every aisle of the blocks named
    in `through` (all where empty), `rooms` to every room named there that can be reached, `random` from one free
    place to another. The robot starts at the first point, facing the second.
    """

    waypoints: tuple[Point, ...] = ()
    """Of a tour that finds its own way, only the first is kept: where it starts."""
    kind: Literal["waypoints", "aisles", "laps", "rooms", "random"] = "waypoints"
    through: tuple[str, ...] = ()
    laps: Annotated[int, Bounds(ge=1)] = 1
    """Of `laps`: times around; of `aisles`: times through each, there and back by turns."""
    lead_in: tuple[Point, ...] = ()
    """Of `laps`: points that it goes through before."""
    length: Positive | None = None
    """Metres after which it ends; all the way where null."""
    seed: int = 0
    kidnappings: tuple[Kidnapping, ...] = ()
    """What is done to the robot on this route, each time that it is driven."""
    day_duration_s: Positive | None = None
    """Seconds after which lamps, curtains and goods are the next day's, while the robot drives on; null: never."""


@dataclass(frozen=True)
class Day:
    """What a day is like. Goods are rearranged against the seed's order, furniture is shifted by about `furniture` m.

    Which goods, doors, curtains or lamps it hits follows from the world's seed and the day's number.
    """

    people: Annotated[int, Bounds(ge=0)] = 0
    """Walkers in the whole world."""
    rearranged: Share = 0.0
    """Share of the shelves' compartments that hold something else."""
    furniture: Spread = 0.0
    light: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Factors of all light: blue, green, red."""
    lamps_off: Share | tuple[str, ...] = 0.0
    """Share of the lamps, or the names of lamps or rooms."""
    curtains: Share = 0.0
    """Share of the windows whose curtains are closed."""
    doors: Share = 1.0
    """Share of the doors that are open."""


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
    path_jitter_m: Spread = 0.04
    """Spread (m) of each day's line, drawn every 2.5 m: as a root mean square over the way it comes to 0.78 of it."""
    contact: Literal["slide", "hold"] = "slide"
    """What a robot does that is steered into an obstacle: it slides along it, or is held where it is."""


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
    added: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Noise on top, as in Wolf, Burgard & Burkhardt 2005: mm per sqrt(m), degrees per sqrt(360 degrees) and per
    sqrt(m); `conf/odometry_noise` holds their nine levels."""


def mirror(columns: int = 640) -> dict[str, Any]:
    """The usual camera as in camera.yaml: a hyperbolic mirror over a camera of 4 : 3, of so many columns."""
    scale = columns / 640
    focal, x, y = 497.0 * scale, 320.0 * scale - 0.5, 240.0 * scale - 0.5
    return {
        "projection": "hyperbolic",
        "image": {"width": columns, "height": columns * 3 // 4},
        "K": [[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]],
        "mirror": {"a": 28.095, "b": 23.4125},
        "mask": {"inner_radius_px": 34.0 * scale, "outer_radius_px": 238.0 * scale},
        "height": 0.9,
        "yaw": 0.3,
    }


@dataclass(frozen=True)
class Sensor:
    """What the chip does: noise (grey levels), darker rim (share lost in the corner), slow exposure drift (share)."""

    noise: Spread = 2.0
    vignetting: Share = 0.12
    exposure: Positive = 1.0
    exposure_drift: Share = 0.04
    exposure_period: Positive = 23.0
    """Seconds."""
    shutter: Spread = 0.0
    """Seconds that a picture takes: what moves meanwhile is blurred."""
    sub_exposures: Annotated[int, Bounds(ge=1)] = 6
    """Moments within it that are rendered and averaged."""


@dataclass(frozen=True)
class Timing:
    """Rates (Hz) of pictures and of odometry and truth."""

    images: Positive = 2.0
    odometry: Positive = 20.0


@dataclass(frozen=True)
class Ranges:
    """A ring of range readings like ultrasound: the nearest echo within each cone, from the robot's middle.

    The first looks backwards, the others follow counter-clockwise at equal steps.
    """

    readings: Annotated[int, Bounds(ge=1)] = 16
    beam_width: Positive = 0.26
    """Opening angle (rad) of a cone, 15 degrees."""
    max_range: Positive = 4.0
    """Metres; there is no echo from further away."""
    noise: Spread = 0.01
    """Standard deviation (m) of an echo."""
    dropout: Share = 0.02
    """Share of readings without an echo though something is there."""
    rate: Positive = 5.0
    """Readings (Hz) of the whole ring in a log."""


@dataclass(frozen=True)
class Delivery:
    """What happens to pictures on their way into the log: a share is lost, a share arrives `delay_s` seconds late."""

    dropped: Share = 0.0
    late: Share = 0.0
    delay_s: Spread = 0.7


@dataclass(frozen=True)
class WorldConfig:
    """A world: one hall of `size` with what stands in it, the robot that drives there and what it perceives.

    `seed` decides goods, textures, the line of each day and all noise. Day k is like `days[k]`, and days after the last
    are like the last. A ceiling of material `sky` is none: the world lies in the open, and rooms have roofs.
    """

    name: str = "empty"
    seed: int = 1
    size: Point = (12.0, 9.0)
    height: Positive = 3.2
    wall: Material = "wall"
    floor: Material = "floor"
    ceiling: Material = "ceiling"
    aisle_blocks: tuple[AisleBlock, ...] = ()
    rooms: tuple[Room, ...] = ()
    lamp_grid: LampGrid | None = None
    shelves: tuple[Shelf, ...] = ()
    blocks: tuple[Block, ...] = ()
    wall_panels: tuple[WallPanel, ...] = ()
    lamps: tuple[Lamp, ...] = ()
    ambient: Annotated[float, Bounds(ge=0, lt=1)] = 0.45
    """Share of the light that comes from all around; lamps and windows give the rest."""
    goods: Annotated[int, Bounds(ge=1)] = 56
    """Different goods in the whole world."""
    assortment: Annotated[int, Bounds(ge=1)] = 56
    """Different goods that one department has."""
    days: tuple[Day, ...] = (Day(), Day(rearranged=0.1))
    routes: dict[str, Route] = field(default_factory=dict)
    robot: Robot = Robot()
    odometry: OdometryNoise = OdometryNoise()
    camera: dict[str, Any] = field(default_factory=mirror)
    """What a camera.yaml holds, of any projection, with the camera's height."""
    sensor: Sensor = Sensor()
    timing: Timing = Timing()
    ranges: Ranges = Ranges()
    delivery: Delivery = Delivery()

    @property
    def eye_height(self) -> float:
        """Metres of the camera above the floor."""
        return float(self.camera["height"])

    def day(self, number: int) -> Day:
        """What day `number` (from 0) is like."""
        return self.days[min(number, len(self.days) - 1)] if self.days else Day()

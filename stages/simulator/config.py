"""Typed configuration of a simulated world. `WorldConfig()` is an empty hall; `conf/world` has others.

Bodies are listed one by one (shelves, blocks, wall panels, lamps) or in groups (aisle blocks, rooms, a lamp grid),
which `layout.expand` turns into single bodies. Metres and radians in the map frame (z up, the floor at 0) unless a
field states otherwise.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from omninav.pipeline import Bounds

FAR = 1e5
"""Metres or seconds that nothing in a world exceeds."""
Coordinate = Annotated[float, Bounds(ge=-FAR, le=FAR)]
Point = tuple[Coordinate, Coordinate]
Positive = Annotated[float, Bounds(gt=0, le=FAR)]
Pace = Annotated[float, Bounds(ge=1e-3, le=FAR)]
"""A speed or acceleration (m, rad and s): a slower drive has more images than memory holds."""
DayNumber = Annotated[int, Bounds(ge=0, le=4000)]
"""A day of a world, from 2026 on: in 2038 the seconds of messages exceed 32 bits."""
Extent = tuple[Positive, Positive]
LampSpacing = Annotated[float, Bounds(ge=0.3, le=FAR)]
Spread = Annotated[float, Bounds(ge=0, le=FAR)]
Share = Annotated[float, Bounds(ge=0, le=1)]
MAX_PEOPLE_PER_M2 = 1.0
"""Most people in a world, per square metre of its floor: closer together nobody walks."""
MAX_BESIDE_M = 0.02
"""Metres by which a room or a door may be over an edge: plans are drawn to the centimetre."""
Factor = Annotated[float, Bounds(ge=0, le=100)]
OfHalls = Literal["wall", "concrete", "stripes", "floor", "ceiling", "lamp"]
OfStores = Literal["wood", "mat", "counter", "door", "window", "poster", "carton", "goods"]
OfRooms = Literal["plaster", "brick", "facade", "carpet", "parquet", "linoleum"]
Outdoors = Literal["asphalt", "paving", "grass", "hedge", "leaves", "bark", "sky"]
OfFurniture = Literal["curtain", "books", "cabinet", "steel", "fabric", "screen", "board"]
Material = Literal[OfHalls, OfStores, OfRooms, Outdoors, OfFurniture]
"""Materials of faces; `textures` draws them."""


@dataclass(frozen=True)
class Shelf:
    """A shelf with goods on its four sides."""

    centre: Point
    length: Positive
    """Along its own x."""
    depth: Positive
    """Along its own y."""
    height: Positive = 1.8
    levels: Annotated[int, Bounds(ge=1)] = 4
    """Rows of compartments."""
    yaw: float = 0.0
    stock: bool = True
    """Cartons are on top."""
    department: str = ""
    """Shelves of one department hold the same assortment of goods."""


@dataclass(frozen=True)
class Block:
    """A box: pillar, counter, inner wall, piece of furniture, mat."""

    centre: Point
    size: Extent
    height: Positive
    material: Material = "concrete"
    """Texture of its sides."""
    top: Material = "wood"
    bottom_z: float = 0.0
    """Height of its underside above the floor."""
    yaw: float = 0.0
    bottom: Material | None = None
    """Texture of its underside; null: as its top."""
    look: str = ""
    """Blocks of the same material and look share a texture; empty: a texture of its own."""
    kind: Literal["block", "wall", "door", "furniture", "plant", "roof"] = "block"
    """Style in which floor plans draw it."""


@dataclass(frozen=True)
class WallPanel:
    """A poster, sign, window or door on a wall."""

    centre: Point
    """Its middle on the wall."""
    facing: float
    """Heading of its outward normal."""
    width: Positive
    bottom_z: float
    height: Positive
    material: Material = "poster"


@dataclass(frozen=True)
class Lamp:
    """A ceiling lamp."""

    centre: Point
    size: Extent = (1.2, 0.3)
    light: tuple[Factor, Factor, Factor] = (0.96, 1.0, 1.0)
    """Colour: blue, green, red; 1 is ordinary brightness."""
    z: float | None = None
    """Height above the floor; null: under the ceiling."""
    name: str = ""
    """Name of its room, or its own; `lamps_off` switches lamps by it."""


@dataclass(frozen=True)
class LampGrid:
    """Lamps at equal distances over the whole hall."""

    spacing: tuple[LampSpacing, LampSpacing] = (3.0, 3.0)
    size: Extent = (1.2, 0.3)
    light: tuple[Factor, Factor, Factor] = (0.96, 1.0, 1.0)


@dataclass(frozen=True)
class AisleBlock:
    """Rows of shelves that fill a rectangle, with aisles between them."""

    corner: Point
    """Lower left."""
    size: Extent
    name: str = ""
    along: Literal["x", "y"] = "y"
    """Direction of the aisles."""
    aisle: Positive = 2.0
    """Minimum width of an aisle."""
    depth: Positive = 1.0
    """Depth of its shelves; the next three are theirs, too."""
    height: Positive = 2.0
    levels: Annotated[int, Bounds(ge=1)] = 4
    stock: bool = True
    cross_aisles: Annotated[int, Bounds(ge=0)] = 0
    """Aisles that cut through all rows."""
    dead_ends: Share = 0.0
    """Share of the inner aisles that a shelf closes at one end, drawn by the seed."""
    pillars: Spread = 0.0
    """Distance between pillars in every other row; 0: none."""
    department: str = ""
    """Department of the goods; empty: one of its own."""


Side = Literal["east", "north", "west", "south"]
Furniture = Literal[
    "none", "office", "meeting", "kitchen", "lab", "lounge", "library", "store", "copy", "lobby", "trees", "park"
]


@dataclass(frozen=True)
class Door:
    """A doorway through a wall of a room and any wall behind it."""

    side: Side
    at: float
    """Distance of its middle from the end of the wall with the lower x or y."""
    width: Positive = 1.0
    leaf: bool = True
    """Whether a door leaf opens and closes it; false: always open."""


@dataclass(frozen=True)
class Room:
    """A named rectangle with walls, doors, windows, floor, furniture and lamps; without walls a corridor or a lawn."""

    name: str
    corner: Point
    """Lower left."""
    size: Extent
    doors: tuple[Door, ...] = ()
    windows: tuple[Side, ...] = ()
    """Sides with a row of windows; each has a curtain."""
    furniture: Furniture = "none"
    furniture_density: Share = 0.6
    """Share of the possible places for furniture that are taken."""
    walls: bool = True
    wall: Material = "plaster"
    facade: Material | None = None
    """Texture of the walls outside, for a room in the open."""
    floor: Material | None = None
    """null: the hall's."""
    height: float | None = None
    """Height of its own ceiling; null: the hall's."""
    lamps: Spread = 2.5
    """Distance between its lamps; 0: none."""


@dataclass(frozen=True)
class Kidnapping:
    """Somebody lifts the robot and puts it down again; odometry does not see it."""

    at: Positive
    """Seconds from the start of the drive."""
    turn: float = 0.0
    """Radians, counter-clockwise, by which it is turned."""
    to: tuple[float, float, float] | None = None
    """Pose at which it is put down: x, y, heading; null: the one that it had."""


@dataclass(frozen=True)
class Route:
    """A path through a world, led around obstacles. The robot starts at its first point, facing the second."""

    waypoints: tuple[Point, ...] = ()
    """Points to go through; `aisles`, `rooms` and `random` start at the first and end with the rest."""
    kind: Literal["waypoints", "aisles", "laps", "rooms", "random"] = "waypoints"
    """`waypoints`: through the given points; `laps`: round them; `aisles`: through every aisle; `rooms`: into every
    room that can be reached; `random`: between random free places or down random aisles."""
    through: tuple[str, ...] = ()
    """Names of the aisle blocks or rooms to visit; empty: all."""
    laps: Annotated[int, Bounds(ge=1)] = 1
    """Repetitions: times around for `laps`; times through each aisle, in alternating directions, for `aisles`."""
    lead_in: tuple[Point, ...] = ()
    """Points to go through before the first lap of `laps`."""
    length: Positive | None = None
    """Metres after which it ends; null: the whole path."""
    seed: int = 0
    """Seed of random routes."""
    kidnappings: tuple[Kidnapping, ...] = ()
    """Kidnappings on each drive along this route."""
    day_duration_s: Positive | None = None
    """Seconds after which lamps, curtains and goods become those of the next day during a drive; null: never."""


@dataclass(frozen=True)
class Day:
    """The state of a world on one day. The world's seed and the day decide which goods, doors or lamps change."""

    people: Annotated[int, Bounds(ge=0, le=1000)] = 0
    """Walkers in the whole world."""
    rearranged: Share = 0.0
    """Share of the shelves' compartments that hold other goods."""
    furniture: Spread = 0.0
    """Standard deviation (m) of the shift of furniture."""
    light: tuple[Factor, Factor, Factor] = (1.0, 1.0, 1.0)
    """Factors of all light: blue, green, red."""
    lamps_off: Share | tuple[str, ...] = 0.0
    """Share of the lamps that are off, or the names of lamps or rooms."""
    curtains: Share = 0.0
    """Share of the windows whose curtains are closed."""
    doors: Share = 1.0
    """Share of the doors that are open."""


@dataclass(frozen=True)
class Robot:
    """A differential drive that is steered along a route."""

    radius: Positive = 0.25
    speed: Pace = 0.45
    """Maximum, m/s."""
    turn_speed: Pace = 0.9
    """Maximum, rad/s."""
    acceleration: Pace = 0.5
    """m/s²."""
    turn_acceleration: Pace = 2.0
    """rad/s²."""
    look_ahead: Positive = 0.45
    """Distance along the route to the point that is steered for (pure pursuit)."""
    path_jitter_m: Spread = 0.2
    """Standard deviation of each day's offset from the route, drawn every 2.5 m; its root mean square is 0.78 of it."""
    contact: Literal["slide", "hold"] = "slide"
    """At an obstacle the robot slides along it, or stops."""


@dataclass(frozen=True)
class OdometryNoise:
    """Noise of an odometry increment (rotation, translation, rotation), and systematic errors drawn once a day.

    sigma_trans = `translation` sqrt(m); sigma_rot^2 = `rotation`^2 |rad| + `drift`^2 m.
    """

    translation: Spread = 0.02
    """m per sqrt(m)."""
    rotation: Spread = 0.021
    """rad per sqrt(rad), 1.2 degrees."""
    drift: Spread = 0.0122
    """rad per sqrt(m), 0.7 degrees."""
    scale_bias: Spread = 0.02
    """Standard deviation of the relative error of translation."""
    rotation_bias: Spread = 0.015
    """Standard deviation of the relative error of rotation."""
    turn_bias: Spread = 0.0044
    """Standard deviation of the rotation (rad) added per metre, 0.25 degrees."""
    added: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Further noise as in Wolf, Burgard & Burkhardt 2005: mm per sqrt(m), degrees per sqrt(360 degrees), degrees per
    sqrt(m); `odometry_noise=nine_levels` holds theirs."""


def mirror(columns: int = 640) -> dict[str, Any]:
    """The default camera as in camera.yaml: a hyperbolic mirror above a camera with images of ratio 4 : 3."""
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
    """The camera's image sensor."""

    noise: Spread = 2.0
    """Standard deviation in grey levels."""
    vignetting: Share = 0.12
    """Share of the light that is lost in the corners."""
    exposure: Positive = 1.0
    """Factor of brightness."""
    exposure_drift: Share = 0.04
    """Amplitude of a slow change of exposure."""
    exposure_period: Positive = 23.0
    """Period (s) of that change."""
    shutter: Spread = 0.0
    """Exposure time (s): motion during it is blurred."""
    sub_exposures: Annotated[int, Bounds(ge=1)] = 6
    """Instants within the exposure time that are rendered and averaged."""
    exposure_jumps: Spread = 0.0
    """Standard deviation (stops, factors of two) of an automatic exposure that jumps."""
    exposure_hold_s: Positive = 4.0
    """Seconds between two of its jumps."""


@dataclass(frozen=True)
class CameraErrors:
    """Errors of the camera that camera.yaml lacks. Signs and directions follow from the seed, the same on all days."""

    tilt_deg: Annotated[float, Bounds(ge=0, le=30)] = 0.0
    """Degrees by which the camera leans; the image of the robot itself stays where it is."""
    focal: Annotated[float, Bounds(ge=0, le=0.2)] = 0.0
    """Share by which its focal lengths are longer or shorter."""
    centre_px: Annotated[float, Bounds(ge=0, le=100)] = 0.0
    """Pixels by which its centre is off."""


@dataclass(frozen=True)
class Ramps:
    """A floor that rises, is level and falls along x, over and over. Robot and camera lean with it.

    Nothing else does: bodies stay upright on a flat floor, the camera stays at its height, and ranges and odometry are
    those of the flat floor (which differ by 0.06 % at 2 degrees).
    """

    slope_deg: Annotated[float, Bounds(ge=0, le=30)] = 0.0
    """Steepest slope; it holds over two thirds of the way."""
    period_m: Positive = 16.0
    """Metres along x from one rise to the next."""


@dataclass(frozen=True)
class Timing:
    """Rates at which the robot records."""

    images: Positive = 2.0
    """Hz."""
    odometry: Annotated[float, Bounds(ge=1, le=1000)] = 20.0
    """Hz, of odometry and ground truth."""


@dataclass(frozen=True)
class Ranges:
    """A ring of ultrasound-like range sensors. The first looks backwards, the others follow counter-clockwise."""

    readings: Annotated[int, Bounds(ge=1)] = 16
    """Sensors around the robot."""
    beam_width: Positive = 0.26
    """Opening angle (rad) of a sensor's cone, 15 degrees; the nearest echo in it counts."""
    max_range: Positive = 4.0
    """Metres from the robot's middle beyond which there is no echo."""
    noise: Spread = 0.01
    """Standard deviation (m) of a range."""
    dropout: Share = 0.02
    """Share of the readings that miss their echo."""
    rate: Positive = 5.0
    """Scans per second (Hz) in a log."""


@dataclass(frozen=True)
class Delivery:
    """Faults of images on their way into the log."""

    dropped: Share = 0.0
    """Share that is lost."""
    late: Share = 0.0
    """Share that arrives late."""
    delay_s: Spread = 0.7
    """By how many seconds."""


@dataclass(frozen=True)
class WorldConfig:
    """A hall of `size`, what is in it, the robot that drives there and its sensors.

    Day k is `days[k]`; later days are like the last one. With the ceiling material `sky` the world is outdoors and
    rooms have roofs.
    """

    name: str = "empty"
    seed: Annotated[int, Bounds(ge=0)] = 1
    """Seed of goods, textures, the jitter of each day's path and all noise."""
    draw: Annotated[int, Bounds(ge=0)] = 0
    """Which world is drawn: 0 and 7 to 17 are for development, the others for tests. Each has another seed; in draws
    2, 4, 6, … routes that are not `random` are driven the other way round."""
    plan: Literal["paper", "drawn"] = "paper"
    """`paper`: walls, doors, rooms, aisles, lamps and routes as listed, of the papers' kind and size; `drawn`: by the
    seed, others in each draw."""
    size: Extent = (12.0, 9.0)
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
    """Share of ambient light; lamps and windows give the rest."""
    goods: Annotated[int, Bounds(ge=1)] = 56
    """Number of different goods in the whole world."""
    assortment: Annotated[int, Bounds(ge=1)] = 56
    """Number of different goods in one department."""
    days: tuple[Day, ...] = (Day(), Day(rearranged=0.1))
    routes: dict[str, Route] = field(default_factory=dict)
    robot: Robot = Robot()
    odometry: OdometryNoise = OdometryNoise()
    camera: dict[str, Any] = field(default_factory=mirror)
    """Content of a camera.yaml, of any projection, with the camera's height."""
    sensor: Sensor = Sensor()
    timing: Timing = Timing()
    ranges: Ranges = Ranges()
    delivery: Delivery = Delivery()
    camera_errors: CameraErrors = CameraErrors()
    ramps: Ramps = Ramps()

    def __post_init__(self) -> None:
        """Raise ValueError for rooms and doors out of place, rooms of one name, crowds, names that are none, and a
        camera above the ceiling or beside the robot."""
        named = [room.name for room in self.rooms]
        if twice := sorted({name for name in named if named.count(name) > 1}):
            raise ValueError(f"rooms: two or more are named {', '.join(twice)}; give each a name of its own")
        floor = f"{self.size[0]:g} x {self.size[1]:g} m (size)"
        names = {*named} | {lamp.name for lamp in self.lamps}
        for number, room in enumerate(self.rooms):
            where, (x, y), (width, depth) = f"rooms.{number} ('{room.name:.40}')", room.corner, room.size
            over = max(-x, -y, x + width - self.size[0], y + depth - self.size[1])
            if over > MAX_BESIDE_M:
                raise ValueError(f"{where} is {over:g} m over the edge of the floor of {floor}; move its corner")
            for k, door in enumerate(room.doors):
                length = width if door.side in ("north", "south") else depth
                if max(door.width / 2 - door.at, door.at + door.width / 2 - length) > MAX_BESIDE_M:
                    raise ValueError(
                        f"{where}, doors.{k}: {door.width:g} m at {door.at:g} m are not within its {door.side} wall, "
                        f"which is {length:g} m long"
                    )
        eye = self.camera.get("height")
        if isinstance(eye, int | float) and eye >= self.height:
            raise ValueError(f"height: the ceiling is {self.height:g} m high, and the camera {eye:g} m (camera.height)")
        at = self.camera.get("position")
        away = [value for value in at.values() if isinstance(value, int | float)] if isinstance(at, dict) else []
        if math.hypot(*away) > self.robot.radius:
            raise ValueError(f"camera.position: it is beside the robot, whose radius is {self.robot.radius:g} m")
        for number, day in enumerate(self.days):
            most = int(self.size[0] * self.size[1] * MAX_PEOPLE_PER_M2)
            if day.people > most:
                raise ValueError(f"days.{number}.people: {day.people}, expected at most {most} on a floor of {floor}")
            unknown = set(day.lamps_off) - names if isinstance(day.lamps_off, tuple) else set()
            if unknown:
                known = ", ".join(sorted(names - {""})) or "none"
                raise ValueError(
                    f"days.{number}.lamps_off: there is no '{min(unknown):.40}'; rooms and lamps: {known:.300}"
                )

    @property
    def draw_seed(self) -> int:
        """The seed of all that is drawn at random: `seed` + 1000 `draw`."""
        return self.seed + 1000 * self.draw

    @property
    def drives_backwards(self) -> bool:
        """Tells whether routes are driven the other way round: in even draws, but for the first."""
        return self.draw > 0 and self.draw % 2 == 0

    @property
    def label(self) -> str:
        """Its name, and its draw where that is not the one for development."""
        plan = ", drawn plan" if self.plan == "drawn" else ""
        return f"{self.name}{plan}, draw {self.draw}" if self.draw else f"{self.name}{plan}"

    @property
    def eye_height(self) -> float:
        """Metres of the camera above the floor."""
        return float(self.camera["height"])

    def day(self, number: int) -> Day:
        """The state of the world on day `number` (from 0)."""
        return self.days[min(number, len(self.days) - 1)] if self.days else Day()

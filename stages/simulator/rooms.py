"""Rooms as single bodies: walls cut by doors, windows, furniture along the walls and in the middle, trees outside."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, get_args

import numpy as np

from .config import Block, Day, Door, Furniture, Material, Point, Room, Side, WallPanel, WorldConfig
from .streams import stream

INNER_WALL_M = 0.12
"""Thickness (m) of an inner wall."""
SIDES: tuple[Side, ...] = get_args(Side)
FACING: dict[Side, float] = {"east": math.pi, "north": -math.pi / 2, "west": 0.0, "south": math.pi / 2}
"""Headings from each wall of a room into it."""
DOOR_HEIGHT_M = 2.1
DOOR_CLEARANCE_M = 0.7
"""Metres that furniture keeps from both sides of a door."""


class Opening(NamedTuple):
    """A gap in walls: whether they run along x, where they are across that, its middle along it, and its width."""

    along_x: bool
    line: float
    middle: float
    width: float

    @property
    def ends(self) -> tuple[float, float]:
        """Gives the ends of the gap along the wall (m)."""
        return self.middle - self.width / 2, self.middle + self.width / 2


class Wall(NamedTuple):
    """A side of a room: whether it runs along x, where it is across that, and where it begins and ends.

    `inward`: 1 where the room is on the side of greater x or y, else -1.
    """

    along_x: bool
    line: float
    low: float
    high: float
    inward: int

    def inside(self, inset: float) -> float:
        """Gives the coordinate across the wall that is a distance (m) inside the room."""
        return self.line + self.inward * inset

    def on_map(self, along: float, across: float) -> Point:
        """A place, or a size, given along the wall and across."""
        return (along, across) if self.along_x else (across, along)

    def cut_by(self, cuts: Sequence[Opening]) -> list[Opening]:
        """The openings that lead through it."""
        return [
            cut
            for cut in cuts
            if cut.along_x == self.along_x
            and abs(cut.line - self.line) < 3 * INNER_WALL_M
            and self.low < cut.middle < self.high
        ]


@dataclass(frozen=True)
class _Piece:
    """Furniture along a wall: length along it, depth, height, looks, the height it hangs at, and what is on it."""

    length: float
    depth: float
    height: float
    material: Material
    top: Material = "wood"
    bottom_z: float = 0.0
    chair: bool = False
    above: "_Piece | None" = None


_SCREEN = _Piece(0.55, 0.06, 0.36, "screen", "steel", 0.78)
_DESK = _Piece(1.5, 0.75, 0.74, "wood", chair=True, above=_SCREEN)
_BOOKS = _Piece(1.0, 0.35, 2.0, "books")
_CABINET = _Piece(0.9, 0.45, 1.2, "cabinet")
_SOFA = _Piece(1.8, 0.8, 0.75, "fabric", "fabric")
_PLANT = _Piece(0.45, 0.45, 1.3, "leaves", "leaves")
_BENCH = _Piece(1.8, 0.75, 0.9, "steel", "steel", above=_Piece(0.5, 0.35, 0.4, "carton", "carton", 0.9))
_COUNTER = _Piece(1.0, 0.6, 0.9, "cabinet", "steel", above=_Piece(1.0, 0.35, 0.65, "cabinet", "cabinet", 1.45))
_FRIDGE = _Piece(0.7, 0.65, 1.8, "steel", "steel")
_PRINTER = _Piece(0.9, 0.7, 1.1, "plaster", "screen")
_BOXES = _Piece(0.8, 0.6, 0.9, "carton", "carton")
_RECEPTION = _Piece(2.0, 0.7, 1.1, "counter")
_BARE = _Piece(1.4, 0.0, 0.0, "poster")

CATALOGUE: dict[Furniture, tuple[_Piece, ...]] = {
    "none": (_BARE,),
    "office": (_DESK, _DESK, _BOOKS, _CABINET, _BARE),
    "meeting": (_CABINET, _BARE, _BARE, _PLANT),
    "kitchen": (_COUNTER, _COUNTER, _FRIDGE, _COUNTER),
    "lab": (_BENCH, _BENCH, _CABINET, _DESK),
    "lounge": (_SOFA, _PLANT, _BARE, _SOFA),
    "library": (_BOOKS,),
    "store": (_BOXES, _CABINET, _BOXES),
    "copy": (_PRINTER, _CABINET, _BARE),
    "lobby": (_RECEPTION, _PLANT, _BARE, _SOFA),
    "trees": (),
    "park": (),
}
"""Furniture along the walls of a room of each kind, drawn in this proportion."""

TABLES: dict[Furniture, tuple[Point, Material]] = {
    "meeting": ((2.4, 1.2), "wood"),
    "kitchen": ((1.4, 0.8), "wood"),
    "lab": ((2.2, 1.0), "steel"),
    "library": ((1.6, 0.9), "wood"),
}
"""Size and look of the table in the middle, where there is room around it."""

TABLE_ROOM_M = 4.3
"""Metres that a room is wider than a table in it, so that a robot gets around the table and what is along walls."""


def openings(config: WorldConfig) -> list[Opening]:
    """The ways through walls of all rooms."""
    return [_opening(room, door) for room in config.rooms for door in room.doors]


def _opening(room: Room, door: Door) -> Opening:
    wall = wall_of(room, door.side)
    return Opening(wall.along_x, wall.line, wall.low + door.at, door.width)


def wall_of(room: Room, side: Side) -> Wall:
    """The wall of a room on a side."""
    (x, y), (width, depth) = room.corner, room.size
    if side in ("north", "south"):
        return Wall(True, y + depth if side == "north" else y, x, x + width, -1 if side == "north" else 1)
    return Wall(False, x + width if side == "east" else x, y, y + depth, -1 if side == "east" else 1)


def walls(config: WorldConfig, room: Room, cuts: list[Opening]) -> list[Block]:
    """Walls of a room just inside its rectangle, and its facade just outside; above openings they continue."""
    height = room.height or config.height
    layers: list[tuple[float, Material, str, float]] = [(INNER_WALL_M / 2, room.wall, f"{room.name} wall", 0.0)]
    if room.facade:
        layers.append((-INNER_WALL_M / 2, room.facade, f"{room.name} facade", INNER_WALL_M))
    blocks = []
    for inset, material, look, overlap in layers:
        for side in SIDES:
            wall = wall_of(room, side)
            gaps = [cut.ends for cut in sorted(wall.cut_by(cuts), key=lambda cut: cut.middle)]
            edges = [wall.low - overlap, *(end for gap in gaps for end in gap), wall.high + overlap]
            pieces = [
                (*piece, 0.0) for piece in zip(edges[::2], edges[1::2], strict=True) if piece[1] - piece[0] > 0.02
            ]
            if height > DOOR_HEIGHT_M + 0.05:
                pieces += [(*gap, DOOR_HEIGHT_M) for gap in gaps]
            for begin, end, bottom_z in pieces:
                centre = wall.on_map((begin + end) / 2, wall.inside(inset))
                size = wall.on_map(end - begin, INNER_WALL_M)
                tall = height - bottom_z
                blocks.append(Block(centre, size, tall, material, "concrete", bottom_z, look=look, kind="wall"))
    return blocks


def roof(room: Room) -> list[Block]:
    """A ceiling of its own over a room that is lower than the hall."""
    if room.height is None or not room.walls:
        return []
    (x, y), (width, depth) = room.corner, room.size
    out = INNER_WALL_M if room.facade else 0.0
    centre, size = (x + width / 2, y + depth / 2), (width + 2 * out, depth + 2 * out)
    return [
        Block(centre, size, 0.3, room.facade or "concrete", "concrete", room.height, 0.0, "ceiling", "roof", "roof")
    ]


def is_open(config: WorldConfig, room: Room, k: int, day: int) -> bool:
    """Tells whether door `k` of a room is open on a day."""
    drawn = stream(config.draw_seed, "door", room.name, k, "day", day).uniform()
    return not room.doors[k].leaf or bool(drawn < config.day(day).doors)


def doors(config: WorldConfig, room: Room, day: int) -> list[Block]:
    """The leaves of a room's doors: across the opening where closed, swung into the room where open."""
    leaves = []
    for k, door in enumerate(room.doors):
        if not door.leaf:
            continue
        wall = wall_of(room, door.side)
        along, across = wall.low + door.at, wall.inside(INNER_WALL_M / 2)
        opened = is_open(config, room, k, day)
        if opened:
            along, across = along - door.width / 2, across + wall.inward * (door.width / 2 + INNER_WALL_M / 2)
        yaw = 0.0 if wall.along_x != opened else math.pi / 2
        centre, size, look = wall.on_map(along, across), (door.width, 0.05), f"{room.name} door"
        leaves.append(Block(centre, size, DOOR_HEIGHT_M, "door", "wood", yaw=yaw, look=look, kind="door"))
    return leaves


def windows(room: Room) -> list[WallPanel]:
    """Rows of windows on the named sides, where no door is."""
    panes = []
    for side in room.windows:
        wall = wall_of(room, side)
        count = max(1, math.floor((wall.high - wall.low) / 1.8))
        for k in range(count):
            along = wall.low + (wall.high - wall.low) * (k + 0.5) / count
            if any(d.side == side and abs(wall.low + d.at - along) < (d.width + 1.3) / 2 for d in room.doors):
                continue
            panes.append(_on_wall(room, side, along, 1.3, 0.9, 1.2, "window"))
    return panes


def _on_wall(
    room: Room, side: Side, along: float, width: float, low: float, height: float, material: Material
) -> WallPanel:
    wall = wall_of(room, side)
    centre = wall.on_map(along, wall.inside(INNER_WALL_M if room.walls else 0.0))
    return WallPanel(centre, FACING[side], width, low, height, material)


class Fittings(NamedTuple):
    """Furniture and panels of a room."""

    blocks: list[Block]
    wall_panels: list[WallPanel]


def furnish(config: WorldConfig, room: Room, cuts: list[Opening], day: Day, number: int) -> Fittings:
    """Furniture of a room, by its kind and the seed; on each day every piece is shifted along its wall a little."""
    if room.furniture in ("trees", "park"):
        return Fittings(list(_planted(config, room)), [])
    rng = stream(config.draw_seed, "furniture", room.name)
    moved = stream(config.draw_seed, "furniture", room.name, "day", number)
    blocks: list[Block] = []
    wall_panels: list[WallPanel] = []
    pieces = CATALOGUE[room.furniture]
    for side in SIDES if room.walls else ():
        wall = wall_of(room, side)
        corner = 1.0 if side in ("east", "west") else 0.2
        begin, end = wall.low + corner, wall.high - corner
        free = [(low - DOOR_CLEARANCE_M, high + DOOR_CLEARANCE_M) for low, high in (c.ends for c in wall.cut_by(cuts))]
        for piece, along in _placed_along(rng, pieces, room.furniture_density, begin, end, free):
            shift = float(np.clip(moved.normal(0.0, 1.0), -2, 2)) * day.furniture
            if piece.depth == 0.0:
                if not any(w == side for w in room.windows):
                    low_z, width = rng.uniform(0.9, 1.2), rng.uniform(0.6, 1.2)
                    kind: Material = "board" if room.furniture in ("meeting", "lab") else "poster"
                    tall = 1.0 if kind == "board" else rng.uniform(0.7, 1.2)
                    wall_panels.append(_on_wall(room, side, along, width, low_z, tall, kind))
                continue
            if side in room.windows and piece.height > 1.4:
                continue
            along = min(max(along + shift, begin + piece.length / 2), end - piece.length / 2)
            blocks += _against_wall(room, wall, along, piece, float(moved.normal()) * day.furniture)
    blocks += _table(room, float(moved.normal()) * day.furniture)
    return Fittings(blocks, wall_panels)


def _placed_along(
    rng: np.random.Generator,
    pieces: tuple[_Piece, ...],
    density: float,
    begin: float,
    end: float,
    free: list[tuple[float, float]],
) -> Iterator[tuple[_Piece, float]]:
    """Pieces along a wall with their middles, clear of the stretches that doors need."""
    at = begin
    while at < end:
        piece = pieces[int(rng.integers(len(pieces)))]
        wanted, gap = rng.uniform() < density, rng.uniform(0.02, 0.4)
        last = at + piece.length
        blocked = [stretch for stretch in free if at < stretch[1] and last > stretch[0]]
        if blocked:
            at = max(stretch[1] for stretch in blocked)
            continue
        if wanted and last <= end:
            yield piece, at + piece.length / 2
        at = last + gap


def _against_wall(room: Room, wall: Wall, along: float, piece: _Piece, turn: float) -> Iterator[Block]:
    """A piece of furniture with its back to the wall, what is on it, and the chair in front."""

    def body(part: _Piece, depth_at: float, yaw: float = 0.0, look: str = "") -> Block:
        centre = wall.on_map(along, wall.inside(INNER_WALL_M + 0.01 + depth_at))
        size = wall.on_map(part.length, part.depth)
        name = look or f"{room.name} {part.material}"
        return Block(
            centre, size, part.height, part.material, part.top, part.bottom_z, yaw, look=name, kind="furniture"
        )

    yield body(piece, piece.depth / 2)
    if piece.above is not None:
        yield body(piece.above, piece.above.depth / 2 + 0.02)
    if piece.chair:
        chair = _Piece(0.5, 0.5, 0.9, "fabric", "fabric")
        yield body(chair, piece.depth + 0.3, 0.3 * turn + 0.2, f"{room.name} chair")


def _table(room: Room, shift: float) -> Iterator[Block]:
    """The table in the middle with its chairs, where a robot gets around it."""
    if room.furniture not in TABLES:
        return
    (length, depth), material = TABLES[room.furniture]
    width, height = room.size
    if width < height:
        length, depth = depth, length
    if width - length < TABLE_ROOM_M or height - depth < TABLE_ROOM_M:
        return
    middle = room.corner[0] + width / 2 + max(-0.2, min(0.2, shift)), room.corner[1] + height / 2
    yield Block(middle, (length, depth), 0.74, material, "wood", look=f"{room.name} table", kind="furniture")
    long_side = max(length, depth)
    chairs = max(1, round(long_side / 0.9))
    for k in range(chairs):
        for across in (-1, 1):
            along = (k + 0.5) / chairs * long_side - long_side / 2
            off = across * (min(length, depth) / 2 + 0.2)
            centre = (middle[0] + along, middle[1] + off) if length >= depth else (middle[0] + off, middle[1] + along)
            yield Block(centre, (0.45, 0.45), 0.88, "fabric", "fabric", look=f"{room.name} chair", kind="furniture")


def _planted(config: WorldConfig, room: Room) -> Iterator[Block]:
    """Trees (and in a park hedges and benches) scattered over a rectangle, apart from each other."""
    rng = stream(config.draw_seed, "planted", room.name)
    (x, y), (width, depth) = room.corner, room.size
    columns, rows = max(1, round(width / 4.0)), max(1, round(depth / 4.0))
    for row in range(rows):
        for column in range(columns):
            at = (
                x + width * (column + 0.5 + rng.uniform(-0.2, 0.2)) / columns,
                y + depth * (row + 0.5 + rng.uniform(-0.2, 0.2)) / rows,
            )
            taken, what, yaw = rng.uniform() < room.furniture_density, rng.uniform(), rng.uniform(0.0, math.pi)
            trunk, crown = rng.uniform(0.25, 0.4), min(rng.uniform(1.6, 2.6), width, depth)
            look = f"plant {rng.integers(12)}"
            if not taken:
                continue
            if room.furniture == "park" and what < 0.4:
                hedge = (min(rng.uniform(1.5, 3.0), width), 0.6)
                yield Block(at, hedge, rng.uniform(0.8, 1.4), "hedge", "hedge", yaw=yaw, look=look, kind="plant")
            elif room.furniture == "park" and what < 0.5:
                yield Block(at, (min(1.6, width), 0.5), 0.5, "wood", "wood", yaw=yaw, look="bench", kind="furniture")
            else:
                low = rng.uniform(1.7, 2.3)
                yield Block(at, (trunk, trunk), low + 0.2, "bark", "bark", yaw=yaw, look=look, kind="plant")
                tall = rng.uniform(1.5, 2.4)
                yield Block(at, (crown, crown), tall, "leaves", "leaves", low, yaw, "leaves", look, "plant")

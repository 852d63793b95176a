"""Lays out aisle blocks, rooms and lamp grids of a world on a day as single bodies."""

import math
from dataclasses import dataclass, replace

from .config import AisleBlock, Block, Lamp, LampGrid, Point, Room, Shelf, WallPanel, WorldConfig
from .rooms import doors, furnish, openings, roof, walls, windows
from .streams import stream


@dataclass(frozen=True)
class Aisle:
    """The free middle of an aisle between two rows of shelves: its ends, and the block it belongs to."""

    block: str
    ends: tuple[Point, Point]
    closed: bool = False
    """A shelf closes it behind its second end."""


@dataclass(frozen=True)
class Layout:
    """All single bodies of a world on a day, and the aisles between its shelves."""

    shelves: tuple[Shelf, ...]
    blocks: tuple[Block, ...]
    wall_panels: tuple[WallPanel, ...]
    lamps: tuple[Lamp, ...]
    aisles: tuple[Aisle, ...]


def expand(config: WorldConfig, day: int = 0) -> Layout:
    """Lay out a world as it is on a day (from 0)."""
    shelves, blocks, lamps, aisles = list(config.shelves), list(config.blocks), list(config.lamps), []
    for number, block in enumerate(config.aisle_blocks):
        named = replace(block, name=block.name or f"block {number}")
        rows, pillars, between = _aisle_block(config, named)
        shelves += rows
        blocks += pillars
        aisles += between
    if config.lamp_grid is not None:
        lamps += _lamp_grid(config.lamp_grid, (0.0, 0.0), config.size)
    wall_panels, today, cuts = list(config.wall_panels), config.day(day), openings(config)
    for room in config.rooms:
        lamps += _room_lamps(room)
        if room.walls:
            blocks += walls(config, room, cuts) + roof(room) + doors(config, room, day)
            wall_panels += windows(room)
        fittings = furnish(config, room, cuts, today, day)
        blocks += fittings.blocks
        wall_panels += fittings.wall_panels
    wall_panels = [_curtained(config, hanging, k, day) for k, hanging in enumerate(wall_panels)]
    return Layout(tuple(shelves), tuple(blocks), tuple(wall_panels), tuple(lamps), tuple(aisles))


def _curtained(config: WorldConfig, hanging: WallPanel, number: int, day: int) -> WallPanel:
    """A window with its curtain closed, where the day has it so."""
    if hanging.material != "window":
        return hanging
    closed = stream(config.draw_seed, "curtain", number, "day", day).uniform() < config.day(day).curtains
    return replace(hanging, material="curtain") if closed else hanging


def _aisle_block(config: WorldConfig, block: AisleBlock) -> tuple[list[Shelf], list[Block], list[Aisle]]:
    """Rows of shelves, their pillars, and the aisles between them."""
    turned = block.along == "y"
    length, across = (block.size[1], block.size[0]) if turned else block.size
    rows = max(1, math.floor((across + block.aisle) / (block.depth + block.aisle) + 1e-9))
    pitch = (across - block.depth) / (rows - 1) if rows > 1 else 0.0
    gap = pitch - block.depth if rows > 1 else block.aisle
    stretches = block.cross_aisles + 1
    stretch = (length - block.cross_aisles * gap) / stretches
    rng = stream(config.draw_seed, "aisles", block.name)
    shelves, pillars, aisles = [], [], []

    def at(along: float, over: float) -> Point:
        x, y = (over, along) if turned else (along, over)
        return block.corner[0] + x, block.corner[1] + y

    yaw = math.pi / 2 if turned else 0.0
    row = Shelf((0.0, 0.0), stretch, block.depth, block.height, block.levels, yaw, block.stock)
    row = replace(row, department=block.department or block.name)
    for k in range(rows):
        over = block.depth / 2 + k * pitch
        for s in range(stretches):
            begin = s * (stretch + gap)
            shelves.append(replace(row, centre=at(begin + stretch / 2, over)))
            if block.pillars and k % 2:
                count = math.floor(stretch / block.pillars)
                for p in range(count):
                    middle = at(begin + stretch * (p + 0.5) / count, over)
                    pillars.append(Block(middle, (0.4, 0.4), config.height, "concrete", "concrete", look="pillar"))
            if k + 1 == rows:
                continue
            closed = 0 < k < rows - 2 and rng.uniform() < block.dead_ends
            near_end = rng.uniform() < 0.5
            ends = at(begin, over + pitch / 2), at(begin + stretch, over + pitch / 2)
            if closed:
                depth = min(0.5, block.depth)
                middle = at(begin + (depth / 2 if near_end else stretch - depth / 2), over + pitch / 2)
                shelves.append(replace(row, centre=middle, length=gap, depth=depth, yaw=yaw + math.pi / 2))
                ends = ends[::-1] if near_end else ends
            aisles.append(Aisle(block.name, ends, closed))
    return shelves, pillars, aisles


def _lamp_grid(grid: LampGrid, corner: Point, size: Point) -> list[Lamp]:
    """Lamps in the middles of equal parts of a rectangle."""
    columns, rows = (max(1, round(extent / step)) for extent, step in zip(size, grid.spacing, strict=True))
    return [
        Lamp(
            centre=(corner[0] + size[0] * (column + 0.5) / columns, corner[1] + size[1] * (row + 0.5) / rows),
            size=grid.size,
            light=grid.light,
        )
        for row in range(rows)
        for column in range(columns)
    ]


def _room_lamps(room: Room) -> list[Lamp]:
    """Lamps of a room, switched by its name."""
    if not room.lamps:
        return []
    grid = LampGrid((room.lamps, room.lamps))
    return [replace(lamp, z=room.height, name=room.name) for lamp in _lamp_grid(grid, room.corner, room.size)]

"""A world on one day: its bodies, its textures and lights as a scene to render, and where there is room to drive."""

import math
from collections.abc import Sequence
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array, Bools, Bytes, Ints

from . import people, textures
from .bodies import Box, Tiling, box_array
from .config import Block, Lamp, Room, Shelf, WallPanel, WorldConfig
from .drawn_plan import laid_out
from .layout import expand
from .lighting import lamps_and_windows, lamps_on
from .obstacles import Obstacles, distances, gather
from .renderer import Scene
from .scene import build_scene
from .streams import stream

WALL_THICKNESS_M = 0.2
"""Thickness (m) of the outer walls."""
MAX_DRIVABLE_HEIGHT_M = 0.03
"""Maximum height (m) of bodies that can be driven over."""
VARIED_MATERIALS = ("floor", "ceiling", "grass", "asphalt", "paving", "parquet", "sky")
"""Materials whose tiles differ a little; others repeat one tile."""
HEADROOM_M = 1.4
"""Minimum height (m) of bodies that can be driven under."""


@lru_cache(maxsize=1024)
def _drawn(seed: int, material: str, name: str) -> Bytes:
    """A texture, drawn once for all days of a world."""
    texture = textures.draw(material, stream(seed, "texture", material, name))
    texture.flags.writeable = False
    return texture


class World:
    """A world from its configuration, as it is on a day.

    The seed decides textures and goods; on days other than 0 a share of the shelves' compartments is filled again.
    """

    def __init__(self, config: WorldConfig, day: int = 0) -> None:
        self.config = config = laid_out(config)
        self.day = day
        self.layout = expand(config, day)
        lamps = self.layout.lamps
        self._named: dict[tuple[str, str], int] = {}
        self._tints: dict[int, tuple[float, float, float]] = {}
        self._gathered: dict[float, Obstacles] = {}
        kinds = config.goods if self.layout.shelves else 0
        self._goods = [self._texture("goods", f"goods {k}") for k in range(kinds)]
        self.boxes: list[Box] = [
            *self._walls(),
            *(box for k, shelf in enumerate(self.layout.shelves) for box in self._shelf(shelf, k)),
            *(self._block(block, k) for k, block in enumerate(self.layout.blocks)),
            *(self._wall_panel(hanging, k) for k, hanging in enumerate(self.layout.wall_panels)),
            *(self._lamp(lamp, on) for lamp, on in zip(lamps, lamps_on(lamps, config, day), strict=True)),
        ]
        self.floor = self._ground(config.floor, 6, config.rooms)
        self.ceiling = self._ground(config.ceiling, 6)

    # Bodies

    def _texture(self, material: str, name: str) -> int:
        """Number of the texture of a material for a thing of that name; it is drawn for the scene."""
        return self._named.setdefault((material, name), len(self._named))

    def _plain(
        self, texture: int, width: float, height: float, extent: tuple[float, float] = (math.inf, math.inf)
    ) -> Tiling:
        """One texture over a face of `width` by `height` m, repeated about every `extent` m across and down."""
        columns, rows = max(1, round(width / extent[0])), max(1, round(height / extent[1]))
        return Tiling(np.full((rows, columns), texture), width / columns, height / rows)

    def _ground(self, material: str, kinds: int, rooms: Sequence[Room] = ()) -> Tiling:
        """Floor or ceiling in tiles of about a metre; rooms have floors of their own."""
        rows, columns = math.ceil(self.config.size[1]), math.ceil(self.config.size[0])
        choice = stream(self.config.draw_seed, "ground", material).integers(kinds, size=(rows, columns))
        numbers = np.array([self._texture(material, f"{material} {k}") for k in range(kinds)])
        choice = choice if material in VARIED_MATERIALS else 0 * choice
        tiles = numbers[choice]
        width, depth = self.config.size[0] / columns, self.config.size[1] / rows
        for room in rooms:
            if room.floor is not None:
                kinds = 3 if room.floor in VARIED_MATERIALS else 1
                own = np.array([self._texture(room.floor, f"{room.name} floor {k}") for k in range(kinds)])
                (left, low), (wide, deep) = room.corner, room.size
                across = slice(round(left / width), round((left + wide) / width))
                up = slice(round(low / depth), round((low + deep) / depth))
                tiles[up, across] = own[choice[up, across] % len(own)]
        return Tiling(tiles, width, depth)

    def _walls(self) -> list[Box]:
        width, depth = self.config.size
        high = self.config.height
        walls = []
        for name, centre, length, yaw in (
            ("east", (width + WALL_THICKNESS_M / 2, depth / 2), depth, math.pi / 2),
            ("north", (width / 2, depth + WALL_THICKNESS_M / 2), width, 0.0),
            ("west", (-WALL_THICKNESS_M / 2, depth / 2), depth, math.pi / 2),
            ("south", (width / 2, -WALL_THICKNESS_M / 2), width, 0.0),
        ):
            texture = self._texture(self.config.wall, name)
            half = (length / 2 + WALL_THICKNESS_M, WALL_THICKNESS_M / 2)
            side = self._plain(texture, 2 * half[0], high, textures.extent(self.config.wall))
            end = self._plain(texture, WALL_THICKNESS_M, high)
            cap = self._plain(texture, 2 * half[0], WALL_THICKNESS_M)
            walls.append(Box("wall", centre, half, yaw, 0.0, high, (end, end, side, side, cap, cap)))
        return walls

    def _shelf(self, shelf: Shelf, number: int) -> list[Box]:
        goods = self.goods_on(shelf, number)
        wood = self._texture("wood", "shelf")
        cap = self._plain(wood, shelf.length, shelf.depth, (1.0, 1.0))
        height = shelf.height / shelf.levels
        sides = [
            Tiling(goods[face], extent / goods[face].shape[1], height)
            for face, extent in enumerate((shelf.depth, shelf.depth, shelf.length, shelf.length))
        ]
        half = (shelf.length / 2, shelf.depth / 2)
        body = Box("shelf", shelf.centre, half, shelf.yaw, 0.0, shelf.height, (*sides, cap, cap))  # type: ignore[arg-type]
        return [body, *self._stock(shelf, number)] if shelf.stock else [body]

    def goods_on(self, shelf: Shelf, number: int) -> list[Ints]:
        """Textures (levels, compartments) on each of a shelf's four sides, about one compartment a metre."""
        rng = stream(self.config.draw_seed, "goods", number)
        here = self._assortment(shelf.department)
        sides = []
        for extent in (shelf.depth, shelf.depth, shelf.length, shelf.length):
            shape = (shelf.levels, max(1, round(extent)))
            sides.append(here[rng.integers(len(here), size=shape)])
        rearranged = self.config.day(self.day).rearranged
        if rearranged:
            redrawn = stream(self.config.draw_seed, "goods", number, "day", self.day)
            for side in sides:
                changed = redrawn.uniform(size=side.shape) < rearranged
                side[changed] = here[redrawn.integers(len(here), size=int(changed.sum()))]
        return sides

    def _assortment(self, department: str) -> Ints:
        """Textures of the goods that a department has."""
        count = min(self.config.assortment, self.config.goods)
        chosen = stream(self.config.draw_seed, "assortment", department).permutation(self.config.goods)[:count]
        return np.array(self._goods)[np.sort(chosen)]

    def _stock(self, shelf: Shelf, number: int) -> list[Box]:
        """Cartons on top of a shelf, one here and there."""
        rng = stream(self.config.draw_seed, "stock", number)
        boxes: list[Box] = []
        along = -shelf.length / 2 + 0.3
        while along < shelf.length / 2 - 0.4:
            length, depth, height = rng.uniform(0.3, 0.6), rng.uniform(0.3, 0.6), rng.uniform(0.2, 0.5)
            if rng.uniform() < 0.7:
                across = rng.uniform(-0.15, 0.15)
                at = _place(shelf.centre, shelf.yaw, along + length / 2 - 0.15, across)
                yaw = shelf.yaw + rng.uniform(-0.15, 0.15)
                carton = "carton", f"carton {rng.integers(12)}"
                boxes.append(self._solid("stock", at, (length, depth), yaw, shelf.height, height, carton, carton))
            along += length + rng.uniform(0.1, 0.5)
        return boxes

    def _solid(
        self,
        kind: str,
        centre: tuple[float, float],
        size: tuple[float, float],
        yaw: float,
        low: float,
        height: float,
        side: tuple[str, str],
        top: tuple[str, str],
        bottom: tuple[str, str] | None = None,
    ) -> Box:
        """A body with textures, by material and name, of its sides, its top and its underside (or there its top's)."""

        def face(look: tuple[str, str], width: float, height: float) -> Tiling:
            return self._plain(self._texture(*look), width, height, textures.extent(look[0]))

        ends, fronts = (face(side, width, height) for width in size[::-1])
        above = face(top, *size)
        below = above if bottom is None else face(bottom, *size)
        half = (size[0] / 2, size[1] / 2)
        return Box(kind, centre, half, yaw, low, low + height, (ends, ends, fronts, fronts, below, above))

    def _block(self, block: Block, number: int) -> Box:
        look = block.look or f"block {number}"
        side, top = (block.material, look), (block.top, f"{look} top")
        bottom = None if block.bottom is None else (block.bottom, f"{look} bottom")
        return self._solid(
            block.kind, block.centre, block.size, block.yaw, block.bottom_z, block.height, side, top, bottom
        )

    def _wall_panel(self, hanging: WallPanel, number: int) -> Box:
        front = self._plain(self._texture(hanging.material, f"hanging {number}"), hanging.width, hanging.height)
        rim = self._plain(self._texture("concrete", "rim"), 1.0, 1.0)
        thick = 0.03
        return Box(
            kind="hanging",
            centre=_place(hanging.centre, hanging.facing, thick / 2, 0.0),
            half=(hanging.width / 2, thick / 2),
            yaw=hanging.facing + math.pi / 2,
            low=hanging.bottom_z,
            high=hanging.bottom_z + hanging.height,
            faces=(rim, rim, front, front, rim, rim),
        )

    def _lamp(self, lamp: Lamp, is_on: bool) -> Box:
        look = ("lamp", f"lamp {lamp.light}") if is_on else ("unlit", "lamp")
        self._tints[self._texture(*look)] = lamp.light
        low = (self.config.height if lamp.z is None else lamp.z) - 0.08
        return self._solid("lamp", lamp.centre, lamp.size, 0.0, low, 0.06, look, look)

    # As arrays for the renderer

    @cached_property
    def scene(self) -> Scene:
        """This world for the ray caster."""
        looks = [people.coverings(self._texture, look) for look in range(people.OUTFITS)]
        day = np.array(self.config.day(self.day).light)
        images, glow = [], [textures.glow(material) for material, _ in self._named]
        for number, (material, name) in enumerate(self._named):
            image = _drawn(self.config.draw_seed, material, name)
            if glow[number]:  # what shines has the light's colour
                image = np.clip(image * (day * self._tints.get(number, (1.0, 1.0, 1.0))), 0, 255).astype(np.uint8)
            images.append(image)
        return build_scene(
            self.boxes,
            self.floor,
            self.ceiling,
            self.config.size,
            self.config.height,
            images,
            glow,
            lamps_and_windows(self.layout.lamps, self.layout.wall_panels, self.config, self.day),
            self.config.ambient,
            day,
            looks,
        )

    # Who walks there

    @cached_property
    def crowd(self) -> people.Crowd:
        """The people of this day."""
        count = self.config.day(self.day).people
        return people.Crowd(self.config.draw_seed, self.day, count, self.config.size, self.clearance)

    # Room to drive

    @cached_property
    def obstacles(self) -> list[Box]:
        """Boxes that a robot cannot drive over or under."""
        return [box for box in self.boxes if box.high > MAX_DRIVABLE_HEIGHT_M and box.low < HEADROOM_M]

    def clearance(self, points: npt.ArrayLike) -> Array:
        """Distance (m) of points (N, 2) of the map to the nearest obstacle or wall; 0 inside one."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        reach = 2.0
        found = distances(self._near(reach), points)
        while reach < math.hypot(*self.config.size) and (far := found >= reach).any():
            reach *= 4.0  # most points have something near; the few others look farther
            found[far] = distances(self._near(reach), points[far])
        return found

    def _near(self, reach: float) -> Obstacles:
        if reach not in self._gathered:
            self._gathered[reach] = gather(box_array(self.obstacles), self.config.size, reach)
        return self._gathered[reach]

    def is_free(self, points: npt.ArrayLike, radius: float) -> Bools:
        """Tells whether a disc of `radius` m has room at points (N, 2)."""
        return self.clearance(points) > radius


def outline(box: Box) -> Array:
    """The four corners (4, 2) of a box on the floor."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * np.array(box.half)
    return np.array([_place(box.centre, box.yaw, along, across) for along, across in corners])


def _place(centre: Sequence[float], yaw: float, along: float, across: float) -> tuple[float, float]:
    """A point given in a turned frame at `centre`, on the map."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return centre[0] + cos * along - sin * across, centre[1] + sin * along + cos * across

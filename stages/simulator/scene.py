"""A world's bodies, textures and lights as the arrays that the ray caster works on."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Bytes

from . import textures
from .bodies import Box, Coverings, Tiling, box_array, boxes_of_cells
from .lighting import Light, contact_map, light_map
from .renderer import Scene

CELL = 0.5
"""Size (m) of the cells by which boxes are found."""
MARGIN = 0.25
"""Distance (m) to which the cells reach beyond the floor, for outer walls."""
LIGHT_STEP = 0.2
CONTACT_STEP = 0.1


def build_scene(
    boxes: Sequence[Box],
    floor: Tiling,
    ceiling: Tiling,
    size: tuple[float, float],
    height: float,
    images: Sequence[Bytes],
    glow: Sequence[float],
    lights: Sequence[Light],
    ambient: float,
    unlit: npt.ArrayLike,
    looks: Sequence[Sequence[Coverings]] = (),
) -> Scene:
    """The scene of boxes on a floor of `size` m under a ceiling at `height` m.

    `images` and `glow` are the textures that tilings number, and how much of each shines by itself. `unlit`: the
    light (blue, green, red) where there are no `lights`. `looks`: the coverings of the parts of people, look by look.
    """
    tilings = [floor, ceiling, *(face for box in boxes for face in box.faces)]
    people = [face for look in looks for part in look for face in part]
    parts = len(looks[0]) if looks else 0
    numbers = len(tilings) + np.arange(len(people), dtype=np.int32)
    tilings += people
    starts = np.cumsum([0, *(tiling.tiles.size for tiling in tilings)])[:-1]
    table = [(start, t.tiles.shape[1], t.tiles.shape[0]) for start, t in zip(starts, tilings, strict=True)]
    levels = textures.mip_levels(np.stack(images))
    bodies = box_array(boxes)
    grid = np.array([-MARGIN, -MARGIN, CELL])
    columns, rows = (math.ceil((extent + 2 * MARGIN) / CELL) for extent in size)
    cell_start, cell_boxes = boxes_of_cells(bodies, 0.0, grid[:2], CELL, rows, columns)
    return Scene(
        boxes=bodies,
        faces=(2 + np.arange(6 * len(boxes), dtype=np.int32)).reshape(-1, 6),
        surface_table=np.array(table, dtype=np.int32),
        surface_size=1.0 / np.array([(t.width, t.height) for t in tilings]),
        tiles=np.concatenate([t.tiles.ravel() for t in tilings]).astype(np.int32),
        texels=np.concatenate([packed(level).ravel() for level in levels]),
        level_start=np.cumsum([0, *(level.size // 3 for level in levels)])[:-1].astype(np.int64),
        side=textures.SIDE,
        glow=np.array(glow, dtype=np.float32),
        cell_start=cell_start,
        cell_boxes=cell_boxes,
        grid=grid,
        rows=rows,
        columns=columns,
        light=light_map(lights, ambient, bodies, height, grid[:2], size, LIGHT_STEP, unlit),
        light_step=LIGHT_STEP,
        contact=contact_map(bodies, grid[:2], size, CONTACT_STEP),
        contact_step=CONTACT_STEP,
        height=height,
        looks=numbers.reshape(len(looks), parts, 6),
    )


def packed(texels: Bytes) -> npt.NDArray[np.uint32]:
    """Blue-green-red texels (..., 3) as numbers (...,): blue in the lowest byte."""
    wide = texels.astype(np.uint32)
    return (wide @ np.array([1, 1 << 8, 1 << 16], dtype=np.uint32)).astype(np.uint32, copy=False)

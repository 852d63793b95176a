"""Light on a world's faces: lamps and windows with falloff, blocked by walls, as maps that the ray caster reads."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Floats

from .config import Day, Lamp, WallPanel, WorldConfig
from .streams import stream

LIGHT_RANGE_M = 12.0
"""Distance (m) beyond which a light adds nothing: what little would come from there is part of the ambient light."""
LIGHT_SIZE_M2 = 0.25
"""Square (m) of the extent of a light: close by it is no point."""
BOUNCE_SIGMA_M = 2.5
"""Standard deviation (m) of the spread of reflected light."""
CONTACT_SHADOW_M = 0.15
"""Distance (m) over which a body darkens the floor beside it."""
DAYLIGHT = (1.1, 1.0, 0.92)
"""Colour of the sky: blue, green, red."""
SKY_LIGHT_SPACING_M = 4.0
"""Distance (m) between the lamps that an open sky is made of."""
CURTAIN_TRANSMISSION = 0.06
"""Share of the light that passes a closed curtain."""
FACE_NORMALS = np.array([(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)], dtype=np.float64)
"""Normals of lit faces: up, +x, -x, +y, -y."""
FACE_HEIGHTS_M = np.array([0.0, 1.0, 1.0, 1.0, 1.0])
"""Height (m) at which the light on each is sampled."""


@dataclass(frozen=True)
class Light:
    """Something that shines: position (m), the way it faces, its colour (blue, green, red) and share of it that is on.

    A lamp's colour is (1, 1, 1) or about that. `scale` compares others with a lamp: a window counts by its area.
    """

    position: tuple[float, float, float]
    facing: tuple[float, float, float] = (0.0, 0.0, -1.0)
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    on: tuple[float, float, float] = (1.0, 1.0, 1.0)
    scale: float = 1.0


def lamps_and_windows(
    lamps: Sequence[Lamp], wall_panels: Sequence[WallPanel], config: WorldConfig, number: int
) -> list[Light]:
    """Lights of a world on day `number`: its lamps, then its windows; a closed curtain lets little light in."""
    day = config.day(number)
    lights = [
        Light(
            position=(*lamp.centre, config.height if lamp.z is None else lamp.z),
            colour=lamp.light,
            on=day.light if is_on else (0.0, 0.0, 0.0),
        )
        for lamp, is_on in zip(lamps, lamps_on(lamps, config, number), strict=True)
    ]
    for hanging in wall_panels:
        if hanging.material in ("window", "curtain"):
            share = 1.0 if hanging.material == "window" else CURTAIN_TRANSMISSION
            cos, sin = math.cos(hanging.facing), math.sin(hanging.facing)
            lights.append(
                Light(
                    position=(
                        hanging.centre[0] + 0.05 * cos,
                        hanging.centre[1] + 0.05 * sin,
                        hanging.bottom_z + hanging.height / 2,
                    ),
                    facing=(cos, sin, 0.0),
                    colour=DAYLIGHT,
                    on=(share * day.light[0], share * day.light[1], share * day.light[2]),
                    scale=0.5 * hanging.width * hanging.height,
                )
            )
    return [*lights, *_sky(config, day)]


def _sky(config: WorldConfig, day: Day) -> list[Light]:
    """The light of an open sky, as from many large lamps where no roof is."""
    if config.ceiling != "sky":
        return []
    across, along = (_sky_places(extent) for extent in config.size)
    roofs = [(*room.corner, *room.size) for room in config.rooms if room.walls]
    return [
        Light(position=(x, y, config.height), colour=DAYLIGHT, on=day.light, scale=0.25 * SKY_LIGHT_SPACING_M**2)
        for y in along
        for x in across
        if not any(left <= x <= left + wide and low <= y <= low + deep for left, low, wide, deep in roofs)
    ]


def _sky_places(extent: float) -> list[float]:
    """Places (m) of the sky's lamps along an axis: none beyond the outer wall, which would hide it."""
    number, step = math.ceil(extent / SKY_LIGHT_SPACING_M), SKY_LIGHT_SPACING_M
    step = extent / number if (number - 0.5) * step > extent else step
    return [(n + 0.5) * step for n in range(number)]


def lamps_on(lamps: Sequence[Lamp], config: WorldConfig, number: int) -> list[bool]:
    """Which lamps are on, on day `number`: those that its `lamps_off` neither names nor hits."""
    off = config.day(number).lamps_off
    if isinstance(off, tuple):
        return [lamp.name not in off for lamp in lamps]
    return [stream(config.draw_seed, "lamp", k, "day", number).uniform() >= off for k in range(len(lamps))]


def light_map(
    lights: Sequence[Light],
    ambient: float,
    boxes: Array,
    height: float,
    corner: Array,
    size: tuple[float, float],
    step: float,
    unlit: npt.ArrayLike = 1.0,
) -> Floats:
    """Irradiance (5, rows, columns, 3) of faces that look up, +x, -x, +y, -y, at points `step` m apart from `corner`.

    It falls with the square of the distance, and with the angles at the light and at the face. What is as high as the
    ceiling (`height`) casts shadows, so that a dark room stays dark. With everything on, the mean over the floor is 1;
    a share `ambient` of it comes from all around: what faces throw back, here and everywhere. Without lights it is
    `unlit` everywhere (blue, green, red).
    """
    columns, rows = (math.ceil((extent - 2 * c) / step) + 2 for extent, c in zip(size, corner, strict=True))
    x, y = corner[0] + step * np.arange(columns), corner[1] + step * np.arange(rows)
    table = np.array(
        [(*light.position, *light.facing, *(light.scale * np.array(light.colour)), *light.on) for light in lights]
    ).reshape(-1, 12)
    blocking = _blocking(boxes, corner, step, (rows, columns), height)
    lit, full = np.zeros((5, rows, columns, 3), dtype=np.float32), np.zeros((rows, columns), dtype=np.float32)
    _shine(table, blocking, x, y, FACE_HEIGHTS_M, FACE_NORMALS, lit, full)
    mean = float(full.mean(dtype=np.float64)) or 1.0
    lit *= (1.0 - ambient) / mean
    lit[1:] *= 1.6  # a wall also gets what floor and ceiling throw back
    if not lights:
        return lit + np.asarray(unlit, np.float32)
    around = np.maximum(cv2.GaussianBlur(full, (0, 0), BOUNCE_SIGMA_M / step), 1e-9)
    here = cv2.GaussianBlur(lit[0], (0, 0), BOUNCE_SIGMA_M / step) * (mean / (1.0 - ambient) if ambient < 1.0 else 0.0)
    everywhere = here.mean(axis=(0, 1), dtype=np.float64) / mean
    lit += (ambient * (0.75 * here / around[..., None] + 0.25 * everywhere)).astype(np.float32)
    return lit


def contact_map(boxes: Array, corner: Array, size: tuple[float, float], step: float) -> Floats:
    """Shares of light that bodies on the floor leave it (rows, columns): 0.6 beside them, 1 some way off."""
    columns, rows = (math.ceil((extent - 2 * c) / step) + 2 for extent, c in zip(size, corner, strict=True))
    distance = np.full((rows, columns), 1e3, dtype=np.float32)
    _near(boxes[boxes[:, 6] < 0.3], corner, step, 6.0 * CONTACT_SHADOW_M, distance)
    left: Floats = (1.0 - 0.4 * np.exp(-distance / CONTACT_SHADOW_M)).astype(np.float32)
    return left


def _blocking(boxes: Array, corner: Array, step: float, shape: tuple[int, int], height: float) -> Bools:
    """Points (rows, columns) inside a body that leaves no way for light under the ceiling.

    Those no further from it than half a step count as inside: no wall is too thin to be met.
    """
    tall = boxes[(boxes[:, 6] < 0.3) & (boxes[:, 7] > height - 0.3)]
    tall[:, 4:6] = np.maximum(tall[:, 4:6], 0.5 * step)
    distance = np.full(shape, 1e3, dtype=np.float32)
    _near(tall, corner, step, 0.0, distance)
    return distance <= np.float32(1e-9)


@compiled(error_model="numpy", parallel=True)
def _shine(
    lights: Array,
    blocking: Bools,
    x: Array,
    y: Array,
    heights: Array,
    faces: Array,
    lit: Floats,
    full: Floats,
) -> None:
    """Add each light's irradiance to `lit` (5, rows, columns, 3), and to `full` (rows, columns) as if all were on."""
    step = x[1] - x[0]
    for row in numba.prange(len(y)):
        for light in range(len(lights)):
            away_y = lights[light, 1] - y[row]
            if abs(away_y) > LIGHT_RANGE_M:
                continue
            half = math.sqrt(LIGHT_RANGE_M * LIGHT_RANGE_M - away_y * away_y)
            first = max(0, math.ceil((lights[light, 0] - half - x[0]) / step))
            last = min(len(x) - 1, math.floor((lights[light, 0] + half - x[0]) / step))
            for column in range(first, last + 1):
                away_x = lights[light, 0] - x[column]
                if not _sees(blocking, x[column], y[row], away_x, away_y, x[0], y[0], step):
                    continue
                edge = 1.0 - (away_x * away_x + away_y * away_y) / (LIGHT_RANGE_M * LIGHT_RANGE_M)
                for side in range(5):
                    rise = lights[light, 2] - heights[side]
                    square = away_x * away_x + away_y * away_y + rise * rise
                    square += LIGHT_SIZE_M2
                    arriving = away_x * faces[side, 0] + away_y * faces[side, 1] + rise * faces[side, 2]
                    leaving = -(away_x * lights[light, 3] + away_y * lights[light, 4] + rise * lights[light, 5])
                    if arriving <= 0.0 or leaving <= 0.0:
                        continue
                    fall = arriving * leaving / (square * square) * edge
                    for channel in range(3):
                        lit[side, row, column, channel] += (
                            fall * lights[light, 6 + channel] * lights[light, 9 + channel]
                        )
                    if side == 0:
                        full[row, column] += fall * (lights[light, 6] + lights[light, 7] + lights[light, 8]) / 3.0


@compiled(error_model="numpy")
def _sees(
    blocking: Bools,
    x: float,
    y: float,
    away_x: float,
    away_y: float,
    left: float,
    below: float,
    step: float,
) -> bool:
    """Tells whether nothing blocks the way from a point to a light; the ends of the way do not count."""
    length = math.hypot(away_x, away_y)
    count = int(length / step)
    for k in range(2, count - 1):
        part = k / count
        row = int((y + part * away_y - below) / step + 0.5)
        column = int((x + part * away_x - left) / step + 0.5)
        if blocking[row, column]:
            return False
    return True


@compiled()
def _near(boxes: Array, corner: Array, step: float, reach: float, distance: Floats) -> None:
    """Lower distances (rows, columns) to those of the boxes within `reach` m."""
    rows, columns = distance.shape
    for b in range(len(boxes)):
        cos, sin, length, depth = boxes[b, 2], boxes[b, 3], boxes[b, 4], boxes[b, 5]
        reach_x = abs(cos) * length + abs(sin) * depth + reach
        reach_y = abs(sin) * length + abs(cos) * depth + reach
        for row in range(max(0, math.floor((boxes[b, 1] - reach_y - corner[1]) / step)),
                         min(rows, math.ceil((boxes[b, 1] + reach_y - corner[1]) / step) + 1)):  # fmt: skip
            for column in range(max(0, math.floor((boxes[b, 0] - reach_x - corner[0]) / step)),
                                min(columns, math.ceil((boxes[b, 0] + reach_x - corner[0]) / step) + 1)):  # fmt: skip
                px = corner[0] + column * step - boxes[b, 0]
                py = corner[1] + row * step - boxes[b, 1]
                over = max(abs(cos * px + sin * py) - length, 0.0)
                beside = max(abs(cos * py - sin * px) - depth, 0.0)
                distance[row, column] = min(distance[row, column], math.sqrt(over * over + beside * beside))

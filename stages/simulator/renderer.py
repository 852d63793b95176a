"""The ray caster: boxes on a floor under a ceiling, seen along any set of rays.

Every body is an upright box, turned by any angle, that stands on the floor or hangs (walls, shelves, posters, lamps).
A ray walks a grid over the floor and tests the boxes of the cells it crosses, so that a picture costs what is seen,
not what the world holds; cells that it passes above are skipped. Each pixel is computed by one thread from its own
numbers alone, so that threads cannot change a picture.
"""

import math
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from .cameras import Rays

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U8 = npt.NDArray[np.uint8]

FACES = 6
"""Faces of a box, in its own frame: -x, +x, -y, +y, bottom, top."""


class Scene(NamedTuple):
    """A world as arrays for the ray caster. Floor and ceiling are surfaces 0 and 1.

    `boxes` (B, 9): centre x, y, cosine and sine of the yaw, half length, half depth, lower and upper z, squared radius.
    `faces` (B, 6): surface of each face. `surface_table` (S, 3): first entry in `tiles`, columns, rows; `surface_size`
    (S, 2): width and height (m) of a tile. `tiles`: texture of each tile, row by row from the upper left as seen from
    outside. `texels`: all mip levels of all textures, one after the other, each (textures, side, side, 3)
    blue-green-red; `level_start`: where each begins; `side`: of level 0. `glow` (textures,): share of the texture that
    shines by itself. `cell_start` and `cell_boxes`: boxes of each cell of the grid, `cell_top` the highest point in it;
    `grid`: x and y of its corner, size of a cell; `rows`, `columns`: how many. `light` (rows, columns, 5, 3):
    irradiance of faces that look up, +x, -x, +y, -y, at points `light_step` apart from the grid's corner. `height`: of
    the ceiling.
    """

    boxes: F64
    faces: I32
    surface_table: I32
    surface_size: F64
    tiles: I32
    texels: U8
    level_start: I64
    side: int
    glow: F32
    cell_start: I32
    cell_boxes: I32
    cell_top: F64
    grid: F64
    rows: int
    columns: int
    light: F32
    light_step: float
    height: float


def render(
    scene: Scene,
    rays: Rays,
    pose: npt.ArrayLike,
    eye_height: float,
    exposure: float = 1.0,
    noise: float = 0.0,
    key: int = 0,
) -> U8:
    """The picture (rows, columns, 3), uint8 blue-green-red, from a robot's pose (x, y, heading).

    `eye_height` (m): of the camera above the floor. `noise`: standard deviation (grey levels), drawn per pixel and
    colour from `key` alone. Pixels without a ray are black, with noise.
    """
    x, y, heading = (float(v) for v in np.asarray(pose, dtype=np.float64))
    picture = np.zeros((*rays.shape, 3), dtype=np.uint8)
    lit = np.zeros((len(rays.pixels), 3), dtype=np.float32)
    _trace(scene, rays.directions, rays.footprint, x, y, math.cos(heading), math.sin(heading), float(eye_height), lit)
    _expose(lit, rays.pixels, rays.gain, float(exposure), float(noise), np.uint64(key), picture.reshape(-1, 3))
    return picture


@numba.njit(cache=True, error_model="numpy", parallel=True)
def _trace(
    scene: Scene,
    directions: F32,
    footprint: F32,
    x: float,
    y: float,
    cos: float,
    sin: float,
    z: float,
    lit: F32,
) -> None:
    """Colours (N, 3) of rays (N, 3), 0 to 255, before the chip."""
    # Taken out of the scene once: each mention of an array in a tuple counts references, which costs more than a test.
    boxes, faces, tiles, texels, level_start = scene.boxes, scene.faces, scene.tiles, scene.texels, scene.level_start
    table, size, glow, light, grid = scene.surface_table, scene.surface_size, scene.glow, scene.light, scene.grid
    start, members, top = scene.cell_start, scene.cell_boxes, scene.cell_top
    rows, columns, ceiling, side, step = scene.rows, scene.columns, scene.height, scene.side, scene.light_step
    for i in numba.prange(len(directions)):
        forward, left, up = float(directions[i, 0]), float(directions[i, 1]), float(directions[i, 2])
        dx, dy = cos * forward - sin * left, sin * forward + cos * left
        distance, box, face = _hit(boxes, start, members, top, grid, rows, columns, ceiling, x, y, z, dx, dy, up)
        angle = float(footprint[i])
        blue, green, red = _shade(
            boxes, faces, table, size, tiles, texels, level_start, side, glow, light, step, grid,
            x, y, z, dx, dy, up, distance, box, face, angle,
        )  # fmt: skip
        lit[i, 0] = blue
        lit[i, 1] = green
        lit[i, 2] = red


@numba.njit(cache=True, error_model="numpy")
def _hit(
    boxes: F64,
    cell_start: I32,
    cell_boxes: I32,
    cell_top: F64,
    grid: F64,
    rows: int,
    columns: int,
    ceiling: float,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
) -> tuple[float, int, int]:
    """Distance, box and face of what a ray meets first; box -1 is the floor (face 5) or the ceiling (face 4)."""
    far = 1e9
    face = 5
    if dz < 0.0:
        far = -z / dz
    elif dz > 0.0:
        far = (ceiling - z) / dz
        face = 4
    box = -1
    left, below, size = grid[0], grid[1], grid[2]
    column = math.floor((x - left) / size)
    row = math.floor((y - below) / size)
    step_x = 1 if dx > 0.0 else -1
    step_y = 1 if dy > 0.0 else -1
    per_x = abs(size / dx) if dx != 0.0 else 1e18
    per_y = abs(size / dy) if dy != 0.0 else 1e18
    next_x = (left + (column + (step_x > 0)) * size - x) / dx if dx != 0.0 else 1e18
    next_y = (below + (row + (step_y > 0)) * size - y) / dy if dy != 0.0 else 1e18
    entered = 0.0
    tested = -1
    while 0 <= column < columns and 0 <= row < rows:
        leaves = min(next_x, next_y)
        cell = row * columns + column
        lowest = z + dz * (min(leaves, far) if dz < 0.0 else entered)
        if lowest <= cell_top[cell]:
            for k in range(cell_start[cell], cell_start[cell + 1]):
                candidate = cell_boxes[k]
                if candidate == tested:
                    continue
                tested = candidate
                t, side = _meet(boxes, candidate, x, y, z, dx, dy, dz)
                if t < far:
                    far = t
                    box = candidate
                    face = side
        if far <= leaves:
            break
        entered = leaves
        if next_x < next_y:
            column += step_x
            next_x += per_x
        else:
            row += step_y
            next_y += per_y
    return far, box, face


@numba.njit(cache=True, error_model="numpy")
def _meet(boxes: F64, box: int, x: float, y: float, z: float, dx: float, dy: float, dz: float) -> tuple[float, int]:
    """Distance along a ray to a box and the face it enters by; 1e18 where it misses it or starts inside."""
    px, py = x - boxes[box, 0], y - boxes[box, 1]
    beside = px * dy - py * dx
    if beside * beside > boxes[box, 8] * (dx * dx + dy * dy):
        return 1e18, 0
    cos, sin = boxes[box, 2], boxes[box, 3]
    ox, oy = cos * px + sin * py, cos * py - sin * px
    ux, uy = cos * dx + sin * dy, cos * dy - sin * dx
    near, leave = -1e18, 1e18
    face = 0
    if ux != 0.0:
        per = 1.0 / ux
        near, leave = (-boxes[box, 4] - ox) * per, (boxes[box, 4] - ox) * per
        if near > leave:
            near, leave = leave, near
            face = 1
    elif abs(ox) > boxes[box, 4]:
        return 1e18, 0
    if uy != 0.0:
        per = 1.0 / uy
        first, last = (-boxes[box, 5] - oy) * per, (boxes[box, 5] - oy) * per
        side = 2
        if first > last:
            first, last = last, first
            side = 3
        if first > near:
            near = first
            face = side
        leave = min(leave, last)
    elif abs(oy) > boxes[box, 5]:
        return 1e18, 0
    if near > leave:
        return 1e18, 0
    if dz != 0.0:
        per = 1.0 / dz
        first, last = (boxes[box, 6] - z) * per, (boxes[box, 7] - z) * per
        side = 4
        if first > last:
            first, last = last, first
            side = 5
        if first > near:
            near = first
            face = side
        leave = min(leave, last)
    elif z < boxes[box, 6] or z > boxes[box, 7]:
        return 1e18, 0
    if near > leave or near <= 0.0:
        return 1e18, 0
    return near, face


@numba.njit(cache=True, error_model="numpy")
def _shade(
    boxes: F64,
    faces: I32,
    surface_table: I32,
    surface_size: F64,
    tiles: I32,
    texels: U8,
    level_start: I64,
    finest: int,
    glows: F32,
    light: F32,
    light_step: float,
    grid: F64,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    distance: float,
    box: int,
    face: int,
    footprint: float,
) -> tuple[float, float, float]:
    """Colour of the point a ray meets: texture at the level its size asks for, times the light that falls on it."""
    if distance >= 1e8:
        return 0.0, 0.0, 0.0
    corner_x, corner_y = grid[0], grid[1]
    hx, hy, hz = x + distance * dx, y + distance * dy, z + distance * dz
    nx, ny = 0.0, 0.0
    if box < 0:
        surface = 0 if face == 5 else 1
        u, v = hx, hy
        slope = abs(dz)
    else:
        px, py = hx - boxes[box, 0], hy - boxes[box, 1]
        lx, ly = boxes[box, 2] * px + boxes[box, 3] * py, boxes[box, 2] * py - boxes[box, 3] * px
        surface = faces[box, face]
        v = boxes[box, 7] - hz
        if face == 0:
            u = boxes[box, 5] - ly
            nx, ny = -boxes[box, 2], -boxes[box, 3]
        elif face == 1:
            u = boxes[box, 5] + ly
            nx, ny = boxes[box, 2], boxes[box, 3]
        elif face == 2:
            u = boxes[box, 4] + lx
            nx, ny = boxes[box, 3], -boxes[box, 2]
        elif face == 3:
            u = boxes[box, 4] - lx
            nx, ny = -boxes[box, 3], boxes[box, 2]
        else:
            u, v = boxes[box, 4] + lx, boxes[box, 5] - ly
        slope = abs(dz) if face >= 4 else abs(dx * nx + dy * ny)

    width, height = surface_size[surface, 0], surface_size[surface, 1]
    columns, rows = surface_table[surface, 1], surface_table[surface, 2]
    column = min(max(math.floor(u / width), 0), columns - 1)
    row = min(max(math.floor(v / height), 0), rows - 1)
    texture = tiles[surface_table[surface, 0] + row * columns + column]
    u, v = u / width - column, v / height - row
    # The footprint is an ellipse, longer by 1 / slope: its mean radius is a fair middle between blur and flicker.
    across = distance * footprint * finest / math.sqrt(width * height * max(slope, 1e-3))
    level = min(max(math.log2(max(across, 1e-6)), 0.0), len(level_start) - 1.001)
    fine = int(level)
    part = level - fine
    blue, green, red = _texel(texels, level_start, finest, texture, fine, u, v)
    if part > 0.0:
        blue1, green1, red1 = _texel(texels, level_start, finest, texture, fine + 1, u, v)
        blue += part * (blue1 - blue)
        green += part * (green1 - green)
        red += part * (red1 - red)

    glow = float(glows[texture])
    if glow >= 1.0:
        return blue, green, red
    if face >= 4:
        blue_light, green_light, red_light = _light(
            light, (hx - corner_x) / light_step, (hy - corner_y) / light_step, 0
        )
        if face == 4:  # what looks down is lit by what the floor throws back
            blue_light, green_light, red_light = 0.8 * blue_light, 0.8 * green_light, 0.8 * red_light
    else:
        blue_x, green_x, red_x = _light(
            light, (hx - corner_x) / light_step, (hy - corner_y) / light_step, 1 if nx > 0.0 else 2
        )
        share = nx * nx
        blue_light, green_light, red_light = share * blue_x, share * green_x, share * red_x
        if share < 0.999999:
            blue_y, green_y, red_y = _light(
                light, (hx - corner_x) / light_step, (hy - corner_y) / light_step, 3 if ny > 0.0 else 4
            )
            blue_light += (1.0 - share) * blue_y
            green_light += (1.0 - share) * green_y
            red_light += (1.0 - share) * red_y
        dim = 0.75 + 0.25 * min(hz / 1.2, 1.0)  # less light reaches the foot of a face
        blue_light, green_light, red_light = dim * blue_light, dim * green_light, dim * red_light
    return (
        blue * (glow + (1.0 - glow) * blue_light),
        green * (glow + (1.0 - glow) * green_light),
        red * (glow + (1.0 - glow) * red_light),
    )


@numba.njit(cache=True, error_model="numpy")
def _texel(
    texels: U8, level_start: I64, finest: int, texture: int, level: int, u: float, v: float
) -> tuple[float, float, float]:
    """Colour of a texture at (u, v) in [0, 1], linear between the texels of one level."""
    side = finest >> level
    column, row = u * side - 0.5, v * side - 0.5
    left, above = math.floor(column), math.floor(row)
    wu, wv = column - left, row - above
    right, below = min(left + 1, side - 1), min(above + 1, side - 1)
    left, above = max(left, 0), max(above, 0)
    start = level_start[level] + texture * side * side * 3
    a, b = start + (above * side + left) * 3, start + (above * side + right) * 3
    c, d = start + (below * side + left) * 3, start + (below * side + right) * 3
    wa, wb, wc, wd = (1 - wu) * (1 - wv), wu * (1 - wv), (1 - wu) * wv, wu * wv
    return (
        wa * texels[a] + wb * texels[b] + wc * texels[c] + wd * texels[d],
        wa * texels[a + 1] + wb * texels[b + 1] + wc * texels[c + 1] + wd * texels[d + 1],
        wa * texels[a + 2] + wb * texels[b + 2] + wc * texels[c + 2] + wd * texels[d + 2],
    )


@numba.njit(cache=True, error_model="numpy")
def _light(light: F32, column: float, row: float, side: int) -> tuple[float, float, float]:
    """Light that falls at a point of the light map on a face that looks one of five ways, linear between samples."""
    column = min(max(column, 0.0), light.shape[1] - 1.001)
    row = min(max(row, 0.0), light.shape[0] - 1.001)
    left, below = int(column), int(row)
    wx, wy = column - left, row - below
    wa, wb, wc, wd = (1 - wx) * (1 - wy), wx * (1 - wy), (1 - wx) * wy, wx * wy
    above, right = below + 1, left + 1
    return (
        wa * light[below, left, side, 0]
        + wb * light[below, right, side, 0]
        + wc * light[above, left, side, 0]
        + wd * light[above, right, side, 0],
        wa * light[below, left, side, 1]
        + wb * light[below, right, side, 1]
        + wc * light[above, left, side, 1]
        + wd * light[above, right, side, 1],
        wa * light[below, left, side, 2]
        + wb * light[below, right, side, 2]
        + wc * light[above, left, side, 2]
        + wd * light[above, right, side, 2],
    )


@numba.njit(cache=True, error_model="numpy")
def _mix(number: np.uint64) -> np.uint64:
    """The next number of a counter-based sequence: splitmix64's finaliser (Steele, Lea & Flood 2014)."""
    number = (number ^ (number >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    number = (number ^ (number >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return number ^ (number >> np.uint64(31))


@numba.njit(cache=True, error_model="numpy", parallel=True)
def _expose(lit: F32, pixels: I32, gain: F32, exposure: float, noise: float, key: np.uint64, picture: U8) -> None:
    """The chip: light times exposure and vignetting, plus noise that follows from key, pixel and colour alone."""
    ray_of = np.full(len(picture), -1, dtype=np.int32)
    for i in numba.prange(len(pixels)):
        ray_of[pixels[i]] = i
    start = _mix(key)
    for p in numba.prange(len(picture)):
        i = ray_of[p]
        for channel in range(3):
            level = 0.0
            if i >= 0:
                level = float(lit[i, channel]) * gain[i] * exposure
            if noise > 0.0:
                drawn = _mix(start + np.uint64(p * 3 + channel) * np.uint64(0x9E3779B97F4A7C15))
                # The sum of four uniform 16-bit numbers is near enough to a Gaussian: standard deviation sqrt(4 / 12).
                total = (
                    float(drawn & np.uint64(0xFFFF))
                    + float((drawn >> np.uint64(16)) & np.uint64(0xFFFF))
                    + float((drawn >> np.uint64(32)) & np.uint64(0xFFFF))
                    + float(drawn >> np.uint64(48))
                )
                level += noise * (total / 65535.0 - 2.0) * 1.7320508075688772
            picture[p, channel] = np.uint8(min(max(level + 0.5, 0.0), 255.0))

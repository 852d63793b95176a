"""The renderer: a ray caster for boxes on a floor under a ceiling, for any set of rays.

Every body is an upright box, turned by any angle, that is on the floor or hangs (walls, shelves, posters, people).
Rays come in wedges of like azimuth. For a wedge, the cells of a grid over the floor are walked outwards once, and the
boxes in them are found, nearest first, until what was met hides the rest up to the ceiling; then each ray is tested
against these few. So an image costs what is seen, not what the world holds. Each pixel is computed by one thread
from its own numbers alone, so that threads cannot change an image.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bytes, Floats, Ints, Shorts

from .cameras import Rays
from .people import Person, figures

Texels = npt.NDArray[np.uint32]

FACES = 6
"""Faces of a box, in its own frame: -x, +x, -y, +y, bottom, top."""
CHUNKS = 32
"""Portions of an image that threads take in turn; each has its own list of candidates."""
FAST_MATH = {"contract", "arcp", "reassoc", "nsz"}
"""Floating-point optimisations; the image does not depend on the number of threads."""
MAX_OCCLUDERS = 24
"""Maximum number of bodies that are kept as occluders."""


class Bodies(NamedTuple):
    """Boxes (B, 9): centre x, y, cosine, sine of the yaw, half length, half depth, lower, upper z, squared radius.

    `faces` (B, 6): the surface of each face.
    """

    boxes: Array
    faces: Shorts


class Scene(NamedTuple):
    """A world as arrays for the ray caster. Floor and ceiling are surfaces 0 and 1.

    `boxes` and `faces` as in `Bodies`. `surface_table` (S, 3): first entry in `tiles`, columns, rows; `surface_size`
    (S, 2): width and height (m) of a tile. `tiles`: texture of each tile, row by row from the upper left as seen from
    outside. `texels`: all mip levels of all textures, one after the other, each (textures, side, side), blue in
    the lowest byte, then green, red; `level_start`: where each begins; `side`: of level 0. `glow` (textures,): share of
    the texture that shines by itself. `cell_start` and `cell_boxes`: boxes of each cell; `grid`: x and y of its
    corner, size of a cell; `rows`, `columns`: how many. `light` (5, rows, columns, 3): irradiance of faces that look
    up, +x, -x, +y, -y, at points `light_step` apart from the grid's corner; `contact` (rows, columns): what is left of
    it on the floor beside bodies, at points `contact_step` apart. `height`: of the ceiling. `looks` (looks, parts, 6):
    the surfaces of people, by look and part of the body.
    """

    boxes: Array
    faces: Shorts
    surface_table: Shorts
    surface_size: Array
    tiles: Shorts
    texels: Texels
    level_start: Ints
    side: int
    glow: Floats
    cell_start: Shorts
    cell_boxes: Shorts
    grid: Array
    rows: int
    columns: int
    light: Floats
    light_step: float
    contact: Floats
    contact_step: float
    height: float
    looks: Shorts


def render(
    scene: Scene,
    rays: Rays,
    pose: npt.ArrayLike,
    eye_height: float,
    exposure: float = 1.0,
    noise: float = 0.0,
    key: int = 0,
    people: Sequence[Person] = (),
) -> Bytes:
    """The image (rows, columns, 3), uint8 blue-green-red, from a robot's pose (x, y, heading).

    Several poses (N, 3) over the time the shutter is open give their mean: motion blur. `eye_height` (m): of the
    camera above the floor. `noise`: standard deviation (grey levels), drawn per pixel and colour from `key` alone.
    Pixels without a ray are black, with noise.
    """
    moving = Bodies(*figures(people, scene.looks))
    poses = np.asarray(pose, dtype=np.float64).reshape(-1, 3)
    lit = np.zeros((len(rays.gain), 3), dtype=np.float32)
    if len(rays.own):
        lit[len(rays.pixels) :] = rays.own * _light_on_deck(scene, float(poses[0, 0]), float(poses[0, 1]))
    for x, y, heading in poses.tolist():
        _trace(scene, moving, rays, x, y, heading, float(eye_height), 1.0 / len(poses), lit)
    image = np.zeros((rays.rows, rays.columns, 3), dtype=np.uint8)
    _expose(lit, rays.ray_of, rays.gain, float(exposure), float(noise), np.uint64(key), QUANTILES,
            image.reshape(-1, 3))  # fmt: skip
    return image


def _light_on_deck(scene: Scene, x: float, y: float) -> Floats:
    """Light (3,) that falls on the robot at a point of the map."""
    column, row = (round((at - corner) / scene.light_step) for at, corner in zip((x, y), scene.grid, strict=False))
    _, rows, columns, _ = scene.light.shape
    here: Floats = scene.light[0, min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)]
    return here


@compiled(error_model="numpy", fastmath=FAST_MATH, parallel=True)
def _trace(
    scene: Scene,
    moving: Bodies,
    rays: Rays,
    x: float,
    y: float,
    heading: float,
    z: float,
    weight: float,
    lit: Floats,
) -> None:
    """Add colours (N, 3) of rays (N, 3), 0 to 255 times `weight`, before the chip."""
    chunks = min(CHUNKS, len(rays.wedges))
    bearings = _bearings(moving.boxes, x, y)
    for chunk in numba.prange(chunks):
        _chunk(scene, moving, bearings, rays, x, y, heading, z, weight, lit, chunk, chunks)


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _bearings(boxes: Array, x: float, y: float) -> Array:
    """Directions of boxes from a point (B, 3): azimuth on the map, half the angle they take at most, distance."""
    seen = np.empty((len(boxes), 3))
    for b in range(len(boxes)):
        px, py = boxes[b, 0] - x, boxes[b, 1] - y
        away, radius = math.sqrt(px * px + py * py), math.sqrt(boxes[b, 8])
        seen[b, 0] = math.atan2(py, px)
        seen[b, 1] = math.asin(radius / away) if away > radius else math.pi
        seen[b, 2] = away - radius
    return seen


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _chunk(
    scene: Scene,
    moving: Bodies,
    bearings: Array,
    rays: Rays,
    x: float,
    y: float,
    heading: float,
    z: float,
    weight: float,
    lit: Floats,
    chunk: int,
    chunks: int,
) -> None:
    """The wedges of one portion: every `chunks`-th, so that all portions cost about the same."""
    # Taken out of the tuples once: each mention of an array in a tuple counts references, which costs more than a test.
    boxes, faces, tiles, texels, level_start = scene.boxes, scene.faces, scene.tiles, scene.texels, scene.level_start
    table, size, glow, grid = scene.surface_table, scene.surface_size, scene.glow, scene.grid
    directions, footprint, wedge_start, wedges = rays.directions, rays.footprint, rays.wedge_start, rays.wedges
    light, contact, moved, moved_faces = scene.light, scene.contact, moving.boxes, moving.faces
    start, members = scene.cell_start, scene.cell_boxes
    rows, columns, ceiling, side = scene.rows, scene.columns, scene.height, scene.side
    light_step, contact_step = scene.light_step, scene.contact_step
    levels = len(level_start)
    turn_cos, turn_sin = math.cos(heading), math.sin(heading)
    seen_in = np.zeros(len(boxes), dtype=np.int32)
    found_box = np.empty(len(boxes) + len(moved), dtype=np.int32)
    found = np.empty((len(boxes) + len(moved), 14))
    occluders = np.empty((MAX_OCCLUDERS, 2))
    for wedge in range(chunk, len(wedges), chunks):
        low, high = wedges[wedge, 0] + heading, wedges[wedge, 1] + heading
        count, reach, along_x = _boxes_in_wedge(
            boxes, start, members, grid, rows, columns, ceiling, x, y, z, turn_cos, turn_sin, low, high,
            wedges[wedge, 2], seen_in, wedge + 1, found_box, found, occluders,
        )  # fmt: skip
        fixed = count
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        for body in range(len(moved)):
            off = middle - bearings[body, 0]
            off -= 2.0 * math.pi * round(off / (2.0 * math.pi))
            if abs(off) <= half + bearings[body, 1] and bearings[body, 2] <= 1.415 * reach:
                _store_box(found, count, moved, body, x, y, z, turn_cos, turn_sin, 0.0)
                found_box[count] = len(boxes) + body
                count += 1
        level_x, level_y = math.cos(middle - heading), math.sin(middle - heading)
        # The axis along which the look measured distances, as the robot sees it.
        sign = 1.0 if (math.cos(middle) if along_x else math.sin(middle)) > 0.0 else -1.0
        major_x, major_y = (sign * turn_cos, -sign * turn_sin) if along_x else (sign * turn_sin, sign * turn_cos)
        major = level_x * major_x + level_y * major_y
        # In a strip, all rays of a wedge are one ray seen from above.
        column = high - low < 1e-4
        if column:
            for k in range(count):
                enter, leave, face = _enter(
                    found[k, 0], found[k, 1], found[k, 2] * level_x + found[k, 3] * level_y,
                    found[k, 2] * level_y - found[k, 3] * level_x, found[k, 4], found[k, 5],
                )  # fmt: skip
                found[k, 11], found[k, 12], found[k, 13] = enter, leave, face
        for i in range(wedge_start[wedge], wedge_start[wedge + 1]):
            dx, dy, dz = float(directions[i, 0]), float(directions[i, 1]), float(directions[i, 2])
            # In a column, distances are those over the floor.
            along = max(dx * level_x + dy * level_y, 1e-9) if column else 1.0
            ahead = major if column else dx * major_x + dy * major_y
            distance, which, face = _first_hit(found, fixed, count, dx, dy, dz / along, ahead, z, ceiling, column)
            distance /= along
            if distance >= 1e8:
                continue
            # Where it is, which way its face looks, and where on its surface.
            hx = x + distance * (turn_cos * dx - turn_sin * dy)
            hy = y + distance * (turn_sin * dx + turn_cos * dy)
            hz = z + distance * dz
            nx, ny = 0.0, 0.0
            if which < 0:
                surface = 0 if face == 5 else 1
                u, v = hx, hy
                slope = abs(dz)
            else:
                ux = found[which, 2] * dx + found[which, 3] * dy
                uy = found[which, 2] * dy - found[which, 3] * dx
                lx, ly = found[which, 0] + distance * ux, found[which, 1] + distance * uy
                number = found_box[which]
                surface = faces[number, face] if number < len(boxes) else moved_faces[number - len(boxes), face]
                v = found[which, 7] - distance * dz
                if face < 2:
                    sign = 2.0 * face - 1.0
                    u = found[which, 5] + sign * ly
                    nx, ny = sign * found[which, 9], sign * found[which, 10]
                    slope = abs(ux)
                elif face < 4:
                    sign = 2.0 * face - 5.0
                    u = found[which, 4] - sign * lx
                    nx, ny = -sign * found[which, 10], sign * found[which, 9]
                    slope = abs(uy)
                else:
                    u, v = found[which, 4] + lx, found[which, 5] - ly
                    slope = abs(dz)

            # The texture, at the level its size in the image asks for.
            per_width, per_height = size[surface, 0], size[surface, 1]
            u, v = u * per_width, v * per_height
            across = min(max(math.floor(u), 0), table[surface, 1] - 1)
            down = min(max(math.floor(v), 0), table[surface, 2] - 1)
            texture = tiles[table[surface, 0] + down * table[surface, 1] + across]
            u, v = u - across, v - down
            # The footprint is an ellipse, longer by 1 / slope: its mean radius is a fair middle of blur and flicker.
            reach = distance * float(footprint[i]) * side
            level = _half_log2(reach * reach * per_width * per_height / max(slope, 1e-3))
            blue, green, red = _sample(texels, level_start, levels, side, texture, level, u, v)

            shines = float(glow[texture])
            if shines < 1.0:
                lx, ly = (hx - grid[0]) / light_step, (hy - grid[1]) / light_step
                if face >= 4:
                    blue_light, green_light, red_light = _light(light, 0, lx, ly)
                    dim = 0.8  # what looks down is lit by what the floor throws back
                    if which < 0 and face == 5:
                        dim = _contact(contact, (hx - grid[0]) / contact_step, (hy - grid[1]) / contact_step)
                    elif face == 5:
                        dim = 1.0
                else:
                    share = nx * nx
                    if share > 0.5:
                        blue_light, green_light, red_light = _light(light, 1 if nx > 0.0 else 2, lx, ly)
                    else:
                        blue_light, green_light, red_light = _light(light, 3 if ny > 0.0 else 4, lx, ly)
                    if 0.000001 < share < 0.999999:
                        if share > 0.5:
                            blue1, green1, red1 = _light(light, 3 if ny > 0.0 else 4, lx, ly)
                            part = 1.0 - share
                        else:
                            blue1, green1, red1 = _light(light, 1 if nx > 0.0 else 2, lx, ly)
                            part = share
                        blue_light += part * (blue1 - blue_light)
                        green_light += part * (green1 - green_light)
                        red_light += part * (red1 - red_light)
                    dim = 0.75 + 0.25 * min(hz / 1.2, 1.0)  # less light reaches the foot of a face
                dim *= 1.0 - shines
                blue *= shines + dim * blue_light
                green *= shines + dim * green_light
                red *= shines + dim * red_light
            lit[i, 0] += weight * blue
            lit[i, 1] += weight * green
            lit[i, 2] += weight * red


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _boxes_in_wedge(
    boxes: Array,
    cell_start: Shorts,
    cell_boxes: Shorts,
    grid: Array,
    rows: int,
    columns: int,
    ceiling: float,
    x: float,
    y: float,
    z: float,
    turn_cos: float,
    turn_sin: float,
    low: float,
    high: float,
    steepest: float,
    seen_in: Shorts,
    mark: int,
    found_box: Shorts,
    found: Array,
    occluders: Array,
) -> tuple[int, float, bool]:
    """Note the boxes that rays between two azimuths of the map may meet, nearest first.

    Distances are measured along the axis of the map that the wedge is nearest to, and slopes are heights per such
    distance: along that axis every slab of cells is crossed by all rays of the wedge at once. A body that both edges
    meet is met by all rays between, being convex; once the walk is past it, it hides what is lower than the line over
    its top. When that line reaches the ceiling, nothing more can be seen.
    Returns how many were found, how far it went, and whether along x.
    """
    cos_a, sin_a, cos_b, sin_b = math.cos(low), math.sin(low), math.cos(high), math.sin(high)
    along_x = abs(cos_a + cos_b) >= abs(sin_a + sin_b)
    if along_x:
        sign = 1 if cos_a + cos_b > 0.0 else -1
        tan_a, tan_b = sin_a / abs(cos_a), sin_b / abs(cos_b)
        start, across, corner, corner_across = x, y, grid[0], grid[1]
        slabs, lanes = columns, rows
    else:
        sign = 1 if sin_a + sin_b > 0.0 else -1
        tan_a, tan_b = cos_a / abs(sin_a), cos_b / abs(sin_b)
        start, across, corner, corner_across = y, x, grid[1], grid[0]
        slabs, lanes = rows, columns
    least, most = min(tan_a, tan_b), max(tan_a, tan_b)
    size = grid[2]
    slab = math.floor((start - corner) / size)
    near = 0.0
    far = (corner + (slab + (1 if sign > 0 else 0)) * size - start) * sign
    top = steepest * 1.415 if steepest > 0.0 else steepest
    limit = 1e18 if top >= 0.0 else -z / top
    covered = -1e18
    waiting = 0
    count = 0
    while 0 <= slab < slabs and near < limit:
        kept = 0
        risen = False
        for k in range(waiting):
            if occluders[k, 0] <= near:
                if occluders[k, 1] > covered:
                    covered = occluders[k, 1]
                    risen = True
            else:
                occluders[kept, 0], occluders[kept, 1] = occluders[k, 0], occluders[k, 1]
                kept += 1
        waiting = kept
        if risen:
            if covered >= top:
                limit = near
                break
            if covered > 0.0:
                limit = min(limit, (ceiling - z) / covered)
                if near >= limit:
                    break
        first = math.floor((across + least * (near if least >= 0.0 else far) - corner_across) / size - 1e-9)
        last = math.floor((across + most * (far if most >= 0.0 else near) - corner_across) / size + 1e-9)
        if last < 0 or first >= lanes:
            break
        for lane in range(max(first, 0), min(last, lanes - 1) + 1):
            cell = lane * columns + slab if along_x else slab * columns + lane
            for k in range(cell_start[cell], cell_start[cell + 1]):
                box = cell_boxes[k]
                if seen_in[box] == mark:
                    continue
                seen_in[box] = mark
                over = boxes[box, 7] - z
                if near > 0.0 and (over / near if over > 0.0 else 0.0) <= covered:
                    continue
                px, py = x - boxes[box, 0], y - boxes[box, 1]
                if along_x:
                    ahead, aside = -sign * px, -py
                else:
                    ahead, aside = -sign * py, -px
                # Beside the wedge altogether?
                square = boxes[box, 8]
                off = aside - least * ahead
                if off < 0.0 and off * off > square * (1.0 + least * least):
                    continue
                off = aside - most * ahead
                if off > 0.0 and off * off > square * (1.0 + most * most):
                    continue
                _store_box(found, count, boxes, box, x, y, z, turn_cos, turn_sin, near)
                found_box[count] = box
                count += 1
                if waiting == MAX_OCCLUDERS:
                    continue
                if along_x:
                    ax, ay, bx, by = float(sign), tan_a, float(sign), tan_b
                else:
                    ax, ay, bx, by = tan_a, float(sign), tan_b, float(sign)
                cos, sin, ox, oy = boxes[box, 2], boxes[box, 3], found[count - 1, 0], found[count - 1, 1]
                enter_a = _enter(ox, oy, cos * ax + sin * ay, cos * ay - sin * ax, boxes[box, 4], boxes[box, 5])[0]
                if enter_a >= 1e17 or enter_a <= 0.0:
                    continue
                enter_b = _enter(ox, oy, cos * bx + sin * by, cos * by - sin * bx, boxes[box, 4], boxes[box, 5])[0]
                if enter_b >= 1e17 or enter_b <= 0.0:
                    continue
                behind = max(enter_a, enter_b)
                under = boxes[box, 6]
                if under > 0.0:
                    under -= z
                    if near <= 0.0 or (under / behind if under < 0.0 else under / near) > covered:
                        continue  # one may look under it
                hides = over / behind if over > 0.0 else over / max(near, 1e-3)
                if hides > covered:
                    occluders[waiting, 0], occluders[waiting, 1] = behind, hides
                    waiting += 1
        slab += sign
        near = far
        far += size
    return count, near, along_x


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _store_box(
    found: Array,
    number: int,
    boxes: Array,
    box: int,
    x: float,
    y: float,
    z: float,
    turn_cos: float,
    turn_sin: float,
    near: float,
) -> None:
    """Write down a box as rays from the eye meet it.

    The eye in the box's frame; cosine and sine of its yaw against the robot's; half sizes; lower and upper edge against
    the eye; where the slab begins in which it was found; cosine and sine of its yaw on the map. Three places are free.
    """
    px, py = x - boxes[box, 0], y - boxes[box, 1]
    cos, sin = boxes[box, 2], boxes[box, 3]
    found[number, 0], found[number, 1] = cos * px + sin * py, cos * py - sin * px
    found[number, 2], found[number, 3] = cos * turn_cos + sin * turn_sin, sin * turn_cos - cos * turn_sin
    found[number, 4], found[number, 5] = boxes[box, 4], boxes[box, 5]
    found[number, 6], found[number, 7] = boxes[box, 6] - z, boxes[box, 7] - z
    found[number, 8] = near
    found[number, 9], found[number, 10] = cos, sin


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _first_hit(
    found: Array,
    fixed: int,
    count: int,
    dx: float,
    dy: float,
    dz: float,
    ahead: float,
    z: float,
    ceiling: float,
    column: bool,
) -> tuple[float, int, int]:
    """Distance, note and face of what a ray meets first; note -1 is the floor (face 5) or the ceiling (face 4).

    Of a wedge of one azimuth (`column`) the found tell how far off boxes begin and end, over the floor.
    """
    distance, which, face = 1e9, -1, 5
    if dz < 0.0:
        distance = -z / dz
    elif dz > 0.0:
        distance = (ceiling - z) / dz
        face = 4
    for k in range(count):
        if distance * ahead <= found[k, 8] and k < fixed:
            continue  # found beyond what was met already
        if column:
            enter, leave, side = found[k, 11], found[k, 12], int(found[k, 13])
        else:
            enter, leave, side = _enter(
                found[k, 0], found[k, 1], found[k, 2] * dx + found[k, 3] * dy, found[k, 2] * dy - found[k, 3] * dx,
                found[k, 4], found[k, 5],
            )  # fmt: skip
        if enter >= distance or leave <= 0.0:
            continue
        below, above = found[k, 6], found[k, 7]
        if enter < 0.0:
            enter = 0.0
            if below <= 0.0 <= above:
                continue  # the eye is inside
        rise = enter * dz
        if rise > above:
            if dz < 0.0 and above / dz <= leave and above / dz < distance:
                distance, which, face = above / dz, k, 5
        elif rise < below:
            if dz > 0.0 and below / dz <= leave and below / dz < distance:
                distance, which, face = below / dz, k, 4
        else:
            distance, which, face = enter, k, side
    return distance, which, face


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _enter(ox: float, oy: float, ux: float, uy: float, length: float, depth: float) -> tuple[float, float, int]:
    """Entry and exit of a level ray from (ox, oy) along (ux, uy) in a rectangle, and the side; 1e18 if it misses."""
    if ux == 0.0:
        if abs(ox) > length:
            return 1e18, -1e18, 0
        enter, leave = -1e18, 1e18
    else:
        per = 1.0 / ux
        middle, half = -ox * per, abs(length * per)
        enter, leave = middle - half, middle + half
    side = 0 if ux > 0.0 else 1
    if uy == 0.0:
        if abs(oy) > depth:
            return 1e18, -1e18, 0
    else:
        per = 1.0 / uy
        middle, half = -oy * per, abs(depth * per)
        if middle - half > enter:
            enter = middle - half
            side = 2 if uy > 0.0 else 3
        leave = min(leave, middle + half)
    if enter > leave:
        return 1e18, -1e18, 0
    return enter, leave, side


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _half_log2(square: float) -> float:
    """Half the binary logarithm, from the parts of a 32-bit float, linear between powers of two: within 0.05."""
    bits = np.float32(square).view(np.int32)
    return 0.5 * (float(bits) * (1.0 / 8388608.0) - 127.0)


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _unpacked(texel: Any) -> Any:
    """The three colours of a texel, 21 bits apart: one multiplication then weighs all of them."""
    wide = np.uint64(texel)
    return (
        (wide & np.uint64(0xFF))
        | ((wide & np.uint64(0xFF00)) << np.uint64(13))
        | ((wide >> np.uint64(16)) << np.uint64(42))
    )


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _sample(
    texels: Texels, level_start: Ints, levels: int, finest: int, texture: int, level: float, u: float, v: float
) -> tuple[float, float, float]:
    """Colour of a texture at (u, v) in [0, 1]: linear between texels, and between the two levels nearest in size."""
    level = min(max(level, 0.0), levels - 1.001)
    fine = int(level)
    part = level - fine
    total = _bilinear(texels, level_start[fine], finest >> fine, texture, u, v, 8191.0 * (1.0 - part))
    if part > 0.0:
        fine += 1
        total += _bilinear(texels, level_start[fine], finest >> fine, texture, u, v, 8191.0 * part)
    low = np.uint64(0x1FFFFF)
    return (
        float(np.int64(total & low)) * (1.0 / 8191.0),
        float(np.int64((total >> np.uint64(21)) & low)) * (1.0 / 8191.0),
        float(np.int64(total >> np.uint64(42))) * (1.0 / 8191.0),
    )


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _bilinear(texels: Texels, start: int, side: int, texture: int, u: float, v: float, weight: float) -> Any:
    """The three colours at (u, v), 21 bits apart, times a weight."""
    column, row = max(u * side - 0.5, 0.0), max(v * side - 0.5, 0.0)
    left, above = int(column), int(row)
    wu, wv = column - left, row - above
    right, below = min(left + 1, side - 1), min(above + 1, side - 1)
    start += texture * side * side
    above, below = start + above * side, start + below * side
    lower = wv * weight
    upper = weight - lower
    upper_right, lower_right = wu * upper, wu * lower
    return (
        _unpacked(texels[above + left]) * np.uint64(np.int64(upper - upper_right))
        + _unpacked(texels[above + right]) * np.uint64(np.int64(upper_right))
        + _unpacked(texels[below + left]) * np.uint64(np.int64(lower - lower_right))
        + _unpacked(texels[below + right]) * np.uint64(np.int64(lower_right))
    )


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _light(light: Floats, side: int, column: float, row: float) -> tuple[float, float, float]:
    """Light that falls at a point of the light map on a face that looks one of five ways, linear between samples."""
    column = min(max(column, 0.0), light.shape[2] - 1.001)
    row = min(max(row, 0.0), light.shape[1] - 1.001)
    left, below = int(column), int(row)
    wx, wy = column - left, row - below
    weights = (1 - wx) * (1 - wy), wx * (1 - wy), (1 - wx) * wy, wx * wy
    return (
        _between(light, side, left, below, weights, 0),
        _between(light, side, left, below, weights, 1),
        _between(light, side, left, below, weights, 2),
    )


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _between(
    light: Floats, side: int, left: int, below: int, weights: tuple[float, float, float, float], colour: int
) -> float:
    """One colour of the light between four samples."""
    return float(
        weights[0] * light[side, below, left, colour]
        + weights[1] * light[side, below, left + 1, colour]
        + weights[2] * light[side, below + 1, left, colour]
        + weights[3] * light[side, below + 1, left + 1, colour]
    )


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _contact(contact: Floats, column: float, row: float) -> float:
    """Share of light that bodies beside a point of the floor leave it, linear between samples."""
    column = min(max(column, 0.0), contact.shape[1] - 1.001)
    row = min(max(row, 0.0), contact.shape[0] - 1.001)
    left, below = int(column), int(row)
    wx, wy = column - left, row - below
    lower = contact[below, left] + wx * (contact[below, left + 1] - contact[below, left])
    upper = contact[below + 1, left] + wx * (contact[below + 1, left + 1] - contact[below + 1, left])
    return float(lower + wy * (upper - lower))


@compiled(error_model="numpy", fastmath=FAST_MATH)
def _mixed(number: np.uint64) -> np.uint64:
    """The next number of a counter-based sequence: splitmix64's finaliser (Steele, Lea & Flood 2014)."""
    number = (number ^ (number >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    number = (number ^ (number >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return number ^ (number >> np.uint64(31))


def _gaussian_quantiles(count: int) -> Floats:
    """Middles of `count` equally likely parts of a Gaussian, scaled to a standard deviation of 1."""
    from statistics import NormalDist

    quantile = NormalDist().inv_cdf
    values = np.array([quantile((k + 0.5) / count) for k in range(count)])
    scaled: Floats = (values / values.std()).astype(np.float32)
    return scaled


QUANTILES = _gaussian_quantiles(4096)


@compiled(error_model="numpy", fastmath=FAST_MATH, parallel=True)
def _expose(
    lit: Floats,
    ray_of: Shorts,
    gain: Floats,
    exposure: float,
    noise: float,
    key: np.uint64,
    quantiles: Floats,
    image: Bytes,
) -> None:
    """The chip: light times exposure and vignetting, plus noise that follows from key, pixel and colour alone."""
    start = _mixed(key)
    spread = np.float32(noise)
    for p in numba.prange(len(image)):
        i = ray_of[p]
        share = gain[i] * np.float32(exposure) if i >= 0 else np.float32(0.0)
        drawn = _mixed(start + np.uint64(p) * np.uint64(0x9E3779B97F4A7C15))
        for colour in range(3):
            value = np.float32(0.5)
            if i >= 0:
                value += share * lit[i, colour]
            if noise > 0.0:
                value += spread * quantiles[(drawn >> np.uint64(20 * colour)) & np.uint64(0xFFF)]
            image[p, colour] = np.uint8(min(max(value, np.float32(0.0)), np.float32(255.0)))

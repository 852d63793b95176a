"""Procedural textures: square images from a material's name and a random generator, and their mip levels.

Colours are blue-green-red. Each texture is drawn larger than it is kept and averaged down, so that no edge is jagged.
"""

import colorsys
import math
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from omninav.stages.geometry.arrays import Bytes, Floats

Colour = tuple[float, float, float]

SIDE = 128
"""Texels along a side of a texture's finest level."""
DRAWN = 2 * SIDE
"""Pixels along a side while a texture is drawn."""


def draw(material: str, rng: np.random.Generator) -> Bytes:
    """One texture (SIDE, SIDE, 3) of a material. Raises `KeyError` that lists the materials for a name that is none."""
    if material not in MATERIALS:
        raise KeyError(f"no material '{material}'; there are: {', '.join(sorted(MATERIALS))}")
    canvas = MATERIALS[material](rng)
    pixels = np.clip(canvas, 0, 255).astype(np.uint8)
    return cv2.resize(pixels, (SIDE, SIDE), interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)


def glow(material: str) -> float:
    """Share of a material's brightness that does not come from the light around it."""
    return {"lamp": 1.0, "sky": 1.0, "window": 0.8, "screen": 0.8}.get(material, 0.0)


def extent(material: str) -> tuple[float, float]:
    """Width and height (m) that one texture of a material covers about; infinite: the whole face."""
    return EXTENTS.get(material, (math.inf, math.inf))


def mip_levels(textures: Bytes) -> list[Bytes]:
    """Levels of textures (N, S, S, 3), S a power of two: each the mean of 2 x 2 texels of the one before, down to 1."""
    levels, exact = [textures], textures.astype(np.float32)
    while exact.shape[1] > 1:
        count, side = exact.shape[:2]
        exact = exact.reshape(count, side // 2, 2, side // 2, 2, 3).mean(axis=(2, 4))
        levels.append(np.round(exact).astype(np.uint8))
    return levels


def vivid(rng: np.random.Generator, saturation: tuple[float, float] = (0.5, 0.95)) -> Colour:
    """A colour as print and packaging have it."""
    red, green, blue = colorsys.hsv_to_rgb(rng.uniform(), rng.uniform(*saturation), rng.uniform(0.5, 1.0))
    return (255 * blue, 255 * green, 255 * red)


def scaled(colour: Colour, factor: float) -> Colour:
    """A colour made darker or lighter."""
    return (colour[0] * factor, colour[1] * factor, colour[2] * factor)


def blank(colour: Colour) -> Floats:
    """A canvas of one colour."""
    return np.broadcast_to(np.array(colour, dtype=np.float32), (DRAWN, DRAWN, 3)).copy()


def lit_to(colour: Colour, level: float) -> Colour:
    """A colour of the same hue whose greatest part is `level`."""
    return scaled(colour, level / max(colour))


def cloud(rng: np.random.Generator, cells: int, strength: float) -> Floats:
    """Smooth noise (DRAWN, DRAWN, 1) around 0, `cells` bumps along a side."""
    return _bumps(rng, (cells + 1, cells + 1), strength)


def _bumps(rng: np.random.Generator, shape: tuple[int, int], strength: float) -> Floats:
    """Smooth noise (DRAWN, DRAWN, 1) around 0 between rows and columns of random numbers."""
    coarse = rng.normal(0.0, strength, shape).astype(np.float32)
    smooth: Floats = cv2.resize(coarse, (DRAWN, DRAWN), interpolation=cv2.INTER_CUBIC).astype(np.float32)
    return smooth[..., None]


def grain(rng: np.random.Generator, strength: float) -> Floats:
    """Fine noise (DRAWN, DRAWN, 1) around 0."""
    return rng.normal(0.0, strength, (DRAWN, DRAWN, 1)).astype(np.float32)


def box(canvas: Floats, left: float, top: float, right: float, bottom: float, colour: Colour) -> None:
    """A filled rectangle, in parts of the canvas (0 to 1)."""
    corners = [round(DRAWN * part) for part in (left, top, right, bottom)]
    cv2.rectangle(canvas, (corners[0], corners[1]), (corners[2] - 1, corners[3] - 1), colour, -1)


def _bars(canvas: Floats, places: Sequence[float], width: float, colour: Colour) -> None:
    """Bars from edge to edge that begin at the same places from the left and from above."""
    for at in places:
        box(canvas, at, 0, at + width, 1, colour)
        box(canvas, 0, at, 1, at + width, colour)


def _wall(rng: np.random.Generator) -> Floats:
    canvas = blank(lit_to(vivid(rng, (0.05, 0.3)), 225.0)) + cloud(rng, 5, 4.0) + grain(rng, 3.0)
    if rng.uniform() < 0.6:
        stripe = vivid(rng, (0.4, 0.8))
        height = rng.uniform(0.62, 0.75)
        box(canvas, 0, height, 1, height + rng.uniform(0.03, 0.08), stripe)
    box(canvas, 0, 0.965, 1, 1, (70, 75, 80))
    return canvas


def _concrete(rng: np.random.Generator) -> Floats:
    return blank((150, 155, 158)) + cloud(rng, 4, 12.0) + cloud(rng, 16, 7.0) + grain(rng, 6.0)


def _stripes(rng: np.random.Generator) -> Floats:
    canvas = blank((225, 225, 225)) + grain(rng, 4.0)
    colour = vivid(rng)
    for k in range(0, 8, 2):
        box(canvas, 0, k / 8, 1, (k + 1) / 8, colour)
    return canvas


def _floor(rng: np.random.Generator) -> Floats:
    canvas = blank((0, 0, 0))
    tone = np.array([148.0, 158.0, 165.0]) + rng.normal(0.0, 3.0, 3)
    for row, column in np.ndindex(2, 2):
        tile = tone * (1.0 + rng.normal(0.0, 0.05)) * (0.86 if (row + column) % 2 else 1.0)
        box(canvas, column / 2, row / 2, (column + 1) / 2, (row + 1) / 2, tuple(tile))
    canvas += cloud(rng, 24, 7.0) + grain(rng, 5.0)
    _bars(canvas, (0.0, 0.5), 0.012, (92, 98, 104))
    return canvas


def _ceiling(rng: np.random.Generator) -> Floats:
    canvas = blank((205, 208, 208)) + grain(rng, 5.0) + cloud(rng, 3, 3.0)
    _bars(canvas, (0.0,), 0.02, (150, 152, 152))
    if rng.uniform() < 0.08:
        box(canvas, 0.3, 0.3, 0.7, 0.7, (120, 122, 122))
        for k in range(6):
            box(canvas, 0.32, 0.33 + 0.06 * k, 0.68, 0.36 + 0.06 * k, (170, 172, 172))
    return canvas


def _lamp(rng: np.random.Generator) -> Floats:
    canvas = blank((255, 255, 255))
    for k in (0.0, 0.48, 0.96):
        box(canvas, 0, k, 1, k + 0.04, (190, 195, 195))
    return canvas


def _unlit(rng: np.random.Generator) -> Floats:
    """A lamp that is off."""
    return 0.55 * _lamp(rng)


def _wood(rng: np.random.Generator) -> Floats:
    canvas = blank((95, 140, 185)) * (1.0 + 0.08 * _bumps(rng, (2, 40), 1.0)) + grain(rng, 4.0)
    for k in (0.25, 0.5, 0.75):
        box(canvas, k, 0, k + 0.008, 1, (55, 85, 115))
    return canvas


def _mat(rng: np.random.Generator) -> Floats:
    colour = vivid(rng, (0.5, 0.8))
    canvas = blank(scaled(colour, 0.5)) + grain(rng, 14.0)
    for edge, factor in ((0.06, 0.85), (0.12, 0.5), (0.3, 0.7), (0.36, 0.5)):
        box(canvas, edge, edge, 1 - edge, 1 - edge, scaled(colour, factor))
    return canvas + grain(rng, 8.0)


def _counter(rng: np.random.Generator) -> Floats:
    colour = vivid(rng, (0.6, 0.9))
    canvas = blank((205, 205, 200)) + grain(rng, 3.0)
    box(canvas, 0, 0, 1, 0.1, (60, 62, 64))
    box(canvas, 0, 0.4, 1, 0.62, colour)
    box(canvas, 0.49, 0.1, 0.51, 1, (120, 120, 120))
    return canvas


def _door(rng: np.random.Generator) -> Floats:
    colour = scaled(vivid(rng, (0.2, 0.7)), rng.uniform(0.5, 0.9))
    canvas = blank(scaled(colour, 0.45))
    box(canvas, 0.06, 0.03, 0.94, 1.0, colour)
    if rng.uniform() < 0.5:
        box(canvas, 0.3, 0.12, 0.7, 0.45, (190, 175, 150))
        box(canvas, 0.2, 0.55, 0.8, 0.92, scaled(colour, 0.8))
    else:
        for k in range(3):
            box(canvas, 0.16, 0.1 + 0.3 * k, 0.84, 0.34 + 0.3 * k, scaled(colour, 0.8))
    box(canvas, 0.8, 0.5, 0.88, 0.54, (60, 200, 215))
    return canvas + grain(rng, 3.0)


def _window(rng: np.random.Generator) -> Floats:
    rows = np.linspace(0.0, 1.0, DRAWN, dtype=np.float32)[:, None, None]
    sky, ground = np.array((250, 235, 215), dtype=np.float32), np.array((120, 190, 150), dtype=np.float32)
    canvas: Floats = np.where(rows < rng.uniform(0.5, 0.7), sky - 40 * rows, ground) + cloud(rng, 6, 10.0)
    _bars(canvas, (0.0, 0.475, 0.95), 0.05, (235, 235, 235))
    return canvas


def _poster(rng: np.random.Generator) -> Floats:
    ground = vivid(rng, (0.3, 0.95))
    canvas = blank(ground)
    style = rng.integers(4)
    if style == 0:
        for _ in range(int(rng.integers(3, 7))):
            at = rng.uniform(0.15, 0.85, 2) * DRAWN
            cv2.circle(canvas, (int(at[0]), int(at[1])), int(rng.uniform(0.08, 0.28) * DRAWN), vivid(rng), -1)
    elif style == 1:
        count = int(rng.integers(3, 6))
        for k in range(count):
            box(canvas, 0, k / count, 1, (k + 1) / count, vivid(rng))
    elif style == 2:
        corners = (rng.uniform(0.05, 0.95, (5, 2)) * DRAWN).astype(np.int32)
        cv2.fillPoly(canvas, [corners], vivid(rng))
        cv2.fillPoly(canvas, [corners[::-1] // 2 + DRAWN // 4], vivid(rng))
    else:
        box(canvas, 0, 0, 0.5, 0.5, vivid(rng))
        box(canvas, 0.5, 0.5, 1, 1, vivid(rng))
    ink = (250.0, 250.0, 250.0) if rng.uniform() < 0.5 else (25.0, 25.0, 25.0)
    top = rng.uniform(0.15, 0.6)
    for letter in range(int(rng.integers(3, 6))):
        for row, column in np.argwhere(rng.uniform(size=(5, 3)) < 0.6):
            left, above = 0.1 + 0.16 * letter + 0.042 * column, top + 0.05 * row
            box(canvas, left, above, left + 0.042, above + 0.05, ink)
    _bars(canvas, (0.0, 0.97), 0.03, (245, 245, 245))
    return canvas + grain(rng, 3.0)


def _carton(rng: np.random.Generator) -> Floats:
    canvas = blank((95, 140, 180)) * rng.uniform(0.8, 1.15) + cloud(rng, 6, 5.0) + grain(rng, 5.0)
    box(canvas, 0.46, 0, 0.54, 1, (130, 175, 205))
    if rng.uniform() < 0.7:
        left, top = rng.uniform(0.08, 0.5), rng.uniform(0.15, 0.6)
        box(canvas, left, top, left + 0.32, top + 0.25, vivid(rng))
    return canvas


def _plaster(rng: np.random.Generator) -> Floats:
    canvas = blank(lit_to(vivid(rng, (0.04, 0.28)), rng.uniform(190.0, 230.0))) + cloud(rng, 5, 4.0) + grain(rng, 3.0)
    if rng.uniform() < 0.3:
        box(canvas, 0, 0.68, 1, 0.965, scaled(vivid(rng, (0.15, 0.45)), 0.85))
    box(canvas, 0, 0.965, 1, 1, (70, 75, 80))
    return canvas


def _brick(rng: np.random.Generator) -> Floats:
    canvas = blank((165, 172, 178))
    tone = np.array([62.0, 82.0, 158.0]) * rng.uniform(0.7, 1.2) + rng.normal(0.0, 8.0, 3)
    for row in range(12):
        for column in range(-1, 4):
            left = (column + 0.5 * (row % 2)) / 4
            shade = tuple(tone * rng.uniform(0.8, 1.15))
            box(canvas, max(left, 0.0), row / 12, min(left + 0.235, 1.0), (row + 0.85) / 12, shade)
    return canvas + grain(rng, 6.0)


def _facade(rng: np.random.Generator) -> Floats:
    """A storey of an outer wall: render or brick around a window."""
    colour = vivid(rng, (0.08, 0.45))
    canvas = (_brick(rng) if rng.uniform() < 0.4 else blank(scaled(colour, 0.8))) + cloud(rng, 5, 5.0)
    left, top = rng.uniform(0.15, 0.3), rng.uniform(0.12, 0.25)
    box(canvas, left, top, 1 - left, 0.65, (225, 225, 225))
    for column in range(2):
        x = left + 0.03 + column * (0.5 - left)
        box(canvas, x, top + 0.03, x + 0.46 - left, 0.62, (150, 120, 95))
        box(canvas, x, top + 0.03, x + 0.3 * (0.46 - left), 0.62, (190, 165, 140))
    box(canvas, 0, 0.92, 1, 1, (105, 108, 112))
    return canvas + grain(rng, 4.0)


def _carpet(rng: np.random.Generator) -> Floats:
    colour = scaled(vivid(rng, (0.15, 0.5)), 0.6)
    return blank(colour) + cloud(rng, 20, 5.0) + grain(rng, 14.0)


def _parquet(rng: np.random.Generator) -> Floats:
    canvas = blank((60, 95, 130))
    tone = np.array([85.0, 128.0, 172.0]) * rng.uniform(0.7, 1.1)
    for row in range(8):
        start = rng.uniform(-0.5, 0.0)
        while start < 1.0:
            shade = tuple(tone * rng.uniform(0.85, 1.15))
            box(canvas, max(start, 0.0), row / 8, min(start + 0.49, 1.0), (row + 0.95) / 8, shade)
            start += 0.5
    return canvas + cloud(rng, 30, 4.0) + grain(rng, 4.0)


def _linoleum(rng: np.random.Generator) -> Floats:
    canvas = blank(lit_to(vivid(rng, (0.1, 0.4)), rng.uniform(120.0, 185.0)))
    return canvas + cloud(rng, 12, 8.0) + cloud(rng, 48, 6.0) + grain(rng, 4.0)


def _asphalt(rng: np.random.Generator) -> Floats:
    return blank((92, 92, 92)) + cloud(rng, 6, 6.0) + grain(rng, 16.0)


def _paving(rng: np.random.Generator) -> Floats:
    canvas = blank((105, 112, 116))
    tone = np.array([160.0, 166.0, 172.0]) * rng.uniform(0.85, 1.1)
    for row, column in np.ndindex(4, 4):
        slab = tuple(tone * rng.uniform(0.9, 1.08))
        box(canvas, column / 4 + 0.008, row / 4 + 0.008, (column + 1) / 4, (row + 1) / 4, slab)
    return canvas + cloud(rng, 16, 5.0) + grain(rng, 6.0)


def _grass(rng: np.random.Generator) -> Floats:
    green = np.array([58.0, 112.0, 88.0], dtype=np.float32) * rng.uniform(0.85, 1.15)
    canvas = blank(tuple(green)) * (1.0 + cloud(rng, 8, 0.1) + cloud(rng, 40, 0.12)) + grain(rng, 14.0)
    for x, y in rng.uniform(0.0, DRAWN, (int(rng.integers(0, 14)), 2)):
        cv2.circle(canvas, (int(x), int(y)), 3, (90, 225, 235), -1)
    return canvas


def _leaves(rng: np.random.Generator) -> Floats:
    tone = np.array([40.0, 105.0, 62.0]) * rng.uniform(0.75, 1.25) + np.array([0.0, 0.0, rng.uniform(0.0, 45.0)])
    canvas = blank(tuple(0.5 * tone))
    for x, y, size, shade in zip(*rng.uniform(0, 1, (4, 260)), strict=True):
        colour = tuple(tone * (0.6 + 0.8 * shade))
        cv2.circle(canvas, (int(x * DRAWN), int(y * DRAWN)), int(4 + 9 * size), colour, -1)
    return canvas + grain(rng, 8.0)


def _hedge(rng: np.random.Generator) -> Floats:
    return _leaves(rng) * 0.85 + cloud(rng, 30, 8.0)


def _bark(rng: np.random.Generator) -> Floats:
    return blank((58, 78, 96)) * (1.0 + 0.25 * _bumps(rng, (5, 28), 1.0)) + grain(rng, 8.0)


def _sky(rng: np.random.Generator) -> Floats:
    return blank((238, 214, 190)) + cloud(rng, 3, 3.0)


def _curtain(rng: np.random.Generator) -> Floats:
    colour = vivid(rng, (0.25, 0.7))
    folds: Floats = (
        1.0 + np.float32(0.16) * np.sin(np.linspace(0.0, 22.0 * np.pi, DRAWN, dtype=np.float32))[None, :, None]
    )
    return blank(scaled(colour, 0.85)) * folds + grain(rng, 4.0)


def _books(rng: np.random.Generator) -> Floats:
    """A bookcase: boards with backs of books and files."""
    canvas = blank((48, 66, 84))
    for shelf in range(5):
        left, bottom = 0.03, (shelf + 0.94) / 5
        uniform = vivid(rng) if rng.uniform() < 0.4 else None
        while left < 0.95:
            width, height = rng.uniform(0.02, 0.06), rng.uniform(0.11, 0.165)
            if rng.uniform() < 0.9:
                colour = scaled(uniform or vivid(rng, (0.2, 0.9)), rng.uniform(0.6, 1.0))
                box(canvas, left, bottom - height, min(left + width, 0.97), bottom, colour)
            left += width + 0.004
        box(canvas, 0, bottom, 1, bottom + 0.02, (85, 118, 150))
    return canvas + grain(rng, 4.0)


def _cabinet(rng: np.random.Generator) -> Floats:
    colour = lit_to(vivid(rng, (0.05, 0.6)), rng.uniform(150.0, 235.0))
    canvas = blank(scaled(colour, 0.6))
    columns, rows = int(rng.integers(1, 3)), int(rng.integers(1, 5))
    for row, column in np.ndindex(rows, columns):
        left, top = column / columns, row / rows * 0.94
        box(canvas, left + 0.015, top + 0.015, left + 1 / columns - 0.015, top + 0.94 / rows - 0.005, colour)
        middle = left + 0.5 / columns
        box(canvas, middle - 0.06, top + 0.04, middle + 0.06, top + 0.06, (70, 70, 72))
    box(canvas, 0, 0.95, 1, 1, (45, 45, 48))
    return canvas + grain(rng, 3.0)


def _steel(rng: np.random.Generator) -> Floats:
    brushed = cv2.resize(rng.normal(0.0, 5.0, (DRAWN, 3)).astype(np.float32), (DRAWN, DRAWN))
    canvas = blank((188, 186, 182)) + brushed[..., None].astype(np.float32) + grain(rng, 3.0)
    box(canvas, 0.08, 0.1, 0.11, 0.5, (90, 90, 92))
    box(canvas, 0, 0.6, 1, 0.615, (110, 110, 112))
    return canvas


def _fabric(rng: np.random.Generator) -> Floats:
    return blank(scaled(vivid(rng, (0.4, 0.9)), 0.75)) + cloud(rng, 10, 7.0) + grain(rng, 9.0)


def _screen(rng: np.random.Generator) -> Floats:
    canvas = blank((30, 28, 28))
    box(canvas, 0.05, 0.07, 0.95, 0.93, scaled(vivid(rng, (0.2, 0.8)), 0.7))
    for row in range(int(rng.integers(3, 8))):
        top = 0.14 + 0.1 * row
        box(canvas, 0.12, top, rng.uniform(0.3, 0.88), top + 0.04, (235, 235, 235))
    return canvas


def _board(rng: np.random.Generator) -> Floats:
    """A white board with writing."""
    canvas = blank((240, 240, 238)) + cloud(rng, 4, 3.0)
    for _ in range(int(rng.integers(4, 12))):
        at = (rng.uniform(0.08, 0.75, 2) * DRAWN).astype(int)
        ink = ((160, 60, 30), (40, 40, 190), (60, 130, 40), (30, 30, 30))[int(rng.integers(4))]
        steps = np.cumsum(rng.normal((5.0, 0.0), 5.0, (12, 2)), axis=0).astype(int)
        cv2.polylines(canvas, [(at + steps).astype(np.int32)], False, ink, 3)
    _bars(canvas, (0.0, 0.97), 0.03, (150, 150, 152))
    return canvas


def _goods(rng: np.random.Generator) -> Floats:
    """One compartment of a shelf: what is on a board, its price rail below, an upright at the left edge."""
    canvas = blank((52, 50, 48)) + cloud(rng, 4, 5.0)
    FILLINGS[int(rng.integers(len(FILLINGS)))](canvas, rng)
    rail = vivid(rng, (0.1, 0.9)) if rng.uniform() < 0.5 else (230.0, 230.0, 230.0)
    box(canvas, 0, 0.9, 1, 1, rail)
    for k in range(int(rng.integers(2, 5))):
        left = 0.1 + 0.23 * k
        box(canvas, left, 0.915, left + 0.1, 0.985, (250, 250, 250))
    box(canvas, 0, 0, 0.025, 1, (120, 118, 115))
    return canvas + grain(rng, 4.0)


def _packets(canvas: Floats, rng: np.random.Generator) -> None:
    count = int(rng.integers(3, 8))
    brands = [vivid(rng) for _ in range(int(rng.integers(1, 4)))]
    height = rng.uniform(0.45, 0.85)
    for k in range(count):
        colour = scaled(brands[k % len(brands)], rng.uniform(0.85, 1.1))
        left, right = 0.03 + 0.95 * k / count, 0.03 + 0.95 * (k + 0.93) / count
        top = 0.9 - height * rng.uniform(0.93, 1.0)
        box(canvas, left, top, right, 0.9, colour)
        box(canvas, left, top + 0.12 * height, right, top + 0.4 * height, scaled(brands[0], 1.25))
        box(canvas, left + 0.02, 0.9 - 0.35 * height, right - 0.02, 0.9 - 0.15 * height, (235, 235, 235))


def _cans(canvas: Floats, rng: np.random.Generator) -> None:
    count, layers = int(rng.integers(4, 9)), int(rng.integers(1, 4))
    brands = [vivid(rng) for _ in range(2)]
    height = rng.uniform(0.24, 0.28) if layers == 3 else rng.uniform(0.3, 0.8 / layers)
    shade = np.sin(np.linspace(0.25, np.pi - 0.25, max(1, int(0.9 * DRAWN / count)), dtype=np.float32))
    for layer in range(layers):
        for k in range(count):
            left, bottom = 0.04 + 0.94 * k / count, 0.9 - layer * height
            right, label = left + 0.9 / count, scaled(brands[0], 1.3)
            box(canvas, left, bottom - height, right, bottom, brands[(k + layer) % 2])
            box(canvas, left, bottom - 0.65 * height, right, bottom - 0.35 * height, label)
            box(canvas, left, bottom - height, right, bottom - 0.93 * height, (190, 190, 190))
            x, y0, y1 = round(left * DRAWN), round((bottom - height) * DRAWN), round(bottom * DRAWN)
            patch = canvas[max(y0, 0) : y1, x : x + len(shade)]
            patch *= shade[None, : patch.shape[1], None]


def _bottles(canvas: Floats, rng: np.random.Generator) -> None:
    count = int(rng.integers(6, 12))
    liquid, label = vivid(rng), vivid(rng)
    for k in range(count):
        left, width = 0.04 + 0.94 * k / count, 0.8 / count
        top = 0.2 + rng.uniform(0.0, 0.05)
        box(canvas, left, top + 0.2, left + width, 0.9, liquid)
        box(canvas, left + 0.35 * width, top, left + 0.65 * width, top + 0.2, scaled(liquid, 0.8))
        box(canvas, left + 0.3 * width, top - 0.04, left + 0.7 * width, top, (40, 40, 220))
        box(canvas, left, top + 0.35, left + width, top + 0.55, label)


def _tools(canvas: Floats, rng: np.random.Generator) -> None:
    canvas[:] = np.array(scaled(vivid(rng, (0.05, 0.5)), 0.85), dtype=np.float32)
    handle = vivid(rng)
    for k in range(int(rng.integers(5, 10))):
        left = 0.06 + 0.1 * k
        length = rng.uniform(0.35, 0.7)
        box(canvas, left, 0.1, left + 0.02, 0.1 + length, (175, 175, 180))
        box(canvas, left - 0.02, 0.1 + 0.55 * length, left + 0.04, 0.1 + length, handle)
        if k % 2:
            box(canvas, left - 0.03, 0.1, left + 0.05, 0.16, (150, 150, 155))


def _rolls(canvas: Floats, rng: np.random.Generator) -> None:
    columns, rows = int(rng.integers(3, 7)), int(rng.integers(2, 5))
    colours = [vivid(rng) for _ in range(3)]
    radius = 0.42 * min(0.94 / columns, 0.85 / rows) * DRAWN
    for row, column in np.ndindex(rows, columns):
        at = int((0.04 + 0.94 * (column + 0.5) / columns) * DRAWN), int((0.05 + 0.85 * (row + 0.5) / rows) * DRAWN)
        cv2.circle(canvas, at, int(radius), colours[int(rng.integers(3))], -1)
        cv2.circle(canvas, at, int(0.35 * radius), (60, 60, 60), -1)


def _plants(canvas: Floats, rng: np.random.Generator) -> None:
    for k in range(int(rng.integers(3, 6))):
        left = 0.06 + 0.19 * k
        box(canvas, left, 0.68, left + 0.13, 0.9, (60, 95, 185))
        for _ in range(14):
            at = (int((left + 0.065 + rng.normal(0, 0.05)) * DRAWN), int((0.48 + rng.normal(0, 0.1)) * DRAWN))
            cv2.circle(canvas, at, int(rng.uniform(5, 13)), (40, rng.uniform(110, 200), rng.uniform(30, 90)), -1)
        if rng.uniform() < 0.6:
            cv2.circle(canvas, (int((left + 0.06) * DRAWN), int(0.4 * DRAWN)), 9, vivid(rng), -1)


def _cases(canvas: Floats, rng: np.random.Generator) -> None:
    left = 0.03
    while left < 0.9:
        width, height = rng.uniform(0.15, 0.4), rng.uniform(0.3, 0.8)
        right = min(left + width, 0.98)
        colour = vivid(rng, (0.2, 0.9))
        box(canvas, left, 0.9 - height, right, 0.9, colour)
        box(canvas, left + 0.03, 0.93 - height, right - 0.03, 0.9 - 0.6 * height, scaled(vivid(rng), 1.1))
        left = right + 0.015


def _coat(rng: np.random.Generator) -> Floats:
    """Clothes above the waist: plain, striped, checked or with a print, open or closed in the middle."""
    colour, other = scaled(vivid(rng, (0.1, 0.9)), rng.uniform(0.3, 1.0)), vivid(rng, (0.2, 0.9))
    canvas = blank(colour) + cloud(rng, 5, 9.0)
    style = rng.integers(5)
    if style == 0:
        for k in range(0, 10, 2):
            box(canvas, 0, k / 10, 1, (k + 0.8) / 10, other)
    elif style == 1:
        for k in range(0, 8, 2):
            box(canvas, k / 8, 0, (k + 0.5) / 8, 1, scaled(colour, 0.6))
            box(canvas, 0, k / 8, 1, (k + 0.5) / 8, other)
    elif style == 2:
        box(canvas, 0.25, 0.25, 0.75, 0.6, other)
    elif style == 3:
        box(canvas, 0.36, 0, 0.64, 1, other)
    box(canvas, 0, 0.94, 1, 1, scaled(colour, 0.5))
    box(canvas, 0.49, 0.1, 0.51, 0.94, scaled(colour, 0.55))
    return canvas + grain(rng, 4.0)


def _trousers(rng: np.random.Generator) -> Floats:
    colour = scaled(vivid(rng, (0.05, 0.6)), rng.uniform(0.2, 0.7))
    canvas = blank(colour) + cloud(rng, 4, 8.0)
    box(canvas, 0.46, 0, 0.54, 1, scaled(colour, 0.8))
    box(canvas, 0, 0.92, 1, 1, scaled(vivid(rng, (0.0, 0.4)), 0.3))
    return canvas + grain(rng, 5.0)


SKINS: tuple[Colour, ...] = ((172, 200, 236), (150, 182, 226), (105, 145, 200), (72, 105, 155), (48, 66, 98))


def _face(rng: np.random.Generator) -> Floats:
    skin = SKINS[int(rng.integers(len(SKINS)))]
    hair = scaled((60, 90, 130), rng.uniform(0.2, 1.6))
    canvas = blank(skin) + cloud(rng, 4, 4.0)
    box(canvas, 0, 0, 1, rng.uniform(0.12, 0.28), hair)
    for left in (0.18, 0.62):
        box(canvas, left, 0.42, left + 0.2, 0.5, (40, 40, 45))
    box(canvas, 0.45, 0.48, 0.55, 0.68, scaled(skin, 0.85))
    box(canvas, 0.32, 0.76, 0.68, 0.81, (70, 70, 165))
    return canvas + grain(rng, 3.0)


def _hair(rng: np.random.Generator) -> Floats:
    canvas = blank(scaled((60, 90, 130), rng.uniform(0.2, 1.7))) + cloud(rng, 6, 10.0)
    if rng.uniform() < 0.3:  # a cap
        box(canvas, 0, 0, 1, 0.4, vivid(rng))
    box(canvas, 0, 0.85, 1, 1, SKINS[int(rng.integers(len(SKINS)))])
    return canvas + grain(rng, 8.0)


FILLINGS: tuple[Callable[[Floats, np.random.Generator], None], ...] = (
    _packets, _cans, _bottles, _tools, _rolls, _plants, _cases
)  # fmt: skip

MATERIALS: dict[str, Callable[[np.random.Generator], Floats]] = {
    "wall": _wall, "concrete": _concrete, "stripes": _stripes, "floor": _floor, "ceiling": _ceiling, "lamp": _lamp,
    "wood": _wood, "mat": _mat, "counter": _counter, "door": _door, "window": _window, "poster": _poster,
    "carton": _carton, "goods": _goods, "plaster": _plaster, "brick": _brick, "facade": _facade, "carpet": _carpet,
    "parquet": _parquet, "linoleum": _linoleum, "asphalt": _asphalt, "paving": _paving, "grass": _grass,
    "hedge": _hedge, "leaves": _leaves, "bark": _bark, "sky": _sky, "curtain": _curtain, "books": _books,
    "cabinet": _cabinet, "steel": _steel, "fabric": _fabric, "screen": _screen, "board": _board,
    "unlit": _unlit, "coat": _coat, "trousers": _trousers, "face": _face, "hair": _hair,
}  # fmt: skip

EXTENTS: dict[str, tuple[float, float]] = {
    "wall": (2.0, math.inf), "plaster": (2.0, math.inf), "brick": (1.0, 1.0), "facade": (2.5, 3.0),
    "concrete": (1.0, 1.0), "stripes": (1.0, 1.0), "ceiling": (1.0, 1.0), "hedge": (1.5, 1.5), "leaves": (2.0, 2.0),
    "bark": (0.5, 1.0), "books": (1.0, math.inf), "wood": (1.2, 1.2),
}  # fmt: skip

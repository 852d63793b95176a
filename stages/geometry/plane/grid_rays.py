"""Rays through the cells of a grid."""

import math
from collections.abc import Iterator

import numba


# Not cached by itself: numba cannot call a generator that comes from its cache. Its callers are cached.
@numba.njit(nogil=True)
def cells_along(row: float, column: float, down: float, across: float) -> Iterator[tuple[int, int, bool, float]]:
    """The cells that a ray enters, in order and without end, by the traversal of Amanatides & Woo 1987.

    `row`, `column`: where the ray starts, in cells, as numbers whose whole part is the cell; `down`, `across`: its
    direction, of any length. Yields row and column of each cell after the first, whether the ray enters it sideways
    (over an edge between two columns), and how far along the ray, in lengths of the direction. Where a ray runs through
    a corner it changes the row first.
    """
    i, j = math.floor(row), math.floor(column)
    step_i, step_j = 1 if down > 0 else -1, 1 if across > 0 else -1
    # Along the ray: the distance between two edges, and to the next one.
    every_i, every_j = 1.0 / max(abs(down), 1e-12), 1.0 / max(abs(across), 1e-12)
    next_i = every_i * (i + 1 - row if step_i > 0 else row - i)
    next_j = every_j * (j + 1 - column if step_j > 0 else column - j)
    while True:
        sideways = next_j < next_i
        if sideways:
            entered, j, next_j = next_j, j + step_j, next_j + every_j
        else:
            entered, i, next_i = next_i, i + step_i, next_i + every_i
        yield i, j, sideways, entered

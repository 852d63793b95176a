"""Which features of two views belong together, by what they look like."""

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Floats, Ints


class Pairs(NamedTuple):
    """Matched rows of a first and a second view, and how far apart they are: each (M,), the clearest first.

    `ratio` (M,): of the distance to that of the second nearest of either, in [0, 1]. A match is the clearer the smaller
    it is: more are right before the first wrong one comes than of the nearest (experiment topological_nav/matching).
    """

    first: Ints
    second: Ints
    distance: Array
    ratio: Array

    def chosen(self, kept: Bools | Ints) -> "Pairs":
        """Some of them."""
        return Pairs(self.first[kept], self.second[kept], self.distance[kept], self.ratio[kept])


SAME_M = 0.1
"""Distance within which two points are taken for one that was mapped twice (m)."""
NOWHERE = np.empty((0, 3))
"""Points of views whose features are each their own."""
NO_PAIRS = Pairs(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty(0))


@compiled(nogil=True)
def _mutual(
    squares: Floats, ratio: float, points: Array, first: Ints, second: Ints, distance: Array, unclear: Array
) -> int:
    rows, columns = squares.shape
    nearest_row = np.zeros(columns, np.int64)
    least = np.full(columns, np.inf, np.float32)
    next_least = np.full(columns, np.inf, np.float32)
    nearest = np.zeros(rows, np.int64)
    one = np.full(rows, np.inf, np.float32)
    two = np.full(rows, np.inf, np.float32)
    for i in range(rows):
        for j in range(columns):
            d = squares[i, j]
            if d < one[i]:
                two[i], one[i], nearest[i] = one[i], d, j
            elif d < two[i]:
                two[i] = d
            if d < least[j]:
                next_least[j], least[j], nearest_row[j] = least[j], d, i
            elif d < next_least[j]:
                next_least[j] = d
    found = 0
    for i in range(rows):
        j = nearest[i]
        d = max(one[i], np.float32(0.0))
        if len(points) and nearest_row[j] == i:  # the second nearest of those elsewhere
            two[i] = np.inf
            for k in range(columns):
                if squares[i, k] < two[i]:
                    x, y, z = points[k, 0] - points[j, 0], points[k, 1] - points[j, 1], points[k, 2] - points[j, 2]
                    if x * x + y * y + z * z > SAME_M * SAME_M:
                        two[i] = squares[i, k]
        if nearest_row[j] == i and d < ratio * ratio * two[i] and d < ratio * ratio * next_least[j]:
            first[found], second[found], distance[found] = i, j, np.sqrt(d)
            rival = min(two[i], next_least[j])
            unclear[found] = np.sqrt(d / rival) if rival > 0.0 else 1.0
            found += 1
    return found


def mutual_nearest(squares: Floats, ratio: float, points: Array = NOWHERE) -> Pairs:
    """Pairs of which each is the other's nearest, and by `ratio` nearer than the second nearest of either.

    `squares` (N, M) float32: squared distances. `points` (M, 3): where the second view's features are (m), where it is
    known; then the second nearest is one that is elsewhere. A row or column without a second nearest passes the
    ratio. (Goedemé et al. 2007, section 3.4.)
    """
    rows, columns = squares.shape
    if not rows or not columns:
        return NO_PAIRS
    first, second = np.empty((2, rows), np.int64)
    distance, unclear = np.empty((2, rows))
    found = _mutual(squares, ratio, points, first, second, distance, unclear)
    order = np.argsort(unclear[:found], kind="stable")
    return Pairs(first[order], second[order], distance[order], unclear[order])


def mutual_nearest_units(one: Floats, other: Floats, ratio: float, points: Array = NOWHERE) -> Pairs:
    """`mutual_nearest` of descriptors (N, D) and (M, D) of length 1."""
    squares: Floats = one @ other.T
    squares *= -2.0
    squares += 2.0
    return mutual_nearest(squares, ratio, points)


@compiled(nogil=True)
def _mutual_of_each(
    squares: Floats, starts: Ints, ratio: float, first: Ints, second: Ints, unclear: Array, found: Ints
) -> None:
    distance = np.empty(len(squares))
    for n in range(len(starts) - 1):
        a, b = starts[n], starts[n + 1]
        found[n] = _mutual(squares[a:b], ratio, NOWHERE, first[a:b], second[a:b], distance[a:b], unclear[a:b])


def mutual_nearest_of_each(squares: Floats, starts: Ints, ratio: float) -> tuple[Ints, Ints, Ints]:
    """`mutual_nearest` of several first views with one second view.

    `squares` (N, M) float32; of view v the rows `starts[v]` to `starts[v + 1]`. Returns the view, the row and the
    column of each pair: (K,), view by view, the clearest first.
    """
    rows, views = len(squares), len(starts) - 1
    first, second = np.empty((2, rows), np.int64)
    unclear, found = np.empty(rows), np.zeros(views, np.int64)
    if squares.size:
        _mutual_of_each(squares, starts, ratio, first, second, unclear, found)
    view = np.repeat(np.arange(views), found)
    at = np.arange(len(view)) + np.repeat(starts[:-1] - np.cumsum(found) + found, found)
    order = np.lexsort((unclear[at], view))
    at = at[order]
    return view, first[at] + starts[view], second[at]


def squared_distances(one: npt.ArrayLike, other: npt.ArrayLike) -> Floats:
    """Squared Euclidean distances (N, M) float32 of rows (N, D) and (M, D); exact for whole numbers as SIFT's."""
    a, b = np.asarray(one, np.float32), np.asarray(other, np.float32)
    squares: Floats = a @ b.T
    squares *= -2.0
    squares += np.einsum("nd,nd->n", a, a)[:, None]
    squares += np.einsum("nd,nd->n", b, b)
    return squares


def spreads(*parts: Floats) -> Floats:
    """Standard deviation (D,) of each element over the rows of all parts together; 1 where it does not vary."""
    spread = np.concatenate(parts).std(axis=0, dtype=np.float64)
    return np.where(spread > 1e-9, spread, 1.0).astype(np.float32)


def mahalanobis_matches(one: Floats, other: Floats, ratio: float, search: Literal["all", "kd_tree"] = "all") -> Pairs:
    """`mutual_nearest` of rows (N, D) and (M, D) in which each element counts by its spread over both.

    d_ij = sqrt(sum_k (x_ik - x_jk)^2 / sigma_k^2) (Goedemé et al. 2007, section 3.4, equation 2 as erratum 26 in
    docs/papers.md reads it). `search`: through all rows, or by kd-trees.
    """
    if not len(one) or not len(other):
        return NO_PAIRS
    sigma = spreads(one, other)
    if search == "kd_tree":
        return tree_matches(one / sigma, other / sigma, ratio)
    return mutual_nearest(squared_distances(one / sigma, other / sigma), ratio)


def one_way_matches(one: npt.ArrayLike, other: npt.ArrayLike, ratio: float) -> Pairs:
    """For each of the rows (N, D) the nearest of (M, D), where it is by `ratio` nearer than the second nearest (Lowe).

    Several may have the same partner. With a single row to choose from there is no second nearest: no pair.
    """
    squares = np.maximum(squared_distances(one, other), np.float32(0.0)).astype(np.float64)
    if not len(squares) or squares.shape[1] < 2:
        return NO_PAIRS
    nearest = squares.argmin(axis=1)
    two = np.sqrt(np.partition(squares, 1, axis=1)[:, :2])
    ratios = np.divide(two[:, 0], two[:, 1], out=np.ones(len(two)), where=two[:, 1] > 0.0)
    kept = np.flatnonzero(ratios <= ratio)
    order = kept[np.argsort(ratios[kept], kind="stable")]
    return Pairs(order, nearest[order].astype(np.int64), two[order, 0], ratios[order])


def tree_matches(one: npt.ArrayLike, other: npt.ArrayLike, ratio: float) -> Pairs:
    """The pairs of `mutual_nearest` by a kd-tree over each view: exact, and quicker only for few elements D."""
    a, b = np.asarray(one, np.float64), np.asarray(other, np.float64)
    if not len(a) or not len(b):
        return NO_PAIRS
    gap, nearest = _two_nearest(b, a)
    back_gap, back = _two_nearest(a, b)
    first = np.arange(len(a))
    second = nearest[:, 0]
    kept = back[second, 0] == first
    rival = np.minimum(gap[:, 1], back_gap[second, 1])
    kept &= gap[:, 0] < ratio * rival
    unclear = np.divide(gap[:, 0], rival, out=np.ones(len(a)), where=rival > 0.0)
    order = np.flatnonzero(kept)[np.argsort(unclear[kept], kind="stable")]
    return Pairs(first[order], second[order].astype(np.int64), gap[order, 0], unclear[order])


def _two_nearest(stored: Array, asked: Array) -> tuple[Array, Ints]:
    from scipy.spatial import KDTree  # slow to import, and seldom needed

    tree = KDTree(stored)
    gap, nearest = tree.query(asked, k=2)
    return gap, nearest

"""Views described by segments around the robot: turning and comparing them."""

import functools
import math
from typing import Literal

import numpy as np

from omninav.pipeline import StoredRows
from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Floats, Ints

from .best_segments import UNROLLED, selective_sum, sorting_network

Rows = Floats | StoredRows[np.float32]
"""Views of a map, in memory or in its file."""

BLOCK = 96
"""References that are compared at once: few enough for what belongs to a segment to stay in the fastest cache, and no
power of two, whose rows would share the cache's lines."""

HEADINGS = 36
"""Headings at which the views of a map are compared with each other: 10 degrees apart."""

EXPONENTS = {"sqrt": 0.5, "cube_root": 1.0 / 3.0, "three_quarters": 0.75, "none": 0.0}
"""Penalties on the number k of segments by name: the exponent of 1 / k (the rest of 1 goes to 1 / n)."""

MAX_COLOUR_DISTANCE = float(np.sqrt(3.0) * 255.0)
"""Distance of black and white in blue-green-red 0..255."""

FeatureKind = Literal["histograms", "colours", "descriptors"]
"""Descriptions of segments: histograms that sum to 1, colours in 0..255, or vectors of length 1."""

MAX_DISTANCES: dict[FeatureKind, float] = {
    "histograms": float(np.sqrt(2.0)),
    "colours": MAX_COLOUR_DISTANCE,
    "descriptors": 2.0,
}
"""The largest distance that two segments of a kind can have."""


def turned_views(view: Floats, headings: int) -> Floats:
    """Rotates a view by each heading: (segments, bins) -> (headings, segments, bins).

    Row h is what a robot at the same place would see whose heading is 2 pi h / headings (counter-clockwise) *less*: a
    turn to the left moves the scene to higher segments, so row h takes segment j from j + h segments / headings.
    Fractions of a segment are interpolated between the two neighbours (erratum 24 in docs/papers.md), so that
    histograms still sum to 1.
    """
    return _shifted(view[None], np.arange(headings) * len(view) / headings)


def _shifted(views: Floats, shifts: Array) -> Floats:
    # Segment j of each view (N or 1, segments, bins) from where segment j + shift was, by each of the shifts (N,).
    segments, rows = views.shape[1], np.arange(len(views))[:, None]
    whole = np.floor(shifts).astype(np.int64)
    part = (shifts - whole).astype(np.float32)[:, None, None]
    first = (np.arange(segments) + whole[:, None]) % segments
    return np.asarray(views[rows, first] * (1 - part) + views[rows, (first + 1) % segments] * part)


def penalties(segments: int, exponent: float) -> Floats:
    """Factor of the sum of the k best segments, k = 1..segments: k^-exponent n^-(1-exponent); at k = n it is 1 / n."""
    k = np.arange(1, segments + 1)
    return np.asarray(k**-exponent * float(segments) ** (exponent - 1.0), np.float32)


def _turned_rows(view: Floats, headings: int) -> tuple[Floats, Ints]:
    """The rows of `turned_views`, each once: (rows, bins), and which is whose: (headings, segments)."""
    segments = len(view)
    parts = headings // math.gcd(headings, segments)  # a turn is a multiple of so small a part of a segment
    turned = turned_views(view, headings) if parts > 1 else view[None]
    which = _positions(segments, headings, parts)
    if parts == 1:
        return view, which
    rows = np.empty((segments * parts, view.shape[1]), np.float32)
    rows[which] = turned
    return rows, which


@functools.cache
def _positions(segments: int, headings: int, parts: int) -> Ints:
    return (np.arange(segments) * parts + np.arange(headings)[:, None] * segments * parts // headings) % (
        segments * parts
    )


@compiled(nogil=True)
def _compare(
    references: Floats,
    rows: Floats,
    which: Ints,
    histograms: bool,
    network: Ints,
    factors: Floats,
    unrolled: tuple[np.float32, ...],
    scale: np.float32,
    out: Floats,
) -> None:
    # References are the innermost axis throughout: each loop over them is vector instructions, the sorting too.
    headings, segments = which.shape
    bins = rows.shape[1]
    block = np.zeros((bins, BLOCK), np.float32)
    alike = np.empty((headings, segments, BLOCK), np.float32)
    total = np.empty(BLOCK, np.float32)
    best = np.empty(BLOCK, np.float32)
    zero = np.float32(0)
    # The bins of each row that hold anything, since nothing is common in the others; they are read by fours.
    filled = np.zeros((len(rows), bins + 4), np.int64)
    held = np.zeros((len(rows), bins + 4), np.float32)
    numbers = np.zeros(len(rows), np.int64)
    for u in range(len(rows)):
        for b in range(bins):
            if rows[u, b] != zero:
                filled[u, numbers[u]], held[u, numbers[u]] = b, rows[u, b]
                numbers[u] += 1
    for start in range(0, len(references), BLOCK):
        count = min(BLOCK, len(references) - start)
        for j in range(segments):
            for n in range(count):
                reference = references[start + n, j]
                for b in range(bins):
                    block[b, n] = reference[b]
            for h in range(headings):
                row, u = alike[h, j], which[h, j]
                for n in range(BLOCK):
                    row[n] = zero
                if histograms:
                    # Four bins at once load and store the sums a quarter as often; their order stays.
                    for b in range(0, numbers[u], 4):
                        r0, r1 = block[filled[u, b]], block[filled[u, b + 1]]
                        r2, r3 = block[filled[u, b + 2]], block[filled[u, b + 3]]
                        v0, v1, v2, v3 = held[u, b], held[u, b + 1], held[u, b + 2], held[u, b + 3]
                        for n in range(BLOCK):
                            row[n] = (
                                row[n]
                                + (r0[n] if r0[n] < v0 else v0)
                                + (r1[n] if r1[n] < v1 else v1)
                                + (r2[n] if r2[n] < v2 else v2)
                                + (r3[n] if r3[n] < v3 else v3)
                            )
                else:
                    for b in range(bins):
                        r0, v0 = block[b], rows[u, b]
                        for n in range(count):
                            gap = v0 - r0[n]
                            row[n] += gap * gap
                    for n in range(count):
                        row[n] = max(np.float32(1) - np.sqrt(row[n]) / scale, zero)
        for h in range(headings):
            if len(unrolled) > 1:
                for n in range(BLOCK):
                    best[n] = selective_sum(alike, h, n, unrolled)
            else:
                for p in range(len(network)):
                    high, low = alike[h, network[p, 0]], alike[h, network[p, 1]]
                    for n in range(count):
                        a, b_ = high[n], low[n]
                        high[n] = a if a > b_ else b_
                        low[n] = b_ if a > b_ else a
                total[:] = zero
                best[:] = zero
                for k in range(segments):
                    row, factor = alike[h, k], factors[k]
                    for n in range(count):
                        total[n] += row[n]
                        score = total[n] * factor
                        best[n] = score if score > best[n] else best[n]
            for n in range(count):
                out[start + n, h] = min(best[n], np.float32(1))


def similarities(
    references: Rows,
    view: Floats,
    headings: int,
    kind: FeatureKind,
    exponent: float | None = 0.5,
    chosen: Ints | None = None,
    max_distance: float | None = None,
) -> Floats:
    """Similarity of a view to references at equally spaced headings: (chosen, headings) float32 in [0, 1].

    `references` (R, segments, bins) and `view` (segments, bins): histograms that sum to 1 per segment (compared by
    intersection), or others (s_j = 1 - |difference| / max_distance, by default the largest possible; not below 0).
    S = max_k (sum of the k largest s_j) k^-exponent n^-(1-exponent), all k tried, since S(k) is not unimodal (Gross &
    Koenig 2004, section 2; errata 20, 21); with exponent None the mean of all s_j. `chosen`: indices of the references
    to compare; None means all. Column h is a robot heading 2 pi h / headings more than the reference's own.
    """
    some = references[:] if chosen is None else references[chosen]
    out = np.empty((len(some), headings), np.float32)
    rows, which = _turned_rows(np.ascontiguousarray(view, np.float32), headings)
    network, factors, unrolled = _best_of(len(view), exponent)
    histograms, scale = kind == "histograms", np.float32(max_distance or MAX_DISTANCES[kind])
    _compare(np.ascontiguousarray(some, np.float32), rows, which, histograms, network, factors, unrolled, scale, out)
    return out


@functools.cache
def _best_of(segments: int, exponent: float | None) -> tuple[Ints, Floats, tuple[np.float32, ...]]:
    """Network, penalties, and the same as a tuple where segments are sorted in registers."""
    if exponent is not None:
        factors = penalties(segments, exponent)
        return sorting_network(segments), factors, tuple(factors) if segments in UNROLLED else (np.float32(0),)
    factors = np.zeros(segments, np.float32)
    factors[-1] = 1.0 / segments
    return np.empty((0, 2), np.int64), factors, (np.float32(0),)


def max_distance_of(segments: int, kind: FeatureKind) -> float:
    """The largest distance of two views: sqrt(2 n) for n histograms, sqrt(3 n) 255 for n colours, 2 sqrt(n) for n unit
    vectors."""
    return float(np.sqrt(segments) * MAX_DISTANCES[kind])


def euclidean_similarities(
    references: Rows, view: Floats, headings: int, kind: FeatureKind, chosen: Ints | None = None
) -> Floats:
    """1 - |difference| / the largest possible one, over whole views: (chosen, headings) float32 in [0, 1].

    The non-selective comparison by the L2 norm of the difference vector (Gross & Koenig 2004, section 2).
    """
    some = references[:] if chosen is None else references[chosen]
    query = turned_views(view, headings).reshape(headings, -1)
    flat = np.ascontiguousarray(some, np.float32).reshape(len(some), -1)
    # |a - b|^2 = a.a + b.b - 2 a.b
    squared = (flat * flat).sum(axis=1)[:, None] + (query * query).sum(axis=1) - 2 * (flat @ query.T)
    largest = max_distance_of(len(view), kind)
    alike: Floats = (1.0 - np.sqrt(np.maximum(squared, 0.0)) / largest).astype(np.float32)
    return np.clip(alike, 0.0, 1.0)


def cosine_similarities(references: Rows, view: Floats, headings: int, chosen: Ints | None = None) -> Floats:
    """Cosine of the angle between whole views as vectors, not below 0: (chosen, headings) float32 in [0, 1].

    `references` (R, segments, bins), `view` (segments, bins), of any kind and length; a view of zeros is like nothing.
    """
    some = references[:] if chosen is None else references[chosen]
    query = turned_views(view, headings).reshape(headings, -1)
    flat = np.ascontiguousarray(some, np.float32).reshape(len(some), -1)
    lengths = np.linalg.norm(flat, axis=1)[:, None] * np.linalg.norm(query, axis=1)
    alike: Floats = ((flat @ query.T) / np.where(lengths > 0.0, lengths, 1.0)).astype(np.float32)
    return np.clip(alike, 0.0, 1.0)


def similarity_at(references: Floats, view: Floats, turns: Array, kind: FeatureKind) -> Floats:
    """Selective similarity of a view to each reference at one heading each: (N, segments, bins), (N,) turns -> (N,).

    `turns`: the robot's heading less the reference's own (radians).
    """
    segments = len(view)
    expected = _shifted(references, -turns * segments / (2 * np.pi))
    if kind == "histograms":
        alike = np.minimum(expected, view).sum(axis=2)
    else:
        alike = 1.0 - np.sqrt(np.square(expected - view).sum(axis=2)) / MAX_DISTANCES[kind]
    best = np.cumsum(np.sort(alike, axis=1)[:, ::-1], axis=1) * penalties(segments, EXPONENTS["sqrt"])
    return np.asarray(best.max(axis=1), np.float32)

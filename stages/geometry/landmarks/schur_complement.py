"""Normal equations of landmarks and the references that see them, with the landmarks eliminated.

A residual is the ray to a landmark less the bearing along which it is seen, both of length 1 and in the map's frame:
its length is the angle between them, for small angles. The landmarks are independent of each other given all the rest,
so each is eliminated by its own block of 3 x 3, and a sparse system of references remains (Triggs, McLauchlan, Hartley
& Fitzgibbon 2000, section 6.1).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Ints

TINY = 1e-12
"""Added to the diagonal of a landmark's block (1/m^2), which is singular where all its bearings are parallel."""


class Sightings(NamedTuple):
    """Which reference sees which landmark, sorted by landmark and reference.

    `references` (O,); `starts` (L + 1,): of landmark l the rows `starts[l]` to `starts[l + 1]`.
    """

    references: Ints
    starts: Ints


class Poses(NamedTuple):
    """The references in the map's frame: `positions` (R, 3), `rotations` (R, 3, 3) from their own frames.

    `axes` (R, A, 3): unit axes about which each may turn. `rises`: whether each may move up and down too, the last of
    its freedoms.
    """

    positions: Array
    rotations: Array
    axes: Array
    rises: bool


class Eliminated(NamedTuple):
    """The system that remains of F freedoms of R references and K of the camera, and what leads back to the landmarks.

    `diagonal` (R, F, F) and `upper` (E, F, F): blocks of the matrix, the latter in the order of the pattern; `border`
    (R, F, K), `corner` (K, K); `right` (R, F), `right_camera` (K,): gradients. `curvature` (R, F), `curvature_camera`
    (K,): diagonals before the elimination, for damping. Of each landmark: `inverse` (L, 3, 3), `slope` (L, 3), `shared`
    (L, 3, K), and of each sighting `mixed` (O, F, 3).
    """

    diagonal: Array
    upper: Array
    border: Array
    corner: Array
    right: Array
    right_camera: Array
    curvature: Array
    curvature_camera: Array
    inverse: Array
    slope: Array
    shared: Array
    mixed: Array


def covisibility(sightings: Sightings, references: int) -> tuple[Ints, Ints]:
    """Which later references share a landmark with each: `starts` (R + 1,) into the sorted `others` (E,)."""
    from scipy import sparse  # slow to import, and seldom needed

    ones = np.ones(len(sightings.references), np.int32)
    shape = (len(sightings.starts) - 1, references)
    seen: Any = sparse.csr_array((ones, sightings.references, sightings.starts), shape=shape)
    shared = sparse.triu(seen.T @ seen, 1, format="csr")
    shared.sort_indices()
    return shared.indptr.astype(np.int64), shared.indices.astype(np.int64)


@compiled(nogil=True)
def residuals(
    positions: Array, rotations: Array, points: Array, references: Ints, starts: Ints, bearings: Array
) -> Array:
    """Rays to the landmarks less the bearings (O, 3), in the map's frame."""
    out = np.empty((len(references), 3))
    for landmark in range(len(starts) - 1):
        for n in range(starts[landmark], starts[landmark + 1]):
            r = references[n]
            x, y = points[landmark, 0] - positions[r, 0], points[landmark, 1] - positions[r, 1]
            z = points[landmark, 2] - positions[r, 2]
            far = math.sqrt(x * x + y * y + z * z) + 1e-300
            out[n, 0], out[n, 1], out[n, 2] = x / far, y / far, z / far
            for i in range(3):
                for k in range(3):
                    out[n, i] -= rotations[r, i, k] * bearings[n, k]
    return out


def eliminate(
    frames: Poses, points: Array, sightings: Sightings, bearings: Array, lens: Array, weights: Array, damping: float,
    pattern: tuple[Ints, Ints],
) -> Eliminated:  # fmt: skip
    """The system of all references and the camera, of which each landmark's block is damped by a factor 1 + `damping`.

    `points` (L, 3); `bearings` (O, 3), `lens` (O, 3, K): their derivatives by the camera's parameters, both in the
    reference's frame; `weights` (O,).
    """
    number, freedoms = len(frames.positions), 2 + frames.axes.shape[1] + frames.rises
    shared = lens.shape[2]
    out = Eliminated(
        np.zeros((number, freedoms, freedoms)),
        np.zeros((len(pattern[1]), freedoms, freedoms)),
        np.zeros((number, freedoms, shared)),
        np.zeros((shared, shared)),
        np.zeros((number, freedoms)),
        np.zeros(shared),
        np.zeros((number, freedoms)),
        np.zeros(shared),
        np.zeros((len(points), 3, 3)),
        np.zeros((len(points), 3)),
        np.zeros((len(points), 3, shared)),
        np.zeros((len(bearings), freedoms, 3)),
    )
    _eliminate(*frames[:3], points, *sightings, bearings, lens, weights, damping, *pattern, *out)
    return out


def landmark_steps(system: Eliminated, sightings: Sightings, steps: Array, camera: Array) -> Array:
    """Steps of the landmarks (L, 3) that go with those of the references (R, F) and of the camera (K,)."""
    gradient = system.slope + system.shared @ camera
    back = np.einsum("ofk,of->ok", system.mixed, steps[sightings.references])
    if len(back):
        gradient = gradient + np.add.reduceat(back, sightings.starts[:-1])
    return np.asarray(np.einsum("lij,lj->li", system.inverse, -gradient))


@compiled(nogil=True)
def _inverted(m: Array, out: Array) -> None:
    # Inverse of a symmetric matrix (3, 3) by its adjugate.
    a, b, c, d, e, f = m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2]
    p, q, s = d * f - e * e, c * e - b * f, b * e - c * d
    rest = 1.0 / (a * p + b * q + c * s)
    out[0, 0], out[0, 1], out[0, 2] = p * rest, q * rest, s * rest
    out[1, 0], out[1, 1], out[1, 2] = q * rest, (a * f - c * c) * rest, (b * c - a * e) * rest
    out[2, 0], out[2, 1], out[2, 2] = s * rest, (b * c - a * e) * rest, (a * d - b * b) * rest


@compiled(nogil=True)
def _eliminate(
    positions: Array, rotations: Array, axes: Array, points: Array, references: Ints, starts: Ints, bearings: Array,
    lens: Array, weights: Array, damping: float, others_starts: Ints, others: Ints,
    diagonal: Array, upper: Array, border: Array, corner: Array, right: Array, right_camera: Array, curvature: Array,
    curvature_camera: Array, inverse: Array, slope: Array, shared: Array, mixed: Array,
) -> None:  # fmt: skip
    turns, cameras = axes.shape[1], lens.shape[2]
    freedoms = mixed.shape[1]
    slide, block = np.empty((3, 3)), np.empty((3, 3))
    ray, seen, miss = np.empty(3), np.empty(3), np.empty(3)
    row, look = np.empty((3, freedoms)), np.empty((3, cameras))
    for landmark in range(len(points)):
        begin, end = starts[landmark], starts[landmark + 1]
        block[:] = 0.0
        for n in range(begin, end):
            r, weight = references[n], weights[n]
            far = 0.0
            for i in range(3):
                ray[i] = points[landmark, i] - positions[r, i]
                far += ray[i] * ray[i]
            far = math.sqrt(far) + 1e-300
            for i in range(3):
                ray[i] /= far
                seen[i] = 0.0
                for k in range(3):
                    seen[i] += rotations[r, i, k] * bearings[n, k]
                miss[i] = ray[i] - seen[i]
            for i in range(3):
                for k in range(3):
                    slide[i, k] = ((1.0 if i == k else 0.0) - ray[i] * ray[k]) / far
                row[i, 0], row[i, 1] = -slide[i, 0], -slide[i, 1]
                if freedoms > 2 + turns:
                    row[i, 2 + turns] = -slide[i, 2]
            for k in range(turns):
                x, y, z = axes[r, k, 0], axes[r, k, 1], axes[r, k, 2]
                row[0, 2 + k] = z * seen[1] - y * seen[2]
                row[1, 2 + k] = x * seen[2] - z * seen[0]
                row[2, 2 + k] = y * seen[0] - x * seen[1]
            for k in range(cameras):
                for i in range(3):
                    look[i, k] = 0.0
                    for j in range(3):
                        look[i, k] -= rotations[r, i, j] * lens[n, j, k]
            for i in range(3):
                for k in range(3):
                    block[i, k] += weight * slide[i, k] / far  # slide is a projection over far: slide' slide
                    slope[landmark, i] += weight * slide[k, i] * miss[k]
            for f in range(freedoms):
                for i in range(3):
                    right[r, f] += weight * row[i, f] * miss[i]
                    for k in range(3):
                        mixed[n, f, k] += weight * row[i, f] * slide[i, k]
                    for g in range(freedoms):
                        diagonal[r, f, g] += weight * row[i, f] * row[i, g]
                    for k in range(cameras):
                        border[r, f, k] += weight * row[i, f] * look[i, k]
            for k in range(cameras):
                for i in range(3):
                    right_camera[k] += weight * look[i, k] * miss[i]
                    for j in range(3):
                        shared[landmark, j, k] += weight * look[i, k] * slide[i, j]
                    for j in range(cameras):
                        corner[k, j] += weight * look[i, k] * look[i, j]
        for i in range(3):
            block[i, i] = block[i, i] * (1.0 + damping) + TINY
        _inverted(block, inverse[landmark])
    for r in range(len(positions)):
        for f in range(freedoms):
            curvature[r, f] = diagonal[r, f, f]
    for k in range(cameras):
        curvature_camera[k] = corner[k, k]
    part, through = np.empty((freedoms, 3)), np.empty((3, cameras))
    for landmark in range(len(points)):
        begin, end = starts[landmark], starts[landmark + 1]
        for i in range(3):
            for k in range(cameras):
                through[i, k] = 0.0
                for j in range(3):
                    through[i, k] += inverse[landmark, i, j] * shared[landmark, j, k]
        for k in range(cameras):
            for i in range(3):
                right_camera[k] -= through[i, k] * slope[landmark, i]
                for j in range(cameras):
                    corner[k, j] -= through[i, k] * shared[landmark, i, j]
        for n in range(begin, end):
            r = references[n]
            for f in range(freedoms):
                for k in range(3):
                    part[f, k] = (
                        mixed[n, f, 0] * inverse[landmark, 0, k]
                        + mixed[n, f, 1] * inverse[landmark, 1, k]
                        + mixed[n, f, 2] * inverse[landmark, 2, k]
                    )
                for i in range(3):
                    right[r, f] -= part[f, i] * slope[landmark, i]
                    for k in range(cameras):
                        border[r, f, k] -= part[f, i] * shared[landmark, i, k]
            at = others_starts[r]
            for m in range(n, end):
                other = references[m]
                if other == r:
                    for f in range(freedoms):
                        for g in range(freedoms):
                            both = (
                                part[f, 0] * mixed[m, g, 0] + part[f, 1] * mixed[m, g, 1] + part[f, 2] * mixed[m, g, 2]
                            )
                            diagonal[r, f, g] -= both
                            if m != n:
                                diagonal[r, g, f] -= both
                    continue
                at += np.searchsorted(others[at : others_starts[r + 1]], other)
                for f in range(freedoms):
                    for g in range(freedoms):
                        upper[at, f, g] -= (
                            part[f, 0] * mixed[m, g, 0] + part[f, 1] * mixed[m, g, 1] + part[f, 2] * mixed[m, g, 2]
                        )

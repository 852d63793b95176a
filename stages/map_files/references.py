"""Maps of references, joined, thinned and cut."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from omninav.pipeline import BadInput, GatheredRows, StoredRows
from omninav.stages.geometry.appearance.segments import Rows
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import PoseSource

from .joined_landmarks import joined_landmarks

OTHER_VIEW = math.radians(30.0)
"""Difference in direction (rad) from which views in one direction only show something else."""


def joined_references(maps: Sequence[ReferenceGraph], pose_source: PoseSource) -> ReferenceGraph:
    """One map of the references, edges and landmarks of several, in their order.

    Raises BadInput where their features differ.
    """
    filled = [map for map in maps if len(map)] or list(maps[:1])
    first = filled[0]
    for number, map in enumerate(maps):
        if len(map) and (map.kind, map.features.shape[1:]) != (first.kind, first.features.shape[1:]):
            (segments, bins), (own_segments, own_bins) = first.features.shape[1:], map.features.shape[1:]
            raise BadInput(
                f"map {number + 1}: its views are {map.kind} of {own_segments} segments x {own_bins} bins, those of "
                f"the first are {first.kind} of {segments} x {bins}; maps join where their features are the same"
            )
    starts = np.cumsum([0, *(len(map) for map in filled)])
    return ReferenceGraph(
        np.concatenate([map.poses for map in filled]),
        gathered([(map.features, np.arange(len(map))) for map in filled]),
        first.kind,
        np.concatenate([map.edges + start for map, start in zip(filled, starts[:-1], strict=True)]),
        pose_source,
        joined_landmarks(filled),
    )


def thinned_references(map: ReferenceGraph, spacing_m: float) -> ReferenceGraph:
    """A map in which references are at least `spacing_m` apart: each, in their order, takes the place of those around.

    Edges go over to the reference that has taken a place. Of views in one direction (one segment), only those that look
    the same way represent each other.
    """
    keeper = keepers(map.poses, spacing_m, OTHER_VIEW if map.features.shape[1] == 1 else math.pi)
    kept = np.flatnonzero(keeper == np.arange(len(map)))
    row = np.searchsorted(kept, keeper)
    edges = np.sort(row[map.edges], axis=1)
    return _chosen(map, kept, np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0))


def keepers(poses: Array, spacing_m: float, turn: float) -> Ints:
    """For each pose (R, 3) the first kept one within `spacing_m` and `turn` (rad) that represents it: (R,) rows."""
    from scipy.spatial import KDTree  # slow to import, and seldom needed

    keeper = np.full(len(poses), -1)
    tree: Any = KDTree(poses[:, :2])
    for row in range(len(poses)):
        if keeper[row] < 0:
            near = np.array(tree.query_ball_point(poses[row, :2], spacing_m), np.int64)
            near = near[(keeper[near] < 0) & (np.abs(wrap(poses[near, 2] - poses[row, 2])) <= turn)]
            keeper[near] = row
            keeper[row] = row
    return keeper


def cut_references(map: ReferenceGraph, inside: Bools) -> ReferenceGraph:
    """The references of a mask (R,), and the edges between them."""
    kept = np.flatnonzero(inside)
    row = np.cumsum(inside) - 1
    return _chosen(map, kept, row[map.edges[inside[map.edges].all(axis=1)]])


def _chosen(map: ReferenceGraph, kept: Ints, edges: Ints) -> ReferenceGraph:
    landmarks = None if map.landmarks is None else map.landmarks.of_references(kept)
    return ReferenceGraph(
        map.poses[kept], gathered([(map.features, kept)]), map.kind, edges.astype(np.int64), map.pose_source, landmarks
    )


def gathered(parts: Sequence[tuple[Rows, Ints]]) -> Rows:
    """Some rows of some maps' features: in memory where they all are, else gathered where they are needed."""
    if any(isinstance(rows, StoredRows) for rows, _ in parts):
        return GatheredRows(parts)
    return np.concatenate([rows[chosen] for rows, chosen in parts])

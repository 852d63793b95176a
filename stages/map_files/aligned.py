"""Maps without a common frame, brought into one by places that look alike."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.appearance.closures import MIN_GAP, closures_by_appearance
from omninav.stages.geometry.appearance.length_scale import length_scale
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.drive_graph import Closures, closure_sigmas, placed_drives, straightened_drives
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.values.maps import ReferenceGraph

MIN_WEIGHT = 0.1
"""Weight of a closure below which the others have contradicted it."""


class Alignment(NamedTuple):
    """Poses (R, 3) of all references in the frame of the first map, the closures between maps that are left, and which
    of the maps they join."""

    poses: Array
    closures: int
    joined: tuple[bool, ...]


def aligned(maps: Sequence[ReferenceGraph]) -> Alignment | None:
    """Poses of the references of all maps in the frame of the first; None where nothing can be told.

    References of two maps that look alike join them; a pose graph of the ways along each map and of all such pairs,
    within maps and between, gives the poses, as `StraightenMap` does for one. Maps of true poses are moved as a whole.
    """
    sizes = [len(map) for map in maps]
    if not min(sizes) or maps[0].features.shape[1] == 1:
        return None
    scales = [length_scale(map.poses, map.features, map.kind) for map in maps]
    known = [scale for scale in scales if scale is not None]
    if not known:
        return None
    unit = min(known)
    own = np.concatenate([map.poses for map in maps])
    drives = np.repeat(np.arange(len(maps)), sizes)
    steps = between(own[:-1], own[1:])
    steps[np.diff(drives) > 0] = [1e9, 0.0, 0.0]  # no way leads from one map to the next
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
    features = np.concatenate([map.features[:] for map in maps])
    closures = closures_by_appearance(features, maps[0].kind, driven, unit)
    if not len(closures.pairs):
        return None
    poses, joined = placed_drives(own, drives, closures, MIN_GAP * unit)
    across = np.diff(drives[closures.pairs], axis=1)[:, 0] != 0
    if any(map.pose_source == "truth" for map in maps):
        gaps = poses[closures.pairs[:, 0], :2] - poses[closures.pairs[:, 1], :2]
        left = np.hypot(gaps[:, 0], gaps[:, 1]) < MIN_GAP * unit
        return Alignment(poses, int((left & across).sum()), tuple(joined.tolist()))
    motions = np.concatenate([np.zeros((1, 3)), between(own[:-1], own[1:])])
    usable = joined[drives[closures.pairs]].all(axis=1)
    closures = Closures(closures.pairs[usable], closures.turns[usable])
    poses, weights = straightened_drives(poses, drives, closures, *closure_sigmas(unit), motions)
    return Alignment(poses, int(((weights >= MIN_WEIGHT) & across[usable]).sum()), tuple(joined.tolist()))

"""Maps of up to a million references, for benchmarks: a simulated tour in many buildings.

The simulator renders a tour (1787 references, 25 cm apart) and, on another day, a drive through a home store. Further
references are those of the tour in other buildings: for each building hues are shifted, levels of brightness change
places, every second one is mirrored, and the share of each colour is scaled by a random factor (sigma 0.35 in its
logarithm) that changes smoothly along the way (over 60 references) and around the robot.
"""

import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from omninav.pipeline.engine.artifact import read_artifact
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion

BUILDING_M = (110.0, 70.0)
"""Distances between buildings, twelve in a row."""
HUES = 16
"""Of the bins of a histogram, those of the hue, which come first."""
RENDERED = {
    "tour": ("world=home_store", "route=training", "day=0", "nodes.source.stride=4"),
    "drive": ("world=home_store", "route=tt1", "day=1"),
}
START = 60
"""Frames of the drive near whose beginning a map's first thousand references are."""
STEP_M = 0.2


class Frame(NamedTuple):
    """An image of the drive."""

    number: int
    moved: Motion | None
    view: SegmentHistograms
    true: np.ndarray


def views(folder: Path, name: str, *words: str) -> ReferenceGraph:
    """Features and poses of every image of a drive, as a map; made once."""
    file = folder / f"{name}.omap"
    if not file.exists():
        settings = ("map", "variant=omniview_mcl", "nodes.mapping.distance_m=0.001", "plots=none", "cache=null")
        runs = folder / "runs"
        subprocess.run([sys.executable, "-m", "omninav", *settings, *words, f"runs={runs}"], check=True)
        file.write_bytes((runs / "latest" / "map.omap").read_bytes())
    found = read_artifact(file)
    assert isinstance(found, ReferenceGraph)
    return found


def smooth_factors(rng: np.random.Generator, number: int, segments: int, bins: int) -> np.ndarray:
    """Random factors (number, segments, bins) that change smoothly along the way and around the robot."""
    knots = rng.normal(0, 0.35, (number // 60 + 2, 7, bins))
    knots[:, -1] = knots[:, 0]
    along, around = np.arange(number) / 60, np.arange(segments) * 6 / segments
    a, b = along.astype(int), around.astype(int)
    part_a, part_b = (along - a)[:, None, None], (around - b)[None, :, None]
    rows = knots[a] * (1 - part_a) + knots[a + 1] * part_a
    return np.exp(rows[:, b] * (1 - part_b) + rows[:, b + 1] * part_b).astype(np.float32)


def made(tour: ReferenceGraph, drive: ReferenceGraph, references: int) -> ReferenceGraph:
    """A map of so many references, the thousand nearest to the beginning of the drive first."""
    far = KDTree(drive.poses[:START, :2]).query(tour.poses[:, :2])[0]
    first = np.isin(np.arange(len(tour)), np.argsort(far, kind="stable")[:1000])
    order = np.concatenate([np.flatnonzero(first), np.flatnonzero(~first)])
    own, poses = np.asarray(tour.features[:])[order], tour.poses[order]
    features, placed = np.empty((references, *own.shape[1:]), np.float32), np.empty((references, 3))
    rng = np.random.default_rng(0)
    for building, start in enumerate(range(0, references, len(own))):
        stop = min(start + len(own), references)
        found = own[: stop - start]
        if building:
            hue = np.roll(found[..., :HUES], rng.integers(HUES), axis=2)
            level = found[..., HUES:][..., rng.permutation(found.shape[2] - HUES)]
            found = np.concatenate([hue, level], axis=2)[:, :: -1 if building % 2 else 1]
            found = found * smooth_factors(rng, len(found), *found.shape[1:])
            found /= np.maximum(found.sum(axis=2, keepdims=True), 1e-9)
        features[start:stop] = found
        corner = np.array([building % 12 * BUILDING_M[0], building // 12 * BUILDING_M[1], 0.0])
        placed[start:stop] = poses[: stop - start] + corner
    edges = np.empty((0, 2), np.int64)
    return ReferenceGraph(placed, features, "histograms", edges, "truth")


def frames(drive: ReferenceGraph, number: int) -> list[Frame]:
    """Images of the drive, at least 0.2 m apart, with the true motion between them."""
    rows = [0]
    for row, pose in enumerate(drive.poses):
        if np.hypot(*(pose - drive.poses[rows[-1]])[:2]) >= STEP_M:
            rows.append(row)
    found = []
    for n, row in enumerate(rows[:number]):
        moved = Motion(*map(float, between(drive.poses[rows[n - 1]], drive.poses[row]))) if n else None
        found.append(Frame(n, moved, SegmentHistograms(np.asarray(drive.features[row])), drive.poses[row]))
    return found

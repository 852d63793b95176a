"""Checks once whether the poses of a map fit its own images."""

import math

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.appearance.segments import HEADINGS, similarities
from omninav.stages.geometry.appearance.visual_compass import angle_of_peak
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.conflicts import Conflicts
from omninav.stages.values.maps import ReferenceGraph

from .turn_fit import explained

MIN_REFERENCES = 20
"""References without which nothing is judged."""
MAX_COMPARED = 1000
"""References of a larger map that an image is compared with, evenly spaced, beside its neighbours."""
NEIGHBOURS = 4
"""Nearest references whose likeness is looked at."""
MIN_EXTENT_M, MAX_SPACING_M = 0.01, 50.0
"""A map that is smaller is at one place; one whose neighbours are further apart is in another unit."""
OUTLIER = 1000.0
"""A reference this many times further from the middle of the map than half of all is lost."""
MIN_LIKENESS = 0.7
"""Probability that a neighbour in space is more similar than another reference; 0.5 where poses are shuffled."""
MIN_TURN = math.radians(10.0)
"""Turns between neighbours that show in which sense headings are counted (rad), and how many of them are needed."""
MIN_TURNS, REVERSED_GAIN = 10, 0.5
SAMPLES = 50
"""Images of the map, evenly spaced, that are compared with the others."""


class CheckMap(Stage):
    """Compares images of a map with each other: neighbours in space ought to look alike, turned as their headings are.

    Warns where all references are at one place, one is lost, spacings are those of another unit, poses are
    shuffled, or headings are counted clockwise. Views are compared by their best segments, whatever the variant
    compares by. Limits: docs/conflicts.md.
    """

    class Out(Outputs):
        conflicts: Conflicts

    def step(self, ctx: Context, map: ReferenceGraph) -> Out:
        if len(map) < MIN_REFERENCES:
            return self.Out(conflicts=Conflicts((), (), False))
        sentence = of_poses(map.poses)
        if not sentence and map.features.shape[1] > 1:
            sentence = self._of_images(map)
        if sentence:
            ctx.warn(sentence)
        found = (sentence,) if sentence else ()
        return self.Out(conflicts=Conflicts(found, found, bool(found)))

    def _of_images(self, map: ReferenceGraph) -> str:
        number = len(map)
        evenly = np.unique(np.linspace(0, number - 1, min(MAX_COMPARED, number)).astype(np.int64))
        likeness, turned, headings = [], [], []
        for sample in np.unique(np.linspace(0, number - 1, min(SAMPLES, number)).astype(np.int64)).tolist():
            away = np.hypot(*(map.poses - map.poses[sample])[:, :2].T)
            away[sample] = math.inf
            near = np.argsort(away, kind="stable")[:NEIGHBOURS]
            others = np.setdiff1d(evenly, [*near, sample])
            chosen = np.concatenate([near, others])
            values = similarities(map.features, np.asarray(map.features[sample]), HEADINGS, map.kind, chosen=chosen)
            best = values.max(axis=1)
            likeness.append(float((best[: len(near), None] > best[None, len(near) :]).mean()))
            for row, reference in enumerate(near.tolist()):
                turned.append(angle_of_peak(values[row]))
                headings.append(float(wrap(map.poses[sample, 2] - map.poses[reference, 2])))
        like = float(np.mean(likeness))
        if like < MIN_LIKENESS:
            return (
                f"the map's poses do not fit its images: a neighbour in space is more similar than another image in "
                f"{100 * like:.0f} % of the pairs (50 % are chance): check that poses and images are in one order"
            )
        return of_headings(np.array(turned), np.array(headings))


def of_poses(poses: Array) -> str:
    """Sentence on the poses (R, 3) of a map by themselves; "" where nothing is wrong."""
    extent = float(np.hypot(*np.ptp(poses[:, :2], axis=0)))
    if extent < MIN_EXTENT_M:
        return f"all {len(poses)} references of the map are at one place, within {extent:.3g} m: check its positions"
    away = np.hypot(*(poses[:, :2] - np.median(poses[:, :2], axis=0)).T)
    usual, lost = float(np.median(away)), int(away.argmax())
    if away[lost] > OUTLIER * max(usual, MIN_EXTENT_M):
        return (
            f"reference {lost} of the map is {away[lost]:.0f} m from its middle, half of all within {usual:.3g} m: "
            "check its positions"
        )
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    if (spacing := float(np.median(steps))) > MAX_SPACING_M:
        return f"the map's images are {spacing:.3g} m apart, one after the other: check the unit of its positions (m)"
    return ""


def of_headings(turned: Array, headings: Array) -> str:
    """Tells if neighbours look turned (P,) against each other as their `headings` differ (P,), or the other way."""
    known = np.abs(headings) > MIN_TURN
    if known.sum() < MIN_TURNS:
        return ""
    alike, reversed = (float(explained(turned[known], sign * headings[known])) for sign in (1.0, -1.0))
    if reversed - alike < REVERSED_GAIN:
        return ""
    return (
        f"the map's headings turn against its images ({int(known.sum())} pairs of neighbours): its poses are mirrored, "
        "or headings counted clockwise; counter-clockwise is positive"
    )

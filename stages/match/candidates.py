"""Selects the references of a map that are compared with the current view."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs
from omninav.pipeline.engine.compiled import compiled
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.appearance.segments import FeatureKind
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

GOLDEN_RATIO = (math.sqrt(5.0) - 1.0) / 2.0
"""Golden ratio: the fractional parts of its multiples fill an interval evenly."""

CELLS_PER_RADIUS = 4


class Candidates(NamedTuple):
    """References to compare: their indices, ascending, and how many of the map's references each represents.

    Both None: all references are compared.
    """

    chosen: Ints | None = None
    sampling_weight: Array | None = None


def near_belief(
    poses: Array,
    near: Particles | None,
    radius: float,
    recovery_radius: float,
    compare_all_up_to: int,
    background: int,
    turn: int,
) -> Candidates:
    """The references within `radius` metres of any particle, and a sample of `background` others.

    Around recovery particles only references within `recovery_radius` metres are taken: they lie all over the map, and
    only the nearest references matter to them. The background is sampled at equal steps along the map, with another
    offset at each `turn`, so that all references come up; each represents as many as the step is long, and sums with
    `sampling_weight` are unbiased for the whole map. All references are compared where there is no belief, where
    `radius` is 0, where none is near, and where there are at most `compare_all_up_to`.
    """
    if near is None or radius <= 0.0 or len(poses) <= compare_all_up_to:
        return Candidates()
    tracked = len(near.poses) - near.recovery_particles
    near_any = within(poses, near.poses[:tracked], radius) | within(poses, near.poses[tracked:], recovery_radius)
    others = np.flatnonzero(~near_any)
    if len(others) == len(poses) or len(others) <= background:
        return Candidates()
    sampling_weight = near_any.astype(np.float64)
    if background:
        step = len(others) / background
        first = (turn * GOLDEN_RATIO % 1.0) * step
        taken = np.minimum((first + step * np.arange(background)).astype(np.int64), len(others) - 1)
        sampling_weight[others[taken]] = step
    chosen = np.flatnonzero(sampling_weight)
    return Candidates(chosen, sampling_weight[chosen])


def within(poses: Array, places: Array, radius: float) -> npt.NDArray[np.bool_]:
    """Which poses (R, >= 2) lie within `radius` metres of any place (N, >= 2), and some up to 1.36 as far: (R,)."""
    if radius <= 0.0 or not len(places):
        return np.zeros(len(poses), np.bool_)
    cell = radius / CELLS_PER_RADIUS
    cells = np.floor(places[:, :2] / cell).astype(np.int64)
    low = cells.min(axis=0)
    height = int(cells[:, 1].max() - low[1]) + 1
    numbers = np.unique((cells[:, 0] - low[0]) * height + cells[:, 1] - low[1])  # far faster than unique rows
    # A place lies within half a cell's diagonal of its cell's centre: the radius grows by that much.
    found: npt.NDArray[np.bool_] = _near_cells(
        poses[:, :2] / cell - low - 0.5, numbers, height, CELLS_PER_RADIUS + math.sqrt(0.5)
    )
    return found


@compiled(nogil=True)
def _near_cells(points: Array, numbers: Ints, height: int, radius: float) -> npt.NDArray[np.bool_]:
    # In units of cells; cell (i, j) has the number i * height + j, and `numbers` ascend.
    out, columns = np.zeros(len(points), np.bool_), numbers[-1] // height + 1
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        for i in range(max(0, math.ceil(x - radius)), min(columns, math.floor(x + radius) + 1)):
            half = math.sqrt(max(0.0, radius * radius - (x - i) * (x - i)))
            first, last = max(0, math.ceil(y - half)), min(height - 1, math.floor(y + half))
            if first <= last:
                at = np.searchsorted(numbers, i * height + first)
                if at < len(numbers) and numbers[at] <= i * height + last:
                    out[n] = True
                    break
    return out


@dataclass(kw_only=True, eq=False)
class NearBelief:
    """Parameters of stages that compare the references near a belief: a mixin, beside `Stage`.

    Without `near` wired, all references are compared. Radii are in appearance length scales (port `length_scale`).
    """

    headings: Annotated[int, Bounds(ge=1)] = 36
    """Headings at which each reference is compared, evenly spaced over the circle."""
    radius: Annotated[float, Bounds(ge=0)] = 4.5
    """Distance from a particle, in length scales, within which references are compared; 0: all. A sensor that looks
    farther misses some."""
    recovery_radius: Annotated[float, Bounds(ge=0)] = 1.0
    """The same around recovery particles."""
    background_references: Annotated[int, Bounds(ge=0)] = 256
    """References compared of all others, a different sample at each image."""
    compare_all_up_to: Annotated[int, Bounds(ge=0)] = 1000
    """References of a map up to which all are compared."""
    length_scale_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Appearance length scale where the port `length_scale` is not wired."""

    class Out(Outputs):
        """Similarities of view and references."""

        similarities: Similarities

    def candidates(
        self, ctx: Context, map: ReferenceGraph, near: Particles | None, length_scale: LengthScale | None
    ) -> Candidates:
        """The references to compare at this tick."""
        unit = self.length_scale_m if length_scale is None else length_scale.metres
        radius, recovery_radius = self.radius * unit, self.recovery_radius * unit
        sample = self.compare_all_up_to, self.background_references, ctx.tick.index
        return near_belief(map.poses, near, radius, recovery_radius, *sample)


def check_same_kind(features: SegmentFeatures, map: ReferenceGraph) -> FeatureKind:
    """What view and map are described by. Raises BadInput where their features differ."""
    kind = features.kind
    shape = tuple(map.features.shape[1:])
    if len(map) and (map.kind != kind or shape != features.values.shape):
        raise BadInput(
            f"map: its views are {map.kind} of {shape[0]} segments x {shape[1]} bins, the current one is {kind} of "
            f"{features.values.shape[0]} x {features.values.shape[1]}; learn the map anew with these features"
        )
    return kind

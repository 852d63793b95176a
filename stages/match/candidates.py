"""Which references of a map are worth comparing, and whether they can be compared at all."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph, kind_of
from omninav.stages.values.similarity import Similarities

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
"""Multiples of it, less their whole part, fill an interval evenly from the first on."""

CELLS_PER_RADIUS = 4


class Candidates(NamedTuple):
    """References to compare: their indices, ascending, and how many of the map's each stands for.

    Both None: all of them, each for itself.
    """

    chosen: Ints | None = None
    sampling_weight: Array | None = None


def near_belief(
    poses: Array, near: Particles | None, radius: float, aside: float, whole: int, strangers: int, turn: int
) -> Candidates:
    """The references within `radius` metres of any particle, and `strangers` of the others.

    Around particles set aside only those within `aside` metres are taken: such hypotheses lie all over the map, and
    what they are weighed by lies next to them. Strangers are taken at equal steps along the map, others at each `turn`,
    so that all of them have their turn; each stands for as many as the step is long, and sums with `sampling_weight` are
    unbiased for the whole map. All references are compared where there is no belief, where `radius` is 0, where none is
    near, and where there are at most `whole`.
    """
    if near is None or radius <= 0.0 or len(poses) <= whole:
        return Candidates()
    tracked = len(near.poses) - near.recovery_particles
    near_any = within(poses, near.poses[:tracked], radius) | within(poses, near.poses[tracked:], aside)
    others = np.flatnonzero(~near_any)
    if len(others) == len(poses) or len(others) <= strangers:
        return Candidates()
    sampling_weight = near_any.astype(np.float64)
    if strangers:
        step = len(others) / strangers
        first = (turn * GOLDEN % 1.0) * step
        taken = np.minimum((first + step * np.arange(strangers)).astype(np.int64), len(others) - 1)
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


@numba.njit(cache=True, nogil=True)
def _near_cells(points: Array, numbers: Ints, height: int, reach: float) -> npt.NDArray[np.bool_]:
    # In units of cells; cell (i, j) has the number i * height + j, and `numbers` ascend.
    out, columns = np.zeros(len(points), np.bool_), numbers[-1] // height + 1
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        for i in range(max(0, math.ceil(x - reach)), min(columns, math.floor(x + reach) + 1)):
            half = math.sqrt(max(0.0, reach * reach - (x - i) * (x - i)))
            first, last = max(0, math.ceil(y - half)), min(height - 1, math.floor(y + half))
            if first <= last:
                at = np.searchsorted(numbers, i * height + first)
                if at < len(numbers) and numbers[at] <= i * height + last:
                    out[n] = True
                    break
    return out


@dataclass(kw_only=True, eq=False)
class NearBelief:
    """What stages that compare the references near a belief have in common: a mixin, beside `Stage`.

    `headings`: how many turns of each reference are compared. `radius`: with `near` wired, references within so many
    reaches (port `reach`, else of `reach_m`) of a particle are compared, within `radius_aside` of one that is set
    aside, and `strangers` of the others, in turns, which stand for all of them; in maps of up to `whole_up_to`
    references all are; 0 compares all. A sensor that looks farther than `radius` misses some.
    """

    headings: Annotated[int, Bounds(ge=1)] = 36
    radius: Annotated[float, Bounds(ge=0)] = 4.5
    radius_aside: Annotated[float, Bounds(ge=0)] = 1.0
    strangers: Annotated[int, Bounds(ge=0)] = 256
    whole_up_to: Annotated[int, Bounds(ge=0)] = 1000
    reach_m: Annotated[float, Bounds(gt=0)] = 0.5

    class Out(Outputs):
        """How alike view and references are."""

        similarities: Similarities

    def candidates(
        self, ctx: Context, map: ReferenceGraph, near: Particles | None, reach: LengthScale | None
    ) -> Candidates:
        """The references to compare at this tick."""
        unit = self.reach_m if reach is None else reach.metres
        radius, aside = self.radius * unit, self.radius_aside * unit
        return near_belief(map.poses, near, radius, aside, self.whole_up_to, self.strangers, ctx.tick.index)


def check_alike(features: SegmentFeatures, map: ReferenceGraph) -> bool:
    """Whether view and map are histograms (else colours). Raises BadInput where they do not describe views alike."""
    kind = kind_of(features)
    shape = tuple(map.features.shape[1:])
    if len(map) and (map.kind != kind or shape != features.values.shape):
        raise BadInput(
            f"map: its views are {map.kind} of {shape[0]} segments x {shape[1]} bins, the present one is {kind} of "
            f"{features.values.shape[0]} x {features.values.shape[1]}; learn the map anew with these features"
        )
    return kind == "histograms"

"""The references around a belief, and what choices of references have in common."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs
from omninav.stages.geometry.arrays import Ints
from omninav.stages.geometry.plane.point_cells import distinct, sort_into_cells, within
from omninav.stages.values.belief import Particles
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.maps import ReferenceGraph

BACKGROUND_REFERENCES = 128
"""References compared of all that are neither near the belief nor similar, the same at each image."""


@dataclass(kw_only=True, eq=False)
class AroundBelief:
    """Selects the references within a radius of any particle, beside those that a stage finds anywhere in the map.

    A mixin, beside `Stage`. A belief may be wrong, so it never chooses alone. Around recovery particles only the
    nearest references are taken: they are all over the map, and only the nearest matter to them. Radii are in
    appearance length scales (port `length_scale`).
    """

    radius: Annotated[float, Bounds(gt=0)] = 4.5
    """Distance from a particle, in length scales, within which references are compared. A sensor that looks farther
    misses some."""
    recovery_radius: Annotated[float, Bounds(ge=0)] = 1.0
    """The same around recovery particles."""
    compare_all_up_to: Annotated[int, Bounds(ge=0)] = 1000
    """References of a map up to which all are compared."""

    class Out(Outputs):
        candidates: Candidates

    def setup(self, ctx: Context) -> None:
        self._map: ReferenceGraph | None = None
        self._length = 0

    def around(self, map: ReferenceGraph, near: Particles | None, length_scale: LengthScale | None) -> Ints:
        """The references near the belief: ascending indices; none without a belief."""
        if near is None:
            return np.empty(0, np.int64)
        unit = metres_of(length_scale)
        radii = self.radius * unit, self.recovery_radius * unit
        if map is not self._map or len(map) != self._length:
            self._cells = [sort_into_cells(map.poses, radius or 1.0) for radius in radii]
            self._map, self._length = map, len(map)
        tracked = len(near.poses) - near.recovery_particles
        parts = near.poses[:tracked], near.poses[tracked:]
        found = [within(*each) for each in zip(self._cells, parts, radii, strict=True)]
        return distinct(np.concatenate(found))

    def with_others(self, chosen: Ints, map: ReferenceGraph) -> Candidates:
        """The chosen references (N,), ascending, and others at even steps over the map, always the same ones.

        Each of the others represents as many as are left out, so that sums by sampling weight are estimates for the
        whole map: the chosen ones, which look most like the view, count for themselves alone. What is read of a map
        that is kept in its file is read again and again, and not all of it little by little. All references where none
        is chosen, or no others would be left out.
        """
        others = len(map) - len(chosen)
        if not len(chosen) or others <= BACKGROUND_REFERENCES:
            return Candidates()
        even = np.linspace(0, len(map) - 1, BACKGROUND_REFERENCES).astype(np.int64)
        even = even[~np.isin(even, chosen)]
        together = np.concatenate([chosen, even])
        weight = np.concatenate([np.ones(len(chosen)), np.full(len(even), others / max(len(even), 1))])
        order = np.argsort(together, kind="stable")
        return Candidates(together[order], weight[order])

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

from .background import with_background

BACKGROUND_REFERENCES = 128
"""References compared of all that are neither near the belief nor similar, the same at each image."""


@dataclass(kw_only=True, eq=False)
class AroundBelief:
    """Selects the references within a radius of any particle, beside those that a stage finds anywhere in the map.

    A mixin, beside `Stage`. A belief may be wrong, so it never chooses alone. Around recovery particles only the
    nearest references are taken: they lie all over the map, and only the nearest matter to them. Radii are in
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
        """The references to compare with the view."""

        candidates: Candidates

    def setup(self, ctx: Context) -> None:
        """Forget the cells of an earlier map."""
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
        """The chosen references, and a sample of the others as background."""
        return with_background(chosen, len(map), BACKGROUND_REFERENCES)

"""Selects the references near a belief, and a sample of the others."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.plane.point_cells import distinct, sort_into_cells, within
from omninav.stages.values.belief import Particles
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph

from .background import with_background

Ints = npt.NDArray[np.int64]


class NearBelief(Stage):
    """Selects the references within a radius of any particle, and a sample of the others as background.

    Around recovery particles only the nearest references are taken: they lie all over the map, and only the nearest
    matter to them. All references are compared where there is no belief, where none is near it, and in a small map.
    Radii are in appearance length scales (port `length_scale`).
    """

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
        """The references to compare with the view."""

        candidates: Candidates

    def setup(self, ctx: Context) -> None:
        """Forget the cells of an earlier map."""
        self._map: ReferenceGraph | None = None
        self._length = 0

    def step(
        self, ctx: Context, map: ReferenceGraph, near: Particles | None = None, length_scale: LengthScale | None = None
    ) -> Out:
        """Select the references for one view."""
        return self.Out(candidates=self._near(ctx, map, near, length_scale))

    def _near(
        self, ctx: Context, map: ReferenceGraph, near: Particles | None, length_scale: LengthScale | None
    ) -> Candidates:
        if near is None or self.radius <= 0.0 or len(map) <= self.compare_all_up_to:
            return Candidates()
        chosen = self._around(map, near, length_scale)
        return with_background(chosen, len(map), self.background_references, ctx.tick.index)

    def _around(self, map: ReferenceGraph, near: Particles, length_scale: LengthScale | None) -> Ints:
        """The references near the belief: ascending indices."""
        unit = self.length_scale_m if length_scale is None else length_scale.metres
        radii = self.radius * unit, self.recovery_radius * unit
        if map is not self._map or len(map) != self._length:
            self._cells = [sort_into_cells(map.poses, radius or 1.0) for radius in radii]
            self._map, self._length = map, len(map)
        tracked = len(near.poses) - near.recovery_particles
        parts = near.poses[:tracked], near.poses[tracked:]
        found = [within(*each) for each in zip(self._cells, parts, radii, strict=True)]
        return distinct(np.concatenate(found))

"""Describes whole views by a projection learned from a tour."""

import numpy as np

from omninav.pipeline import BadInput, Context, Stage
from omninav.stages.values.image import Panorama
from omninav.stages.values.projection import Projection
from omninav.stages.values.views import Coefficients

from .averaged_strip import AveragedStrip, turned_copies


class PrincipalComponents(AveragedStrip, Stage):
    """Describes a view by its averaged panorama projected on the principal components of a tour: y = W z.

    Porta & Kröse 2004, section 2, equation 3. `rows`, `columns`, `channels` and `contrast` must be those with which W
    was learned (stage AveragedView). Raises BadInput where W is for strips of another size.
    """

    def setup(self, ctx: Context) -> None:
        self._projection: Projection | None = None

    def step(self, ctx: Context, panorama: Panorama, projection: Projection) -> AveragedStrip.Out:
        strip = self.strip(panorama)
        if projection is not self._projection:
            self._use(projection, strip.size)
        values = np.moveaxis(strip, 1, 0).ravel()
        turned = (self._turned @ values).reshape(self.headings, -1)
        return self.Out(view=Coefficients(turned[0].copy(), turned))

    def _use(self, projection: Projection, size: int) -> None:
        if projection.components.shape[1] != size:
            raise BadInput(
                f"projection: learned from strips of {projection.components.shape[1]} numbers, the present ones have "
                f"{size}; give features the rows, columns and channels it was learned with, or learn it again"
            )
        self._projection = projection
        self._turned = turned_copies(projection.components, self.headings).reshape(-1, size)

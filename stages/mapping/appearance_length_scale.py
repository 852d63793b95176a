"""Measures the appearance length scale of a finished map."""

import math
from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.length_scale import length_scale
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph


class AppearanceLengthScale(Stage):
    """Measures the distance at which the map's views have lost half of their excess similarity, a correlation length.

    Not in the paper, whose maps are all of one store: it replaces thresholds in metres. Sample references are compared
    with all others at all headings by their mean segment similarity. Views of one segment, which look one way, are
    compared only with those of about the same heading. Manifest fact `appearance_length_scale_m`.
    """

    samples: Annotated[int, Bounds(ge=1)] = 40
    """References, spread evenly over the map, that are compared with all others."""
    share: Annotated[float, Bounds(gt=0, lt=1)] = 0.5
    """Excess similarity left at the length scale."""
    headings: Annotated[int, Bounds(ge=1)] = 36
    """Headings at which views are compared."""
    max_heading_difference_deg: Annotated[float, Bounds(gt=0, le=180)] = 30.0
    """Difference of heading up to which views of one segment are compared, about half of the field of view."""
    min_references: Annotated[int, Bounds(ge=2)] = 10
    """References a map needs to be measured."""
    default_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Length scale of a map that cannot be measured."""

    class Out(Outputs):
        """The length scale of the map's views."""

        length_scale: LengthScale

    def step(self, ctx: Context, map: ReferenceGraph) -> Out:
        """Measure one map."""
        limit = math.radians(self.max_heading_difference_deg)
        metres = length_scale(
            map.poses, map.features, map.kind, self.samples, self.share, self.headings, limit, self.min_references
        )
        metres = self.default_m if metres is None else metres
        ctx.fact("appearance_length_scale_m", round(metres, 3))
        return self.Out(length_scale=LengthScale(metres))

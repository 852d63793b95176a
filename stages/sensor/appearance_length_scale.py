"""Measures the appearance length scale of a finished map."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.appearance.length_scale import length_scale
from omninav.stages.geometry.plane.mount import camera_poses
from omninav.stages.values.length_scale import DEFAULT_M, LengthScale
from omninav.stages.values.maps import ReferenceGraph


class AppearanceLengthScale(Stage):
    """Measures the distance at which the map's views have lost half of their excess similarity, a correlation length.

    Not in the paper, whose maps are all of one store: it replaces thresholds in metres. Sample references are compared
    with all others at all headings by their mean segment similarity. Views of one segment, which look one way, are
    compared only with those of about the same heading. Manifest fact `appearance_length_scale_m`.
    """

    class Out(Outputs):
        length_scale: LengthScale

    def step(self, ctx: Context, map: ReferenceGraph) -> Out:
        # Two poses of a robot that turns are one, those of a camera beside its axis are not.
        seen_from = map.poses if map.landmarks is None else camera_poses(map.poses, map.landmarks.mount)
        metres = length_scale(seen_from, map.features, map.kind)
        metres = DEFAULT_M if metres is None else metres
        ctx.fact("appearance_length_scale_m", round(metres, 3))
        return self.Out(length_scale=LengthScale(metres))

"""Learns a database of images: one reference for each picture of a tour."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.features import SegmentFeatures, SegmentHistograms
from omninav.stages.values.maps import ReferenceEvent, ReferenceGraph, kind_of
from omninav.stages.values.pose import Pose

from .pose_of_view import Supervised, pose_of_view


class ImageDatabaseState(State):
    """The picture taken last: its first reference, where the robot stood, and what its neighbours are joined to."""

    reference: int = -1
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0


class ImageDatabase(Stage):
    """One reference for each picture of a tour, described by its features only.

    Wolf, Burgard & Burkhardt 2005, section VI: images from different positions in the environment. A picture is
    taken where the robot has moved at least `apart_m` or turned at least `apart_deg` since the last one; a rule of 0 is
    off, and with both off every picture is. A panorama is one reference; of windows each is one of its own, at the
    robot's heading turned to where the window looks. Edges join references in the order of the drive. Poses are the
    tour's truth; without it (`supervised: auto`) its odometry; the map says which. Raises BadInput where
    `supervised: truth` finds none.
    """

    apart_m: Annotated[float, Bounds(ge=0)] = 0.0
    apart_deg: Annotated[float, Bounds(ge=0, le=180)] = 0.0
    supervised: Supervised = "auto"

    class Out(Outputs):
        """The grown map, and the first reference that this tick added to it."""

        map: ReferenceGraph
        events: ReferenceEvent | None = None

    def step(
        self,
        ctx: Context,
        features: SegmentFeatures,
        odometry: Pose | None,
        truth: Pose | None,
        map: ReferenceGraph | None,
        last: ImageDatabaseState,
    ) -> Out:
        """Take one picture into the map, or not; without a map, begin one."""
        map = ReferenceGraph.empty() if map is None else map
        if ctx.tick.first_of_log:
            last.reference = -1
        pose = pose_of_view(ctx, odometry, truth, map, self.supervised)
        if pose is None or not self._far(pose, last):
            return self.Out(map=map)
        directions = features.directions if isinstance(features, SegmentHistograms) else None
        if directions is None:
            added = [map.insert(pose, features.values, kind_of(features))]
        else:
            added = [
                map.insert(
                    Pose(pose.x, pose.y, float(wrap(pose.heading + direction))), window[np.newaxis], kind_of(features)
                )
                for direction, window in zip(directions, features.values, strict=True)
            ]
        if last.reference >= 0:
            for number, reference in enumerate(added):
                map.join(last.reference + number, reference)
        first = len(map) == len(added)
        last.reference, last.x, last.y, last.heading = added[0], pose.x, pose.y, pose.heading
        return self.Out(map=map, events=ReferenceEvent(added[0], "first" if first else "far"))

    def _far(self, pose: Pose, last: ImageDatabaseState) -> bool:
        if last.reference < 0 or (self.apart_m <= 0.0 and self.apart_deg <= 0.0):
            return True
        moved = math.hypot(pose.x - last.x, pose.y - last.y)
        turned = math.degrees(abs(float(wrap(pose.heading - last.heading))))
        return (self.apart_m > 0.0 and moved >= self.apart_m) or (self.apart_deg > 0.0 and turned >= self.apart_deg)

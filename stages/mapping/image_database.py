"""Learns an image database: one reference for each image of a tour."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.features import SegmentFeatures, SegmentHistograms
from omninav.stages.values.maps import ReferenceEvent, ReferenceGraph
from omninav.stages.values.pose import Pose

from .pose_of_view import Supervised, pose_of_view


class ImageDatabaseState(State):
    """The last image taken: its first reference, and the robot's position."""

    reference: int = -1
    x: float = 0.0
    y: float = 0.0


class ImageDatabase(Stage):
    """Adds one reference for each image of a tour, described by its features only.

    Wolf, Burgard & Burkhardt 2005, section VI: images from different positions in the environment. An image is taken
    where the robot has moved far enough since the last one. A panorama is one reference; each window is one
    of its own, at the robot's heading plus the window's direction. Edges join references in the order of the drive.
    Raises BadInput where `supervised` is `truth` and the tour has none.
    """

    min_distance_m: Annotated[float, Bounds(ge=0)] = 0.0
    """Distance between two images that are taken; 0: every image is taken."""
    supervised: Supervised = "auto"
    """Source of the poses: `truth`, `odometry`, or `auto`: truth where the tour has it. The map keeps it."""

    class Out(Outputs):
        """The grown map, and the first reference that this tick added."""

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
        """Add one image where it is far enough from the last; without a map, begin one."""
        map = ReferenceGraph.empty() if map is None else map
        if ctx.tick.first_of_log:
            last.reference = -1
        pose = pose_of_view(ctx, odometry, truth, map, self.supervised)
        if pose is None or not self._far(pose, last):
            return self.Out(map=map)
        directions = features.directions if isinstance(features, SegmentHistograms) else None
        if directions is None:
            added = [map.insert(pose, features.values, features.kind)]
        else:
            added = [
                map.insert(
                    Pose(pose.x, pose.y, float(wrap(pose.heading + direction))), window[np.newaxis], features.kind
                )
                for direction, window in zip(directions, features.values, strict=True)
            ]
        if last.reference >= 0:
            for number, reference in enumerate(added):
                map.join(last.reference + number, reference)
        first = len(map) == len(added)
        last.reference, last.x, last.y = added[0], pose.x, pose.y
        return self.Out(map=map, events=ReferenceEvent(added[0], "first" if first else "far"))

    def _far(self, pose: Pose, last: ImageDatabaseState) -> bool:
        return last.reference < 0 or math.hypot(pose.x - last.x, pose.y - last.y) >= self.min_distance_m

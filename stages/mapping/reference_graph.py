"""Learns a graph of reference views while the robot is driven around."""

from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.appearance.segments import similarity_at
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.maps import ReferenceEvent, ReferenceGraph, kind_of, within
from omninav.stages.values.pose import Pose

from .pose_of_view import Supervised, pose_of_view


class LearnReferenceGraphState(State):
    """The reference the drive is at: the next one is joined to it."""

    reference: int = -1


class LearnReferenceGraph(Stage):
    """Reference views learned on the fly: a new one where the last are too far away or look too different.

    Gross & Koenig 2004, section 2: a reference is inserted where no other lies within `distance_m`, or where the
    similarity (selective, at the known relative heading) to all references within `vicinity_m` is below `similarity`; 0
    switches that rule off. Edges join references in the order of the drive. Poses are the tour's truth; without it
    (`supervised: auto`) its odometry; the map says which. Raises BadInput where `supervised: truth` finds none.
    """

    distance_m: Annotated[float, Bounds(gt=0)] = 0.02
    vicinity_m: Annotated[float, Bounds(gt=0)] = 0.5
    similarity: Annotated[float, Bounds(ge=0, le=1)] = 0.6
    supervised: Supervised = "auto"

    class Out(Outputs):
        """The grown map, and what this tick did to it."""

        map: ReferenceGraph
        events: ReferenceEvent | None = None

    def step(
        self,
        ctx: Context,
        features: SegmentFeatures,
        odometry: Pose | None,
        truth: Pose | None,
        map: ReferenceGraph | None,
        along: LearnReferenceGraphState,
    ) -> Out:
        """Take one view into the map, or not; without a map, begin one."""
        map = ReferenceGraph.empty() if map is None else map
        if ctx.tick.first_of_log:
            along.reference = -1
        pose = pose_of_view(ctx, odometry, truth, map, self.supervised)
        if pose is None:
            along.reference = -1  # no edge across a gap
            return self.Out(map=map)
        near = within(map.poses, pose.x, pose.y, max(self.distance_m, self.vicinity_m))
        reason = self._reason(features, pose, map, near)
        event = None
        if reason is not None:
            here = map.insert(pose, features.values, kind_of(features))
            event = ReferenceEvent(here, reason)
        else:
            here = int(near[0])
        if along.reference >= 0:
            map.join(along.reference, here)
        along.reference = here
        return self.Out(map=map, events=event)

    def _reason(
        self,
        features: SegmentFeatures,
        pose: Pose,
        map: ReferenceGraph | None,
        near: np.ndarray[tuple[int], np.dtype[np.int64]],
    ) -> Literal["first", "far", "unlike"] | None:
        if not len(map):
            return "first"
        if not len(near) or np.hypot(*(map.poses[near[0], :2] - (pose.x, pose.y))) > self.distance_m:
            return "far"
        if self.similarity > 0.0:
            turns = pose.heading - map.poses[near, 2]
            histograms = map.kind == "histograms"
            alike = similarity_at(map.features[near], features.values, turns, histograms)
            if float(alike.max()) < self.similarity:
                return "unlike"
        return None

"""Learns a graph of reference views during a tour."""

from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.appearance.segments import similarity_at
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.maps import ReferenceEvent, ReferenceGraph, within
from omninav.stages.values.pose import Pose

from .pose_of_view import Supervised, pose_of_view


class LearnReferenceGraphState(State):
    """The current reference, to which the next one is joined."""

    reference: int = -1


class LearnReferenceGraph(Stage):
    """Adds a reference view where the others are too far away or too dissimilar.

    Gross & Koenig 2004, section 2. Similarity is selective, at the known relative heading. Edges join references in the
    order of the drive. Raises BadInput where `supervised` is `truth` and the tour has none.
    """

    distance_m: Annotated[float, Bounds(gt=0)] = 0.02
    """Distance from all references beyond which a new one is added."""
    vicinity_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Distance within which references are compared."""
    similarity: Annotated[float, Bounds(ge=0, le=1)] = 0.6
    """Similarity to all of them below which a new reference is added; 0: this rule is off."""
    supervised: Supervised = "auto"
    """Source of the poses: `truth`, `odometry`, or `auto`: truth where the tour has it. The map keeps it."""

    class Out(Outputs):
        """The grown map, and its change in this tick."""

        map: ReferenceGraph
        events: ReferenceEvent | None = None

    def step(
        self,
        ctx: Context,
        features: SegmentFeatures,
        odometry: Pose | None,
        truth: Pose | None,
        map: ReferenceGraph | None,
        state: LearnReferenceGraphState,
    ) -> Out:
        """Take one view into the map, or not; without a map, begin one."""
        map = ReferenceGraph.empty() if map is None else map
        if ctx.tick.first_of_log:
            state.reference = -1
        pose = pose_of_view(ctx, odometry, truth, map, self.supervised)
        if pose is None:
            state.reference = -1  # no edge across a gap
            return self.Out(map=map)
        near = within(map.poses, pose.x, pose.y, max(self.distance_m, self.vicinity_m))
        reason = self._reason(features, pose, map, near)
        event = None
        if reason is not None:
            here = map.insert(pose, features.values, features.kind)
            event = ReferenceEvent(here, reason)
        else:
            here = int(near[0])
        if state.reference >= 0:
            map.join(state.reference, here)
        state.reference = here
        return self.Out(map=map, events=event)

    def _reason(
        self,
        features: SegmentFeatures,
        pose: Pose,
        map: ReferenceGraph,
        near: np.ndarray[tuple[int], np.dtype[np.int64]],
    ) -> Literal["first", "far", "unlike"] | None:
        if not len(map):
            return "first"
        if not len(near) or np.hypot(*(map.poses[near[0], :2] - (pose.x, pose.y))) > self.distance_m:
            return "far"
        if self.similarity > 0.0:
            turns = pose.heading - map.poses[near, 2]
            similarities = similarity_at(map.features[near], features.values, turns, map.kind)
            if float(similarities.max()) < self.similarity:
                return "unlike"
        return None

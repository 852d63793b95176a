"""Straightens where the views of a topological map were taken by the places that the tour came back to."""

import math
from dataclasses import replace

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, Outputs, Stage
from omninav.stages.geometry.appearance.visual_distance import compare
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.drive_graph import Closures, closure_sigmas, placed_drives, straightened_drives
from omninav.stages.values.compared_views import ComparedViews

MIN_GAP = 10
"""Views of one tour between the two of a closure."""
STANDING_M = 0.01
"""Largest distance between the poses of two images of a robot that stands (m)."""
MIN_WEIGHT = 0.1
"""Weight of a closure below which the others have contradicted it."""
SPECS = {
    "straightened.closures": MetricSpec(title="Loop closures found", context=True),
    "straightened.rejected": MetricSpec(title="Loop closures rejected, as the others contradict them", context=True),
    "straightened.moved_rms_m": MetricSpec(title="Views moved by, root mean square", context=True),
    "straightened.moved_max_m": MetricSpec(title="Views moved by, largest", context=True),
}


class StraightenViews(Stage):
    """Corrects the poses of a tour's views, where they are odometry, so that loop closures become consistent.

    Two views of different times, or of different tours, that are as alike as two that follow each other close a loop. A
    pose graph of odometry and closures gives the poses, with Cauchy's loss on closures, since some are wrong. Places
    and links do not depend on poses, which are for scoring and drawing. Poses that are ground truth stay, and so do
    those of a tour that comes back to no place. Manifest fact `map_straightened`.
    """

    class Out(Outputs):
        """The views with straightened poses, or as they were."""

        views: ComparedViews
        metrics: Metrics | None = None

    def step(self, ctx: Context, views: ComparedViews) -> Out:
        """Straighten a whole tour, or several."""
        if views.pose_source == "truth" or len(views) < 2:
            return self.Out(views=views)
        ways = np.hypot(*np.diff(views.poses[:, :2], axis=0).T)
        follows = np.flatnonzero((np.diff(views.tours) == 0) & (ways > STANDING_M))
        found = self._closures(views, views.distances[follows, follows + 1])
        unit = float(np.median(ways[follows])) if len(follows) else 0.0
        drives = np.unique(views.tours, return_inverse=True)[1].astype(np.int64)
        start, joined = placed_drives(views.poses, drives, found, MIN_GAP * unit)
        if not joined.all():
            apart = ", ".join(str(drive + 1) for drive in np.flatnonzero(~joined))
            ctx.warn(
                f"mapping: of {len(joined)} tours number {apart} shows no place of the first often enough, so where it "
                "lies is not known and no route may lead there; drive one tour through the places of both, or learn a "
                "map of each (tour=FILE)"
            )
        if not len(found.pairs) or not unit:
            ctx.fact(
                "map_straightened", "no: no loop closure was found in the tour, so odometry's drift cannot be corrected"
            )
            return self.Out(views=views)
        usable = joined[drives[found.pairs]].all(axis=1)
        found = Closures(found.pairs[usable], found.turns[usable])
        poses, weights = straightened_drives(start, drives, found, *closure_sigmas(unit))
        moved = np.hypot(*(poses - views.poses)[:, :2].T)
        values = {
            "closures": len(weights),
            "rejected": int((weights < MIN_WEIGHT).sum()),
            "moved_rms_m": float(np.sqrt((moved**2).mean())),
            "moved_max_m": float(moved.max()),
        }
        ctx.fact("map_straightened", "by {closures} closures, {moved_max_m:.2f} m at most".format(**values))
        return self.Out(views=replace(views, poses=poses), metrics=Metrics({"straightened": values}, SPECS))

    def _closures(self, views: ComparedViews, usual: Array) -> Closures:
        # For each view the most alike of those before it that are no neighbours along its tour.
        limit = float(np.median(usual[np.isfinite(usual)])) if np.isfinite(usual).any() else 0.0
        pairs = []
        for view in range(1, len(views)):
            near = (views.tours[:view] == views.tours[view]) & (np.arange(view) > view - MIN_GAP)
            distances = np.where(near, math.inf, views.distances[view, :view])
            if distances.min() <= limit:
                pairs.append((int(distances.argmin()), view))
        options = views.comparison_options()
        turns = [compare(views.view_features(one), views.view_features(other), options).turn for one, other in pairs]
        return Closures(np.array(pairs, np.int64).reshape(-1, 2), np.array(turns, np.float64))

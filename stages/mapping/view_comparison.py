"""Compares every two views of a tour."""

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, Tick
from omninav.stages.geometry.appearance.visual_distance import (
    MAX_GLOBAL_DISTANCE,
    MIN_MATCHES,
    ComparisonOptions,
    PatchDistance,
    ViewFeatures,
    colour_distances,
    compare,
)
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.plane.se2 import wrap_angle
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.drive import pose_rows
from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures, view_features
from omninav.stages.values.own_body import OwnBody, without_body
from omninav.stages.values.pose import AssumedPose, Pose, PoseSource, frame_of
from omninav.stages.values.topological_map import TopologicalMap

from .pose_of_view import Supervised

STANDING = (0.02, math.radians(2.0))
"""Largest motion (m, rad) between two images of a robot that stands."""
ORDER_GAP = 1000
"""Gap between the numbers of the last view of a tour and the first of the next: they do not follow each other."""


class ViewComparison(Stage):
    """Computes visual distances between all views of a tour, and to those of a known map that it extends.

    Goedemé et al. 2007, section 4.2 (equations 3 and 4; erratum 27 in docs/papers.md): local features are only compared
    where the global colours leave it open. A known map takes part with the features that it keeps of its views. Poses
    are kept for scoring and drawing only; odometry tells where the robot stood. Raises BadInput where no image shows
    anything, where `supervised: truth` finds no true pose, or where known and new poses are not of one source.
    """

    every_s: Annotated[float, Bounds(ge=0)] = 1.0
    """Shortest time between two views; images in between are passed over."""
    ratio: Annotated[float, Bounds(gt=0, le=1)] = 0.8
    """Largest ratio of a match's distance to that of the second nearest of either patch."""
    patch_distance: PatchDistance = "euclidean"
    """Distance of patches' descriptors: `euclidean`, or `mahalanobis`, the paper's (section 3.4, equation 2)."""
    max_global_distance: Annotated[float, Bounds(gt=0)] = MAX_GLOBAL_DISTANCE
    """Largest distance between the global colours of views that are compared further."""
    min_matches: Annotated[int, Bounds(ge=1)] = MIN_MATCHES
    """Fewest matches of views that have something in common."""
    supervised: Supervised = "auto"
    """Source of poses: the tour's `truth`, its `odometry`, or `auto`: the truth where there is one."""

    class Out(Outputs):
        views: ComparedViews

    def step(
        self,
        ctx: Context,
        ticks: Sequence[Tick],
        features: Sequence[LocalFeatures | None],
        descriptor: Sequence[GlobalDescriptor | None],
        odometry: Sequence[Pose | None] = (),
        truth: Sequence[Pose | None] = (),
        known: TopologicalMap | None = None,
        body: Sequence[OwnBody | None] = (),
    ) -> Out:
        features = without_body(features, body)
        source = self._pose_source(ctx, odometry, truth, known)
        poses = truth if source == "truth" else odometry
        rows = self._chosen(ticks, features, descriptor, poses, odometry)
        seen = [each for row in rows if (each := features[row]) is not None]
        wholes = [whole for row in rows if (whole := descriptor[row]) is not None]
        taken = pose_rows([poses[row] if row < len(poses) else None for row in rows])
        logs = np.array([ticks[row].log for row in rows], np.int64)
        frames, orders = np.array(rows, np.int64), np.cumsum(np.where(np.diff(logs, prepend=-1) == 0, 1, ORDER_GAP)) - 1
        tours, owners, known_count = 1 + logs, np.full(len(rows), -1, np.int64), 0
        if known is not None:
            known_count = len(known.views)
            seen = [*map(known.views.features, range(known_count)), *seen]
            wholes = [*map(known.views.global_moments, range(known_count)), *wholes]
            taken = np.concatenate([known.poses, taken])
            frames = np.append(known.frames, known.frames.max(initial=-1) + 1 + frames)
            orders = np.append(known.orders, known.orders.max(initial=-1) + 1 + orders)
            tours, owners = np.append(np.zeros(known_count, np.int64), tours), np.append(known.owner, owners)
        if not seen:
            raise BadInput("mapping: no image of the tour shows anything; use another tour")
        ctx.status(f"comparing {len(seen)} views")
        options = ComparisonOptions(self.ratio, min_matches=self.min_matches, patch_distance=self.patch_distance)
        colours = np.stack([each.values for each in wholes]).astype(np.float64)
        close = colour_distances(colours[:, None], colours[None]) <= self.max_global_distance
        distances, shares = compare_all(ctx, [view_features(each) for each in seen], close, known_count, options)
        return self.Out(
            views=ComparedViews(
                features=tuple(seen),
                descriptors=tuple(wholes),
                poses=taken,
                pose_source=source,
                frames=frames,
                orders=orders,
                tours=tours,
                owners=owners,
                distances=distances,
                shares=shares,
                options=options[:-1],  # how they were searched does not matter
            )
        )

    def _chosen(
        self,
        ticks: Sequence[Tick],
        features: Sequence[LocalFeatures | None],
        descriptors: Sequence[GlobalDescriptor | None],
        poses: Sequence[Pose | None],
        odometry: Sequence[Pose | None],
    ) -> list[int]:
        """The images that take part: no two of a tour closer together than `every_s`, with a tolerance of a tenth.

        Where poses are known, those without one are passed over, and by odometry those of a robot that has not moved
        since: the views between two others stand for the way between them.
        """
        chosen: list[int] = []
        known = any(pose is not None for pose in poses)
        measured = [None if isinstance(pose, AssumedPose) else pose for pose in odometry]
        driven = pose_rows([*measured, *[None] * (len(ticks) - len(odometry))])
        for row, tick in enumerate(ticks):
            if features[row] is None or descriptors[row] is None or (known and poses[row] is None):
                continue
            last = ticks[chosen[-1]] if chosen else None
            if last is None or last.log != tick.log:
                chosen.append(row)
            elif tick.stamp - last.stamp >= 0.9e9 * self.every_s:
                x, y, turn = driven[row] - driven[chosen[-1]]
                stands = math.hypot(x, y) < STANDING[0] and abs(wrap_angle(turn)) < STANDING[1]
                if not stands:
                    chosen.append(row)
        return chosen

    def _pose_source(
        self, ctx: Context, odometry: Sequence[Pose | None], truth: Sequence[Pose | None], known: TopologicalMap | None
    ) -> PoseSource:
        there = any(pose is not None for pose in truth)
        if self.supervised == "truth" and not there:
            raise BadInput(
                "mapping: the tour has no ground truth; use a tour with it (tour_settings.truth=FILE), or "
                "nodes.views.supervised=auto"
            )
        first = next((pose for pose in odometry if pose is not None), None)
        source: PoseSource = "truth" if there and self.supervised != "odometry" else frame_of(first)
        if known is not None and len(known) and known.pose_source != source:
            raise BadInput(
                f"mapping: the known map's poses are from {known.pose_source}, the tour's from {source}: they have "
                "no frame in common; use a tour with the same, or nodes.views.supervised=truth"
            )
        ctx.fact("map_poses", source)
        return source


def compare_all(
    ctx: Context, views: Sequence[ViewFeatures], close: Bools, known: int, options: ComparisonOptions
) -> tuple[Array, Array]:
    """Visual distances of every two views, inf where they are not `close`, and shares of features that match: (N, N).

    Of the first `known` views only a part of the features is kept.
    """
    number = len(views)
    distances, shares = np.full((number, number), math.inf), np.zeros((number, number))
    for one in range(number):
        ctx.progress(one, number)
        distances[one, one], shares[one, one] = 0.0, 1.0
        for other in range(one + 1, number):
            if close[one, other]:
                found = compare(views[one], views[other], options, part=one < known <= other)
                distances[one, other] = distances[other, one] = found.distance
                shares[one, other] = shares[other, one] = found.matches / max(found.features, 1.0)
    return distances, shares

"""Compares every two views of a tour."""

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, Tick
from omninav.pipeline.graph.problems import BadInput
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
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.drive import pose_row
from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures, view_features
from omninav.stages.values.pose import Pose, PoseSource, frame_of
from omninav.stages.values.topological_map import TopologicalMap

from .pose_of_view import Supervised

ORDER_GAP = 1000
"""Gap between the numbers of the last view of a tour and the first of the next: they do not follow each other."""


class View(NamedTuple):
    """One view, with the fields of `ComparedViews`."""

    features: LocalFeatures
    descriptor: GlobalDescriptor
    pose: tuple[float, float, float]
    frame: int
    order: int
    tour: int
    owner: int = -1


class ViewComparison(Stage):
    """Computes visual distances between all views of a tour, and to those of a known map that it extends.

    Goedemé et al. 2007, section 4.2 (equations 3 and 4; erratum 27 in docs/papers.md): local features are only compared
    where the global colours leave it open. A known map takes part with the features that it keeps of its views. Poses
    are kept for scoring and drawing only. Raises BadInput where no image shows anything, where `supervised: truth`
    finds no true pose, or where known and new poses are not of one source.
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
    ) -> Out:
        """The whole tour at once."""
        source = self._pose_source(ctx, odometry, truth, known)
        poses = truth if source == "truth" else odometry
        views = [] if known is None else known_views(known)
        frame = 1 + max((view.frame for view in views), default=-1)
        order = max((view.order for view in views), default=-1)
        log = -1
        for row in self._chosen(ticks, features, descriptor):
            order += 1 if ticks[row].log == log else ORDER_GAP
            log = ticks[row].log
            seen, whole = features[row], descriptor[row]
            assert seen is not None
            assert whole is not None
            pose = pose_row(poses[row] if row < len(poses) else None)
            views.append(View(seen, whole, pose, frame + row, order, 1 + log))
        if not views:
            raise BadInput("mapping: no image of the tour shows anything; use another tour")
        ctx.doing(f"comparing {len(views)} views")
        options = ComparisonOptions(self.ratio, min_matches=self.min_matches, patch_distance=self.patch_distance)
        colours = np.stack([view.descriptor.values for view in views]).astype(np.float64)
        close = colour_distances(colours[:, None], colours[None]) <= self.max_global_distance
        prepared = [view_features(view.features) for view in views]
        known_number = sum(view.owner >= 0 for view in views)
        distances, shares = compare_all(ctx, prepared, close, known_number, options)
        return self.Out(
            views=ComparedViews(
                features=tuple(view.features for view in views),
                descriptors=tuple(view.descriptor for view in views),
                poses=np.array([view.pose for view in views]),
                pose_source=source,
                frames=np.array([view.frame for view in views], np.int64),
                orders=np.array([view.order for view in views], np.int64),
                tours=np.array([view.tour for view in views], np.int64),
                owners=np.array([view.owner for view in views], np.int64),
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
    ) -> list[int]:
        """The images that take part: no two of a tour closer together than `every_s`, with a tolerance of a tenth."""
        chosen: list[int] = []
        for row, tick in enumerate(ticks):
            if features[row] is None or descriptors[row] is None:
                continue
            last = ticks[chosen[-1]] if chosen else None
            if last is None or last.log != tick.log or tick.stamp - last.stamp >= 0.9e9 * self.every_s:
                chosen.append(row)
        return chosen

    def _pose_source(
        self,
        ctx: Context,
        odometry: Sequence[Pose | None],
        truth: Sequence[Pose | None],
        known: TopologicalMap | None,
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


def known_views(known: TopologicalMap) -> list[View]:
    """The views that a map keeps, of tour 0."""
    views = []
    for view in range(len(known.views)):
        x, y, heading = (float(number) for number in known.poses[view])
        views.append(
            View(
                known.views.features(view),
                known.views.global_moments(view),
                (x, y, heading),
                int(known.frames[view]),
                int(known.orders[view]),
                0,
                int(known.owner[view]),
            )
        )
    return views


def compare_all(
    ctx: Context,
    views: Sequence[ViewFeatures],
    close: Bools,
    known: int,
    options: ComparisonOptions,
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

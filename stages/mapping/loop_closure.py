"""Places of a tour: clusters of views, and Dempster-Shafer evidence that two parts of the drive are one place."""

import math
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance import place_clusters
from omninav.stages.geometry.arrays import Ints
from omninav.stages.geometry.probability import dempster_shafer
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.topological_map import LoopHypotheses

IGNORANCE = 0.25
"""Ignorance of a hypothesis before its neighbours have spoken (erratum 30 in docs/papers.md)."""
NEIGHBOUR_DISTANCE = 20.0
"""Views along the drive within which another hypothesis is a neighbour."""


class LoopClosure(Stage):
    """Groups views into places, and decides by evidence which parts of a drive are the same place.

    Goedemé et al. 2007, section 4.4. Views that are all close to each other make a cluster; its parts along the drive
    are subclusters, and each two subclusters of a cluster a hypothesis: they are one place. A hypothesis starts with
    the similarity of the two views that represent its subclusters (erratum 28 in docs/papers.md), and neighbours along
    the drive add evidence in one pass (erratum 31). It is accepted where its support is large enough and some neighbour
    has spoken: nothing can be decided of an isolated one (section 4.4.3). Places of a known map stay together.
    """

    place_size: Annotated[float, Bounds(gt=0)] = 0.5
    """Largest visual distance between two views of a cluster."""
    between: Literal["nearest", "medoids"] = "nearest"
    """Which views represent two subclusters: the `nearest` two, or the paper's `medoids`, distant where a drive
    returns between its images."""
    min_share: Annotated[float, Bounds(ge=0, le=1)] = 0.4
    """Share of the features that match, for two views to be similar: a wall that repeats itself matches exactly, but
    only on one side of the robot."""
    similarity: Literal["ratio", "gaussian"] = "gaussian"
    """Function that turns a visual distance into a similarity, scaled by the root mean square distance within
    subclusters."""
    min_support: Annotated[float, Bounds(ge=0, le=1)] = 0.5
    """Support that an accepted hypothesis must exceed."""
    accepted: Literal["merge", "link"] = "merge"
    """Whether the subclusters of an accepted hypothesis become one place, or two that are linked."""

    class Out(Outputs):
        """The place of each view, and what became of each hypothesis."""

        hypotheses: LoopHypotheses

    def step(self, ctx: Context, views: ComparedViews) -> Out:
        distances, owners = views.distances, views.owners
        cluster = place_clusters.complete_linkage(distances, self.place_size)
        subcluster = subclusters_of(cluster, views)
        number = int(subcluster.max()) + 1
        medoids = place_clusters.medoids(distances, subcluster)
        pairs = place_clusters.hypotheses(cluster, subcluster)
        known = owners[medoids]
        pairs = pairs[(known[pairs] < 0).any(axis=1)]  # two places of a known map are not questioned again
        ends = medoids[pairs]
        if self.between == "nearest":
            ends = place_clusters.nearest_views(distances, subcluster, pairs)
        visual_distances = distances[ends[:, 0], ends[:, 1]]
        enough = views.shares[ends[:, 0], ends[:, 1]] >= self.min_share
        spread = place_clusters.rms_within(distances, subcluster)
        similarity = dempster_shafer.similarity_of(
            np.where(enough, visual_distances, math.inf), spread, self.similarity
        )
        initial = dempster_shafer.masses(similarity, 1.0 - IGNORANCE)
        gaps = place_clusters.between_hypotheses(ends, views.orders)
        masses = dempster_shafer.gather(initial, gaps, NEIGHBOUR_DISTANCE)
        informed = masses[:, dempster_shafer.UNKNOWN] < initial[:, dempster_shafer.UNKNOWN]
        accepted = (masses[:, dempster_shafer.SUPPORT] > self.min_support) & informed
        joined = [pairs[accepted]] if self.accepted == "merge" else []
        for place in range(int(known.max(initial=-1)) + 1):
            parts = np.flatnonzero(known == place)
            joined.append(np.column_stack([parts[:-1], parts[1:]]))
        together = np.concatenate([np.zeros((0, 2), np.int64), *joined])
        place_of_part = place_clusters.groups(number, together)
        return self.Out(
            hypotheses=LoopHypotheses(
                poses=views.poses,
                cluster=cluster,
                subcluster=subcluster,
                place=place_clusters.renumbered(place_of_part[subcluster]),
                tour=views.tours,
                pairs=ends,
                distances=visual_distances,
                initial=initial,
                masses=masses,
                accepted=accepted,
                pose_source=views.pose_source,
            )
        )


def subclusters_of(cluster: Ints, views: ComparedViews) -> Ints:
    """Subclusters (N,) along the drive; of a known map's views those of one place and one cluster."""
    along = place_clusters.subclusters(cluster, views.tours)
    known = len(cluster) + views.owners * (int(cluster.max()) + 1) + cluster
    return place_clusters.renumbered(np.where(views.owners >= 0, known, along))

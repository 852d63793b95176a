"""Views of a tour whose visual distances are given, with nothing in them."""

from collections.abc import Sequence

import numpy as np
from made_words import NOTHING

from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.local_features import GlobalDescriptor
from omninav.stages.values.pose import PoseSource
from omninav.stages.values.topological_map import LoopHypotheses

NO_FEATURES = NOTHING


def made_views(
    distances: np.ndarray,
    shares: np.ndarray | None = None,
    tours: Sequence[int] | None = None,
    owners: Sequence[int] | None = None,
    orders: Sequence[int] | None = None,
    poses: np.ndarray | None = None,
    pose_source: PoseSource = "odometry",
) -> ComparedViews:
    """Views with these distances (N, N). Of features all match, all are of one tour and new, a metre apart, where no
    more is said."""
    number = len(distances)
    row = np.arange(number)
    return ComparedViews(
        features=(NO_FEATURES,) * number,
        descriptors=(GlobalDescriptor(np.zeros(3, np.float32)),) * number,
        poses=np.column_stack([row, 0.0 * row, 0.0 * row]) if poses is None else poses,
        pose_source=pose_source,
        frames=10 * row,
        orders=row if orders is None else np.array(orders),
        tours=np.ones(number, np.int64) if tours is None else np.array(tours),
        owners=np.full(number, -1) if owners is None else np.array(owners),
        distances=np.asarray(distances, np.float64),
        shares=np.ones((number, number)) if shares is None else shares,
        options=(0.8, 0.8, 0.5, 8, 0.01, "euclidean"),
    )


def made_hypotheses(
    views: ComparedViews, place: Sequence[int], pairs: Sequence[tuple[int, int]] = (), accepted: int = 0
) -> LoopHypotheses:
    """The places of views, each its own cluster and part, and hypotheses of which the first `accepted` are accepted."""
    own, number = np.array(place, np.int64), len(pairs)
    return LoopHypotheses(
        poses=views.poses,
        cluster=own,
        subcluster=own,
        place=own,
        tour=views.tours,
        pairs=np.array(pairs, np.int64).reshape(-1, 2),
        distances=np.zeros(number),
        initial=np.zeros((number, 3)),
        masses=np.zeros((number, 3)),
        accepted=np.arange(number) < accepted,
        pose_source=views.pose_source,
    )


def between_looks(looks: Sequence[float]) -> np.ndarray:
    """Visual distances (N, N) of views that look like points on a line."""
    at = np.asarray(looks, np.float64)
    return np.abs(at[:, None] - at[None])

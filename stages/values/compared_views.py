"""The views of a tour, each two compared: what places are made of."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.appearance.visual_distance import ComparisonOptions, PatchDistance, ViewFeatures
from omninav.stages.geometry.arrays import Array, Ints

from .local_features import GlobalDescriptor, LocalFeatures, view_features
from .pose import PoseSource


class ComparedViews(Value):
    """N views in the order of the drive, first those of a known map, with their visual distances.

    `features` and `descriptors`: one entry for each view. `poses` (N, 3): x, y (m),
    heading (rad), from `pose_source`: for scoring and drawing only. `frames` (N,): their numbers among all images;
    `orders` (N,): among the views, with a gap from tour to tour. `tours` (N,): which tour each is from, 0 for a known
    map. `owners` (N,): their place in the known map, -1 for new ones.

    `distances` (N, N): visual distances, inf where two views have nothing in common. `shares` (N, N): of the features,
    how many match. `options`: the ratios of patches and segments, the largest colour distance, the least number of
    matches, the smallest mean angle (rad) and the distance of patches by which they were compared.
    """

    features: Annotated[tuple[LocalFeatures, ...], Shape("N")]
    descriptors: Annotated[tuple[GlobalDescriptor, ...], Shape("N")]
    poses: Annotated[Array, Shape("N", 3)]
    pose_source: PoseSource
    frames: Annotated[Ints, Shape("N")]
    orders: Annotated[Ints, Shape("N")]
    tours: Annotated[Ints, Shape("N")]
    owners: Annotated[Ints, Shape("N")]
    distances: Annotated[Array, Shape("N", "N", finite=False), Bounds(ge=0)]
    shares: Annotated[Array, Shape("N", "N"), Bounds(ge=0)]
    options: tuple[float, float, float, int, float, PatchDistance]

    def __len__(self) -> int:
        return len(self.features)

    def view_features(self, view: int) -> ViewFeatures:
        """A view prepared for comparison with others."""
        return view_features(self.features[view])

    def deviation(self) -> float:
        """Standard deviation of the visual distances of each two views that have anything in common; 0 without any."""
        apart = self.distances[np.triu_indices(len(self), 1)]
        apart = apart[np.isfinite(apart)]
        return float(apart.std()) if len(apart) else 0.0

    def comparison_options(self) -> ComparisonOptions:
        """The options by which the views were compared."""
        return ComparisonOptions(*self.options)
